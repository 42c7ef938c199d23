"""Figs. 12 and 13, Table 1: velocity, predictions of the metric, and traced pixels (§6)."""

from __future__ import annotations

from typing import Any

import numpy as np

from enfilade.methods.paper.refine import Refinement
from enfilade.settings import MaskSettings
from studies.cases.case import Case
from studies.progress import counted

PAPER_SHARES = {  # Table 1, percent
    "atrium": {"slow": 2.4, "specular": 40.8, "occlusion": 0.3, "keyframes": 6.0, "total": 49.5},
    "room": {"slow": 28.1, "specular": 0.0, "occlusion": 1.9, "keyframes": 5.1, "total": 35.1},
}


def measure(case: Case) -> dict[str, Any]:
    """Statistics of each frame and each segment, from the run's ledger.

    Returns
    -------
    dict
        ``per_frame`` and ``segments`` of the run; ``plain_segments``: segments without noise;
        ``predictions``, ``plain``: see :func:`predictions`; ``split_percent``: the limit above which segments
        are split.
    """
    summary, plain = case.rendered("paper"), without_noise(case)
    limit = case.whole.settings[MaskSettings].split_percent
    return {
        "per_frame": summary["per_frame"],
        "segments": summary["segments"],
        "plain_segments": plain,
        "predictions": predictions(summary["segments"], limit),
        "plain": predictions(plain, limit),
        "split_percent": limit,
    }


def shares(case: Case) -> dict[str, Any]:
    """Shares of traced pixels from the run's ledger, and of those that might have been.

    Returns
    -------
    dict
        ``table1``: percent by reason. ``specular_seen``: mean share of pixels on glossy, mirroring or
        transparent surfaces, traced or not; ``slow_seen``: below v_t, keyframes and repeated frames included.
        ``frames``, ``keyframes``: numbers of them.
    """
    summary, frames = case.rendered("paper"), case.analysis.frames
    return {
        "table1": summary["traced_percent"],
        "specular_seen": sum(of.specular_percent for of in frames) / len(frames),
        "slow_seen": sum(of.slow_percent for of in frames) / len(frames),
        "frames": len(frames),
        "keyframes": sum(row["keyframe"] > 0.0 for row in summary["per_frame"]),
    }


def predictions(segments: list[dict[str, Any]], limit: float) -> dict[str, Any]:
    """Effect of splitting on the predicted differences (filled marks of Figs. 12b and 13b).

    Parameters
    ----------
    segments
        As in a summary.
    limit
        Percent of pixels above which a segment is split.

    Returns
    -------
    dict
        ``initial``, ``split``, ``remaining``: numbers of segments. ``before``, ``after``: mean percentage of
        visible differences under pursuit, of the initial ones and of those that remain, weighted by their
        in-betweens; ``split_before``, ``split_after``: the same of the split ones alone and of their parts,
        None where none is; ``before_still``, ``after_still``: of all, without pursuit.
        ``split_not_seen_still``: segments that are split although they are below the limit without pursuit;
        ``seen_still_not_split``: the contrary. ``given_up``: above the limit, and not split, since splitting
        helps no more.
    """
    compared = [s for s in segments if s["middle"] is not None]
    initial = [s for s in compared if s["depth"] == 0]
    remaining = [s for s in compared if not s["is_split"]]
    split = [s for s in compared if s["is_split"]]
    pursuit, still = "percent_visible", "percent_visible_no_pursuit"
    return {
        "initial": len(initial),
        "split": len(split),
        "remaining": len(remaining),
        "before": _mean(initial, pursuit),
        "after": _mean(remaining, pursuit),
        "split_before": _mean([s for s in split if s["depth"] == 0], pursuit),
        "split_after": _mean([s for s in remaining if s["depth"] > 0], pursuit),
        "before_still": _mean(initial, still),
        "after_still": _mean(remaining, still),
        "split_not_seen_still": sum(s[still] <= limit for s in split),
        "seen_still_not_split": sum(s[still] > limit for s in remaining),
        "given_up": sum(s[pursuit] > limit for s in remaining),
    }


def _mean(segments: list[dict[str, Any]], key: str) -> float | None:
    weights = [s["last"] - s["first"] - 1 for s in segments]
    if not sum(weights):
        return None
    return float(np.average([s[key] for s in segments], weights=weights))


def without_noise(case: Case) -> list[dict[str, Any]]:
    """Segments as in a summary, compared and split without noise (`PlainlyLit`)."""
    windows = case.plain_windows
    refinement, numbers = Refinement(windows.walk), windows.walk.path.numbers
    initial = [s for shot in case.analysis.segments() for s in shot]
    rows = []
    for segment in counted(initial, "segments without noise", case.monitor):
        rows += [result.to_table(numbers) for result in refinement.refine(segment, windows.keyframe)]
    return rows
