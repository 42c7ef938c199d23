"""What is compared: two warped keyframes as the filter of §5 will show them (§4.3, step 3).

A pixel of a keyframe is a mean over its square. Where the warp stretches it, the surface appears blurred, and
bilinear interpolation adds to it, by the position between the samples. Both images are filtered to one
footprint: that which a pixel of a keyframe has in the delivered frame where nothing is stretched. A stretched
pixel is filtered less, or not at all. A difference remains where it is wider than the footprint: it is the
blur that the delivered frame would have.
"""

from __future__ import annotations

import numpy as np

from enfilade.methods.paper.spatial_filter import SIGMAS, reconstruct
from enfilade.methods.paper.warp import PIXEL_VARIANCE
from enfilade.records import F32, Halves, Mask, Warped

# Variance along an axis of a pixel that is interpolated halfway between others: its square's, and the tent's.
# Added to the filter of §5, so that the positions between the samples make no difference.
INTERPOLATED = PIXEL_VARIANCE + 1.0 / 4.0


def shown_alike(before: Warped, after: Warped, is_compared: Mask, support_px: F32) -> tuple[Halves, Halves]:
    """Both warped keyframes through the filter of §5, each as far as its own footprint allows.

    Pixels that are not compared are left out of the filter, and have the same colour in both.

    Parameters
    ----------
    before, after
    is_compared : (H, W) bool
    support_px : (H, W) float32
        Full width of the spatial filter of the frame.
    """
    known = [(~one.is_disoccluded[..., None]).astype(np.float32) for one in (before, after)]
    count = np.maximum(known[0] + known[1], np.float32(1.0))
    filler: F32 = (before.color + after.color) / count  # disoccluded pixels are black
    return (
        _shown(before, is_compared, filler, support_px),
        _shown(after, is_compared, filler, support_px),
    )


def _shown(warped: Warped, is_compared: Mask, filler: F32, support_px: F32) -> Halves:
    where = is_compared[..., None]
    support = _remaining_support(warped.footprint, support_px)
    weight = reconstruct(np.broadcast_to(where, filler.shape).astype(np.float32), support)
    divisor = np.where(where, weight, np.float32(1))
    first, second = (
        np.where(where, reconstruct(np.where(where, half, np.float32(0)), support) / divisor, filler)
        for half in (warped.shading.first, warped.shading.second)
    )
    return Halves(first, second)


def _remaining_support(footprint: F32, support_px: F32) -> F32:
    """Full width of the filter that brings pixels to the common footprint; at least one pixel."""
    shown = np.square(support_px / np.float32(SIGMAS)) + np.float32(INTERPOLATED)
    sigma = np.sqrt(np.maximum(shown - footprint, np.float32(0.0)))
    support: F32 = np.maximum(np.float32(SIGMAS) * sigma, np.float32(1.0))
    return support
