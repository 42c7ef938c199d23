"""What is compared: two warped keyframes as the filter of §5 will show them (§4.3, step 3).

A pixel of a keyframe is the mean over its square. Where the warp stretches it, the surface appears blurred.
The filter of §5 blurs, too. Both images are filtered to the footprint that this filter gives to pixels that
no warp has stretched; a stretched pixel is filtered less, or not at all. A difference remains where the
stretched pixel is wider than the footprint: it is the blur that the delivered frame would have.
"""

from __future__ import annotations

import numpy as np

from enfilade.methods.paper.convolve import SIGMAS
from enfilade.methods.paper.spatial_filter import reconstruct
from enfilade.methods.paper.warp import disparity_gradient
from enfilade.records import F32, Geometry, Halves, Mask, Warped

# Variances along an axis, square pixels.
PIXEL = 1.0 / 12.0  # of the square over which the paths are distributed
BILINEAR = 1.0 / 6.0  # of bilinear interpolation, the mean over all positions between four samples

NEIGHBOURS = tuple((row, column) for row in (-1, 0, 1) for column in (-1, 0, 1) if row or column)


def outline_pixels(geometry: Geometry, depth_tolerance: float) -> Mask:
    """Pixels with another surface in their neighbourhood of 3x3 pixels, (H, W).

    They show two surfaces, of which a warp moves one. They differ by their sampling, at any distance of the
    keyframes.

    Parameters
    ----------
    geometry
    depth_tolerance
        Largest deviation of a neighbour on the same surface from the pixel's own plane, relative.
    """
    shape_index, disparity = geometry.shape_index, geometry.disparity
    gradient = disparity_gradient(geometry)
    height, width = disparity.shape
    shapes = np.pad(shape_index, 1, mode="edge")
    disparities = np.pad(disparity, 1, mode="reflect", reflect_type="odd")
    is_outline = np.zeros(disparity.shape, np.bool_)
    for down, across in NEIGHBOURS:
        beside = np.s_[1 + down : 1 + down + height, 1 + across : 1 + across + width]
        expected = disparity + across * gradient[..., 0] + down * gradient[..., 1]
        is_outline |= shapes[beside] != shape_index
        is_outline |= np.abs(disparities[beside] - expected) > depth_tolerance * disparity
    return is_outline


def shown_alike(before: Warped, after: Warped, is_compared: Mask, support_px: F32) -> tuple[Halves, Halves]:
    """Both warped keyframes through the filter of §5, each as far as its own footprint allows.

    Pixels that are not compared have the same colour in both, so that the filter brings no difference into
    their neighbours.

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
    support = _remaining_support(warped.magnification, support_px)
    first, second = (
        reconstruct(np.where(is_compared[..., None], half, filler), support)
        for half in (warped.shading.first, warped.shading.second)
    )
    return Halves(first, second)


def _remaining_support(magnification: F32, support_px: F32) -> F32:
    """Full width of the filter that brings stretched pixels to the common footprint; at least one pixel.

    The temporal filter interpolates the frame once more.
    """
    wanted = np.square(support_px / np.float32(SIGMAS)) + np.float32(BILINEAR)
    stretched = np.float32(PIXEL + BILINEAR) * (magnification - np.float32(1.0))
    sigma = np.sqrt(np.maximum(wanted - stretched, np.float32(0.0)))
    support: F32 = np.maximum(np.float32(SIGMAS) * sigma, np.float32(1.0))
    return support
