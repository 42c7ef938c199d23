"""Edges in G-buffers: outlines of shapes, and emitters that are small in the image."""

from __future__ import annotations

import numpy as np
import scipy.ndimage

from enfilade.records import Geometry, Mask
from enfilade.renderer import Emitters

OCCLUDED = 1.01  # times the farthest depth around: emitters beyond it are not visible


def is_outline(geometry: Geometry) -> Mask:
    """Pixels beside which another shape is seen, (H, W)."""
    index = geometry.shape_index
    found = np.zeros(index.shape, np.bool_)
    across, down = index[:, 1:] != index[:, :-1], index[1:] != index[:-1]
    found[:, 1:] |= across
    found[:, :-1] |= across
    found[1:] |= down
    found[:-1] |= down
    return found


def dilated(mask: Mask, pixels: int = 1) -> Mask:
    """A mask grown by some pixels in all eight directions; SciPy takes 30 times as long."""
    for _ in range(pixels):
        padded = np.pad(mask, 1)
        rows = padded[:-2] | padded[1:-1] | padded[2:]
        mask = rows[:, :-2] | rows[:, 1:-1] | rows[:, 2:]
    return mask


def beside(mask: Mask) -> Mask:
    """Pixels with at least one of their eight neighbours in a mask; they themselves do not count."""
    padded = np.pad(mask, 1)
    ends = padded[:-2] | padded[2:]
    rows = ends | padded[1:-1]
    found: Mask = rows[:, :-2] | ends[:, 1:-1] | rows[:, 2:]
    return found


def small_emitter_pixels(emitters: Emitters, geometry: Geometry) -> Mask:
    """Pixels of emitters that are small in the image, and of the outlines of larger ones, (H, W).

    The first camera rays miss most of their pixels. If only those that were hit had more rays, these would
    fall to their true values, the others would stay dark, and the emitter would lose most of its light.

    Parameters
    ----------
    emitters
        Points on all emitters.
    geometry
        G-buffer of the frame.
    """
    # Project the points.
    camera = geometry.camera
    height, width = geometry.shape_index.shape
    x, y, depth = camera.pixel_from_direction @ (emitters.position - camera.eye).T
    is_inside = (depth > 0.0) & (x >= 0.0) & (y >= 0.0) & (x < width * depth) & (y < height * depth)
    row, column = (
        np.minimum(np.floor(v[is_inside] / depth[is_inside]), last).astype(int)
        for v, last in ((y, height - 1), (x, width - 1))
    )
    depth, shape_index = depth[is_inside], emitters.shape_index[is_inside]

    # Leave out occluded points, and the interior of large emitters.
    farthest = np.where(geometry.is_hit, geometry.depth, np.inf)
    farthest = scipy.ndimage.maximum_filter(farthest, 3, mode="nearest")
    lowest, highest = (
        extreme(geometry.shape_index, 3, mode="nearest")
        for extreme in (scipy.ndimage.minimum_filter, scipy.ndimage.maximum_filter)
    )
    is_interior = (lowest[row, column] == shape_index) & (highest[row, column] == shape_index)
    is_visible = (depth < OCCLUDED * farthest[row, column]) & ~is_interior
    mask = np.zeros((height, width), bool)
    mask[row[is_visible], column[is_visible]] = True
    return mask
