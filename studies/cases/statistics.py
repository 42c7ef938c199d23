"""Figs. 12 and 13, Table 1: velocity, predictions of the metric, and traced pixels (§6)."""

from __future__ import annotations

from typing import Any

import numpy as np

from enfilade.cache import LruCache
from enfilade.methods.paper.keyframe import trace_keyframe
from enfilade.methods.paper.refine import Refinement
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import Keyframe
from enfilade.settings import MaskSettings
from studies.cases.case import Case
from studies.progress import counted

PAPER_SHARES = {  # Table 1, percent
    "atrium": {"slow": 2.4, "specular": 40.8, "disoccluded": 0.3, "keyframe": 6.0, "total": 49.5},
    "room": {"slow": 28.1, "specular": 0.0, "disoccluded": 1.9, "keyframe": 5.1, "total": 35.1},
}


CACHED_KEYFRAMES = 8  # 150 MiB at 640x480


def measure(case: Case) -> dict[str, Any]:
    """Statistics of each frame and each segment, from the run's ledger.

    Returns
    -------
    dict
        ``per_frame`` and ``segments`` of the run; ``plain_segments``: segments without noise;
        ``predictions``, ``plain``: see :func:`predictions`; ``split_percent``: the limit above which segments
        are split.
    """
    summary, plain = case.rendered("paper"), refined(case, case.noise_free_windows.walk, "no noise")
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
    """Shares of traced pixels from the run's ledger, and of candidates.

    Returns
    -------
    dict
        ``traced_percent``: by reason. ``specular_percent``: mean share of pixels on glossy, mirroring or
        transparent surfaces, traced or not; ``slow_percent``: of pixels below v_t, including keyframes and
        repeated frames. ``frames``, ``keyframes``: their numbers.
    """
    summary, frames = case.rendered("paper"), case.analysis.frames
    return {
        "traced_percent": summary["traced_percent"],
        "specular_percent": sum(of.specular_percent for of in frames) / len(frames),
        "slow_percent": sum(of.slow_percent for of in frames) / len(frames),
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
        visible differences under pursuit, of initial and of remaining segments, weighted by their
        in-betweens; ``split_before``, ``split_after``: the same for split segments and their parts, None
        without splits; ``before_still``, ``after_still``: for all, without pursuit.
        ``split_only_by_pursuit``: split segments below the limit without pursuit;
        ``unsplit_above_limit_still``: remaining segments above the limit without pursuit.
        ``remaining_above_limit``: remaining segments above the limit; 0, since splitting goes on.
    """
    compared = [s for s in segments if None not in (s["middle"], s["percent_visible"])]
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
        "split_only_by_pursuit": sum(s[still] <= limit for s in split),
        "unsplit_above_limit_still": sum(s[still] > limit for s in remaining),
        "remaining_above_limit": sum(s[pursuit] > limit for s in remaining),
    }


def _mean(segments: list[dict[str, Any]], key: str) -> float | None:
    weights = [s["last"] - s["first"] - 1 for s in segments]
    if not sum(weights):
        return None
    return float(np.average([s[key] for s in segments], weights=weights))


def refined(case: Case, walk: Walkthrough, light: str) -> list[dict[str, Any]]:
    """Segments as in a summary: all of a walk, compared and split by a light."""
    kept: LruCache[int, Keyframe] = LruCache(CACHED_KEYFRAMES)

    def keyframe(frame: int) -> Keyframe:
        return kept.get(frame, lambda: Keyframe(walk.view(frame).geometry, trace_keyframe(walk, frame)))

    refinement, rows = Refinement(walk), []
    initial = [s for shot in case.analysis.segments() for s in shot]
    for segment in counted(initial, f"segments, {light}", case.monitor):
        rows += [result.to_table(walk.path.numbers) for result in refinement.refine(segment, keyframe)]
    return rows
