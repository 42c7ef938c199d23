"""Frames before antialiasing: keyframes as they are, in-betweens reused and filled (§4.3, Fig. 7)."""

from __future__ import annotations

import numpy as np

from enfilade.codec import read_frame, write_frame
from enfilade.masks import item_pixels, slow_pixels, sources
from enfilade.pipeline.refine import Verdict, warped_pair
from enfilade.pipeline.workshop import Workshop
from enfilade.records import Frame, Segment, Source
from enfilade.renderer import PixelFilter, Purpose
from enfilade.warp import composite


def raw_unit(workshop: Workshop, frame: int) -> str:
    """Name of a frame before antialiasing in the ledger."""
    return f"raw {workshop.number(frame)}"


def read_raw(workshop: Workshop, frame: int) -> Frame:
    """A frame before antialiasing, from the run folder."""
    file = workshop.run.file("raw", workshop.number(frame))
    workshop.run.check(file)
    return read_frame(file)


def make_keyframe(workshop: Workshop, frame: int) -> None:
    """Take a keyframe as it was traced."""
    if workshop.run.done(raw_unit(workshop, frame)):
        return
    shading = workshop.keyframe(frame).shading
    source = np.full(shading.variance.shape, Source.KEYFRAME, np.uint8)
    _write(workshop, frame, Frame(shading.color, source), dropped=0)


def make_inbetween(workshop: Workshop, segment: Segment, verdict: Verdict, frame: int) -> None:
    """Derive a frame from the keyframes of its segment, and trace what can't be derived."""
    if workshop.run.done(raw_unit(workshop, frame)):
        return
    view, settings = workshop.views[frame], workshop.job.settings
    is_slow = slow_pixels(view.speed_deg_s, settings.masks)
    is_specular = item_pixels(view.geometry.item, frozenset(verdict.items))

    before, after = warped_pair(workshop, segment, frame)
    with workshop.costs.of("warp"):
        color, is_hole = composite(
            before, after, view.geometry, progress=segment.progress(frame), settings=settings.warp
        )

    # Nothing warps these pixels again, so that their paths may antialias them.
    source = sources(is_slow, is_specular, is_hole)
    where = source != Source.REUSED
    filled = workshop.trace(frame, where, Purpose.FILL, PixelFilter.BOX)
    color[where] = filled.color
    _write(workshop, frame, Frame(color, source), filled.dropped)


def make_copy(workshop: Workshop, frame: int) -> None:
    """Repeat the frame of the same view: where the camera stands still, nothing new is to be seen."""
    if workshop.run.done(raw_unit(workshop, frame)):
        return
    color = read_raw(workshop, workshop.job.path.original(frame)).color
    _write(workshop, frame, Frame(color, np.full(color.shape[:2], Source.REUSED, np.uint8)), 0)


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
