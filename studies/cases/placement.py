"""Fig. 11: disoccluded pixels by placement of the keyframes (§4.2, §6)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from enfilade.camera.path import Segment
from enfilade.methods.analysis import Analysis, keyframes_of
from enfilade.methods.paper.composite import composite
from enfilade.methods.paper.warp import warped_pair
from enfilade.methods.walkthrough import Walkthrough
from enfilade.monitor import Monitor
from enfilade.records import Halves, Keyframe
from enfilade.settings import KeyframeSettings, Placement, WarpSettings
from studies.cases.case import Case
from studies.progress import counted

ADAPTATIONS = (0.0, 0.1, 0.25, 0.5, 0.75, 0.9)  # A of Eq. 6
PAPER_A = 0.5  # §6
PAPER_PERCENT = {0.0: 4.04, PAPER_A: 2.00}  # by A, §6, ROOM


def measure(case: Case) -> dict[str, Any]:
    """Share of pixels that neither keyframe shows, frame by frame, for several placements.

    Returns
    -------
    dict
        ``numbers`` of all frames; ``placements``: for each its ``name``, ``adaptation`` (None for equal
        flow), numbers of ``keyframes`` and of the measured ``frames``, ``percent`` of each of these, and the
        ``mean`` over all frames of the path.
    """
    default = KeyframeSettings()
    placements = [replace(default, placement=Placement.ADAPTED, adaptation=a) for a in ADAPTATIONS]
    placements.append(replace(default, placement=Placement.EQUAL_FLOW))
    rows = []
    for placed in placements:
        is_in_paper = placed.placement is Placement.ADAPTED and placed.adaptation in PAPER_PERCENT
        step = 1 if is_in_paper else case.extent.sweep_step
        rows.append(disocclusions(case.walk, case.analysis, placed, step, case.monitor))
    return {"numbers": list(case.walk.path.numbers), "placements": rows}


def disocclusions(
    walk: Walkthrough, analysis: Analysis, placed: KeyframeSettings, step: int, monitor: Monitor
) -> dict[str, Any]:
    """Disoccluded pixels of one placement.

    One in `step` in-betweens of a segment is measured, and represents its neighbours.
    """
    path, numbers = walk.path, walk.path.numbers
    shots = Analysis(
        path, walk.settings.replace(KeyframeSettings, **vars(placed)), analysis.frames
    ).segments()
    segments = [s for shot in shots for s in shot]
    adaptation = placed.adaptation if placed.placement is Placement.ADAPTED else None
    name = placed.placement.value if adaptation is None else f"A = {adaptation:g}"
    percent: dict[int, float] = {}
    total = 0.0
    for segment in counted(segments, f"disocclusions, {name}", monitor):
        distinct = path.distinct_inbetweens(segment)
        chosen = distinct[(step - 1) // 2 :: step] or distinct[:1]
        found = {frame: disoccluded_percent(walk, segment, frame) for frame in chosen}
        if found:
            total += len(distinct) * float(np.mean(list(found.values())))
        percent |= found
    return {
        "name": placed.placement.value,
        "adaptation": adaptation,
        "keyframes": [numbers[k] for k in keyframes_of(segments)],
        "frames": [numbers[f] for f in percent],
        "percent": list(percent.values()),
        "mean": total / len(path),
    }


def disoccluded_percent(walk: Walkthrough, segment: Segment, frame: int) -> float:
    """Share of a frame's pixels, percent, whose surface neither keyframe of its segment shows."""
    first, last = _unshaded(walk, segment.first), _unshaded(walk, segment.last)
    before, after = warped_pair(walk, first, last, frame)
    _, is_disoccluded = composite(
        before,
        after,
        walk.view(frame).geometry,
        progress=walk.path.progress(segment, frame),
        settings=walk.settings[WarpSettings],
    )
    return 100.0 * float(is_disoccluded.mean())


def _unshaded(walk: Walkthrough, frame: int) -> Keyframe:
    geometry = walk.view(frame).geometry
    black = np.zeros((*geometry.depth.shape, 3), np.float32)
    return Keyframe(geometry, Halves(black, black))
