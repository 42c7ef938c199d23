"""Frames before filtering: keyframes, and in-betweens reprojected from them and filled (§4.3, Fig. 7)."""

from __future__ import annotations

import numpy as np

from enfilade.methods.paper.composite import composite
from enfilade.methods.paper.masks import provenance_of, slow_pixels, specular_pixels
from enfilade.methods.paper.refine import SegmentResult, warped_pair
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import F32, Frame, Keyframe, Mask, Provenance, Shading
from enfilade.renderer import PixelFilter, Purpose
from enfilade.settings import MaskSettings, SamplingSettings, WarpSettings


def fill_slow_pixels(walk: Walkthrough, frame: int, shading: Shading) -> tuple[Frame, int]:
    """A keyframe whose slow pixels are traced again, with paths distributed over the pixel.

    The temporal filter finds no new samples for them along the motion (§5.2), so that they must be
    antialiased here. The keyframe that is warped keeps its paths through the pixels' centres.

    Returns
    -------
    frame : Frame
    dropped : int
        Samples that were left out since they were not finite.
    """
    color = shading.color.copy()
    is_slow = slow_pixels(walk.view(frame).speed_deg_s, walk.settings[MaskSettings])
    dropped = _trace_into(walk, frame, color, is_slow)
    return Frame(color, np.full(is_slow.shape, Provenance.KEYFRAME, np.uint8)), dropped


def derive(
    walk: Walkthrough, result: SegmentResult, first: Keyframe, last: Keyframe, frame: int
) -> tuple[Frame, int]:
    """An in-between: both keyframes warped and composited; slow, specular and disoccluded pixels traced.

    Parameters
    ----------
    walk
    result
        Of the segment.
    first, last
        Its keyframes.
    frame

    Returns
    -------
    frame : Frame
    dropped : int
        Samples that were left out since they were not finite.
    """
    view = walk.view(frame)
    is_slow = slow_pixels(view.speed_deg_s, walk.settings[MaskSettings])
    is_specular = specular_pixels(view.geometry, result.reusable)
    before, after = warped_pair(walk, first, last, frame)
    color, is_disoccluded = composite(
        before,
        after,
        view.geometry,
        progress=walk.path.progress(result.segment, frame),
        settings=walk.settings[WarpSettings],
    )
    provenance = provenance_of(is_slow, is_specular, is_disoccluded)
    dropped = _trace_into(walk, frame, color, provenance != Provenance.REUSED)
    return Frame(color, provenance), dropped


def _trace_into(walk: Walkthrough, frame: int, color: F32, where: Mask) -> int:
    """Trace some pixels of an image, with paths distributed over the pixel; returns the samples left out."""
    if not where.any():
        return 0
    filled = walk.trace(
        frame,
        where,
        Purpose.FILL,
        spp=walk.settings[SamplingSettings].spp,
        pixel_filter=PixelFilter.BOX,
    )
    color[where] = filled.color
    return filled.dropped
