"""Surfaces in a G-buffer: the slope of their disparity, and pixels at their outlines."""

from __future__ import annotations

import numpy as np

from enfilade.records import F32, U32, Geometry, Mask

CONTINUOUS = 0.1  # largest relative change of disparity between neighbours on one surface
EVEN = 0.1  # largest relative difference of two such changes in a row on one slope
NEIGHBOURS = tuple((row, column) for row in (-1, 0, 1) for column in (-1, 0, 1) if row or column)


def disparity_gradient(geometry: Geometry) -> F32:
    """Change of the disparity from pixel to pixel on each pixel's own surface, (H, W, 2).

    On a plane the disparity is linear in image coordinates, so that the difference to one neighbour is exact.
    Of the two neighbours along an axis the one with the smaller change is used; changes across a jump or to
    another shape are not.
    """
    disparity, shape_index = geometry.disparity, geometry.shape_index
    gradient = np.zeros((*disparity.shape, 2), np.float32)
    gradient[..., 0] = _smaller_step(disparity, shape_index)
    gradient[..., 1] = _smaller_step(disparity.T, shape_index.T).T
    return gradient


def _smaller_step(disparity: F32, shape_index: U32) -> F32:
    """Change of the disparity to the left or right neighbour, 0 where neither lies on the same surface."""
    step = np.diff(disparity, axis=1)
    is_same = np.diff(shape_index.astype(np.int64), axis=1) == 0

    # Keep small steps, and steps of an even slope: towards the horizon of a plane every step is large.
    is_small = np.abs(step) <= CONTINUOUS * np.minimum(disparity[:, 1:], disparity[:, :-1])
    size = np.abs(step)
    is_even = is_same[:, 1:] & is_same[:, :-1]
    is_even &= np.abs(np.diff(step, axis=1)) <= EVEN * np.minimum(size[:, 1:], size[:, :-1])
    is_sloped = np.pad(is_even, ((0, 0), (1, 0))) | np.pad(is_even, ((0, 0), (0, 1)))
    step = np.where(is_same & (is_small | is_sloped[:, : step.shape[1]]), step, np.inf)

    # Choose the smaller one of the two.
    behind = np.pad(step, ((0, 0), (1, 0)), constant_values=np.inf)
    ahead = np.pad(step, ((0, 0), (0, 1)), constant_values=np.inf)
    smaller = np.where(np.abs(behind) < np.abs(ahead), behind, ahead)
    return np.where(np.isfinite(smaller), smaller, 0.0).astype(np.float32)


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
