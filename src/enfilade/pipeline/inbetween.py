"""Frames before antialiasing: keyframes as they are, in-betweens reused and filled (§4.3, Fig. 7)."""

from __future__ import annotations

import numpy as np

from enfilade.camera.path import Segment
from enfilade.images import read_frame, write_frame
from enfilade.methods.paper import composite
from enfilade.methods.paper.masks import slow_pixels, sources, specular_pixels
from enfilade.pipeline.refine import Verdict, warped_pair
from enfilade.pipeline.workshop import Workshop
from enfilade.records import F32, Frame, Mask, Source
from enfilade.renderer import PixelFilter, Purpose


def raw_unit(workshop: Workshop, frame: int) -> str:
    """Name of a frame before antialiasing in the ledger."""
    return f"raw {workshop.number(frame)}"


def read_raw(workshop: Workshop, frame: int) -> Frame:
    """A frame before antialiasing, from the run folder."""
    file = workshop.run.file("raw", workshop.number(frame))
    workshop.run.check(file)
    return read_frame(file)


def make_keyframe(workshop: Workshop, frame: int) -> None:
    """Take a keyframe as it was traced, but for its slow pixels.

    For them no filter will find new samples along the flow (§5.2): they are traced once more, with paths
    that are spread over the pixel. What is warped keeps those through the pixels' centres.
    """
    if workshop.run.done(raw_unit(workshop, frame)):
        return
    color = workshop.keyframe(frame).shading.color.copy()
    is_slow = slow_pixels(workshop.views[frame].speed_deg_s, workshop.job.settings.masks)
    dropped = _fill(workshop, frame, color, is_slow)
    source = np.full(is_slow.shape, Source.KEYFRAME, np.uint8)
    _write(workshop, frame, Frame(color, source), dropped)


def make_inbetween(workshop: Workshop, segment: Segment, verdict: Verdict, frame: int) -> None:
    """Derive a frame from the keyframes of its segment, and trace what can't be derived."""
    if workshop.run.done(raw_unit(workshop, frame)):
        return
    view, settings = workshop.views[frame], workshop.job.settings
    is_slow = slow_pixels(view.speed_deg_s, settings.masks)
    is_specular = specular_pixels(view.geometry, frozenset(verdict.unseen))

    before, after = warped_pair(workshop, segment, frame)
    progress = workshop.job.path.progress(segment, frame)
    with workshop.costs.of("warp"):
        color, is_hole = composite(before, after, view.geometry, progress=progress, settings=settings.warp)

    source = sources(is_slow, is_specular, is_hole)
    dropped = _fill(workshop, frame, color, source != Source.REUSED)
    _write(workshop, frame, Frame(color, source), dropped)


def make_copy(workshop: Workshop, frame: int) -> None:
    """Repeat the frame of the same view: where the camera stands still, nothing new is to be seen."""
    if workshop.run.done(raw_unit(workshop, frame)):
        return
    color = read_raw(workshop, workshop.job.path.static_frame(frame)).color
    _write(workshop, frame, Frame(color, np.full(color.shape[:2], Source.REUSED, np.uint8)), 0)


def _fill(workshop: Workshop, frame: int, color: F32, where: Mask) -> int:
    """Trace some pixels; how many samples were dropped.

    Nothing warps them again, so that their paths may antialias them.
    """
    if not where.any():
        return 0
    filled = workshop.trace(frame, where, Purpose.FILL, PixelFilter.BOX)
    color[where] = filled.color
    return filled.dropped


def _write(workshop: Workshop, frame: int, made: Frame, dropped: int) -> None:
    file = workshop.run.file("raw", workshop.number(frame))
    with workshop.costs.of("files"):
        write_frame(file, made)
    workshop.finish(
        raw_unit(workshop, frame),
        [file],
        frame=workshop.number(frame),
        sources=made.counts,
        dropped=dropped,
    )
