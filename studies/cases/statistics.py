"""Figs. 12 and 13: velocity, predictions of the metric, and what is traced, over the frames (§6)."""

from __future__ import annotations

from typing import Any

import numpy as np

from enfilade.camera.path import Segment
from enfilade.pipeline.refine import Verdict, refine, segment_unit
from enfilade.pipeline.survey import initial_segments
from enfilade.pipeline.workshop import Workshop
from enfilade.store import Run
from studies.cases.case import Case
from studies.cases.plain import PlainlyLit

__all__ = ["measure", "predictions", "without_noise"]


def measure(case: Case) -> dict[str, Any]:
    """What the run's ledger says of each frame and each segment.

    Returns
    -------
    dict
        ``summary``: as far as the plot asks; ``predictions``: see :func:`predictions`. ``plain_segments`` and
        ``plain``: the same predictions without noise.
    """
    summary = case.rendered()
    plain = without_noise(case)
    kept = ("method", "frames", "size", "spp", "split_percent", "table1", "per_frame", "segments")
    return {
        "summary": {key: summary[key] for key in kept},
        "predictions": predictions(summary["segments"], summary["split_percent"]),
        "plain_segments": plain,
        "plain": predictions(plain, summary["split_percent"]),
    }


def predictions(segments: list[dict[str, Any]], limit: float) -> dict[str, Any]:
    """What splitting did to the differences that the metric predicts (filled marks of Figs. 12b and 13b).

    Parameters
    ----------
    segments
        As a summary has them: each that was judged, with its ``depth``.
    limit
        Percent of pixels above which a segment is split.

    Returns
    -------
    dict
        ``initial``, ``split``, ``remaining``: numbers of segments. ``before``, ``after``: mean percentage
        of visible differences under pursuit, of the initial ones and of those that remain, weighted by
        their in-betweens; ``split_before``, ``split_after``: the same of those alone that are split, and of
        what they are split into, None where none is; ``before_still``, ``after_still``: of all, with the eye
        at rest. ``split_not_seen_still``: segments split although without pursuit they are below the limit.
        ``seen_still_not_split``: the contrary. ``given_up``: above the limit, and not split since splitting
        helps no more.
    """
    judged = [s for s in segments if s["middle"] is not None]
    initial = [s for s in judged if s["depth"] == 0]
    remaining = [s for s in judged if not s["is_split"]]
    split = [s for s in judged if s["is_split"]]
    wholes, parts = [s for s in split if s["depth"] == 0], [s for s in remaining if s["depth"] > 0]
    return {
        "initial": len(initial),
        "split": len(split),
        "remaining": len(remaining),
        "before": _mean(initial, "percent_visible"),
        "after": _mean(remaining, "percent_visible"),
        "split_before": _mean(wholes, "percent_visible"),
        "split_after": _mean(parts, "percent_visible"),
        "before_still": _mean(initial, "percent_visible_no_pursuit"),
        "after_still": _mean(remaining, "percent_visible_no_pursuit"),
        "split_not_seen_still": sum(s["percent_visible_no_pursuit"] <= limit for s in split),
        "seen_still_not_split": sum(s["percent_visible_no_pursuit"] > limit for s in remaining),
        "given_up": sum(s["percent_visible"] > limit for s in remaining),
    }


def _mean(segments: list[dict[str, Any]], key: str) -> float | None:
    weights = [s["last"] - s["first"] - 1 for s in segments]
    if not sum(weights):
        return None
    return float(np.average([s[key] for s in segments], weights=weights))


def without_noise(case: Case) -> list[dict[str, Any]]:
    """What the metric predicts for the segments when nothing hides behind noise.

    The surfaces are plainly lit (:class:`PlainlyLit`); segments are judged and split as in a run.

    Returns
    -------
    list of dict
        As the segments of a summary, in the order of the path.
    """
    job = case.whole
    folder = case.folder / "plain"
    with Run.open(folder, {**job.identity(), "method": "plain"}) as run:
        workshop = Workshop(job, PlainlyLit(case.renderer), run, case.monitor)
        initial = [s for shot in initial_segments(job.path, case.survey, job.settings) for s in shot]
        case.monitor.stage(f"{case.name}: predictions without noise", len(initial))
        rows = []
        for segment in initial:
            rows += _judged(workshop, segment, None)
            case.monitor.advance()
    return rows


def _judged(workshop: Workshop, segment: Segment, whole: Verdict | None) -> list[dict[str, Any]]:
    refine(workshop, segment, whole)
    line = workshop.run.done(segment_unit(workshop, segment))
    if line is None:
        raise RuntimeError(f"{segment} was judged and is not on record")
    verdict = Verdict.from_dict(line["verdict"])
    row = {key: line[key] for key in ("first", "last", "middle", "depth")}
    row |= {"is_split": verdict.is_split, "unseen_items": len(verdict.unseen)}
    row |= {
        "percent_visible": verdict.percent_visible,
        "percent_visible_no_pursuit": verdict.percent_visible_no_pursuit,
    }
    if not verdict.is_split or verdict.middle is None:
        return [row]
    halves = segment.split(verdict.middle)
    return [row, *(found for half in halves for found in _judged(workshop, half, verdict))]
