"""Fig. 11: whether keyframe placement by image flow leaves fewer pixels to be recomputed (§4.2, §6)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from enfilade.monitor import Monitor
from enfilade.pipeline.job import Job
from enfilade.pipeline.plan import hole_percent
from enfilade.pipeline.survey import Survey, initial_segments
from enfilade.pipeline.views import Views
from enfilade.settings import KeyframeSettings, Placement
from studies.cases.case import Case

__all__ = ["measure", "recomputed"]

ADAPTATIONS = (0.0, 0.1, 0.25, 0.5, 0.75, 0.9)  # A of Eq. 6
PAPER_A = 0.5  # §6
PAPER_PERCENT = {"uniform": 4.04, "adapted": 2.00}  # §6, ROOM


def measure(case: Case) -> dict[str, Any]:
    """Share of pixels that neither keyframe sees, frame by frame, for several placements.

    Returns
    -------
    dict
        ``numbers``; ``placements``: of each its ``name``, ``adaptation`` (None for equal flow), the
        numbers of its ``keyframes``, ``frames`` that were looked at, ``percent`` of each and their ``mean``
        over all frames of the path.
    """
    job, views = case.whole, case.views(case.whole)
    plain = KeyframeSettings()
    chosen = [replace(plain, placement=Placement.ADAPTED, adaptation=a) for a in ADAPTATIONS]
    chosen.append(replace(plain, placement=Placement.EQUAL_FLOW))
    rows = []
    for keyframes in chosen:
        is_papers = keyframes.placement is Placement.ADAPTED and keyframes.adaptation in (0.0, PAPER_A)
        step = 1 if is_papers else case.terms.sweep_step
        rows.append(recomputed(job, views, case.survey, keyframes, step, case.monitor))
    return {"numbers": list(job.path.numbers), "spacing": plain.spacing, "placements": rows}


def recomputed(
    job: Job, views: Views, survey: Survey, placed: KeyframeSettings, step: int, monitor: Monitor
) -> dict[str, Any]:
    """Holes of one placement.

    Parameters
    ----------
    job, views, survey
    placed
        How the keyframes are placed.
    step
        Every so many-th in-between of a segment is looked at; its holes stand for those beside it.
    monitor
    """
    job = replace(job, settings=replace(job.settings, keyframes=placed))
    segments = [s for shot in initial_segments(job.path, survey, job.settings) for s in shot]
    monitor.stage(f"{job.scene.parent.parent.name}: holes, {_name(placed)}", len(segments))
    percent: dict[int, float] = {}
    total = 0.0
    for segment in segments:
        moving = job.path.distinct_inbetweens(segment)
        looked_at = moving[(step - 1) // 2 :: step] or moving[:1]
        found = {frame: hole_percent(job, views, segment, frame) for frame in looked_at}
        if found:
            total += len(moving) * float(np.mean(list(found.values())))
        percent |= found
        monitor.advance()
    numbers = job.path.numbers
    keyframes = sorted({s.first for s in segments} | {s.last for s in segments})
    return {
        "name": placed.placement.value,
        "adaptation": placed.adaptation if placed.placement is Placement.ADAPTED else None,
        "keyframes": [numbers[k] for k in keyframes],
        "frames": [numbers[f] for f in percent],
        "percent": list(percent.values()),
        "mean": total / len(job.path),
    }


def _name(placed: KeyframeSettings) -> str:
    if placed.placement is Placement.ADAPTED:
        return f"A = {placed.adaptation:g}"
    return str(placed.placement.value)
