"""In-betweens before filtering: reprojected from keyframes, and filled (§4.3, Fig. 7)."""

from __future__ import annotations

from enfilade.methods.denoise import denoise
from enfilade.methods.paper.composite import composite
from enfilade.methods.paper.keyframe import find_guides
from enfilade.methods.paper.masks import provenance_of, slow_pixels, specular_pixels
from enfilade.methods.paper.refine import SegmentResult
from enfilade.methods.paper.warp import warped_pair
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import F32, Frame, Keyframe, Mask, Provenance
from enfilade.renderer import PixelFilter, Purpose
from enfilade.settings import MaskSettings, SamplingSettings, WarpSettings


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
    """Trace some pixels of an image, with paths distributed over the pixel; returns the samples left out.

    The denoiser sees the whole image, and changes the traced pixels alone.
    """
    if not where.any():
        return 0
    spp = walk.settings[SamplingSettings].spp
    filled = walk.trace(frame, Purpose.FILL, spp=spp, pixel_filter=PixelFilter.BOX, where=where)
    color[where] = filled.color
    color[where] = denoise(color, *find_guides(walk, frame, Purpose.GUIDE, spp=spp))[where]
    return filled.dropped
