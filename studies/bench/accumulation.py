"""Temporal accumulation for denoised baselines: history reprojected by exact motion, validated, and clipped.

As in real-time path tracing (Schied et al. 2017, "Spatiotemporal variance-guided filtering"), with variance
clipping (Salvi 2016) against lag of highlights and reflections.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from enfilade.gbuffer import View, positions
from enfilade.records import F32, Mask

MAX_FRAMES = 16  # in the average
PLANE_TOLERANCE = 0.01  # of the depth: distance from the plane of the surface
NORMAL_TOLERANCE = 0.9  # cosine between normals
CLIP_SIDE = 5  # pixels: neighbourhood of the variance clipping
CLIP_SIGMAS = 2.0


@dataclass(frozen=True, eq=False)
class History:
    """An accumulated image.

    Attributes
    ----------
    color : (H, W, 3) float32
    count : (H, W) float32
        Frames in the average of each pixel.
    """

    color: F32
    count: F32


def accumulate(color: F32, view: View, previous: History, previous_view: View) -> History:
    """Average an image with the history of the frame before.

    Parameters
    ----------
    color : (H, W, 3) float32
    view
        G-buffer and motion vectors of the frame.
    previous, previous_view
        History and G-buffer of the frame before, in the same shot.
    """
    height, width = color.shape[:2]
    flow = view.flow.backward
    x = (np.arange(width, dtype=np.float32) + flow[..., 0]).astype(np.float32)
    y = (np.arange(height, dtype=np.float32)[:, None] + flow[..., 1]).astype(np.float32)

    # Reject history of other surfaces.
    is_valid = _shows_same(x, y, view, previous_view)
    count = _fetched(previous.count, x, y, cv2.INTER_NEAREST)
    count = np.where(is_valid, np.minimum(count, MAX_FRAMES - 1), 0.0).astype(np.float32) + 1.0

    # Clip the history to the neighbourhood of the new image.
    mean = cv2.blur(color, (CLIP_SIDE, CLIP_SIDE))
    deviation = np.sqrt(np.maximum(cv2.blur(color * color, (CLIP_SIDE, CLIP_SIDE)) - mean * mean, 0.0))
    history = _fetched_sharply(previous.color, x, y)
    history = np.clip(history, mean - CLIP_SIGMAS * deviation, mean + CLIP_SIGMAS * deviation)

    # Blend.
    blended = history + (color - history) / count[..., None]
    return History(np.where(is_valid[..., None], blended, color).astype(np.float32), count)


def _shows_same(x: F32, y: F32, view: View, previous: View) -> Mask:
    """Pixels whose surface the frame before shows where the motion leads."""
    here, there = view.geometry, previous.geometry
    height, width = x.shape
    column, row = np.rint(x).astype(int), np.rint(y).astype(int)
    is_inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    at = np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)
    step = positions(there)[at] - positions(here)
    is_on_plane = np.abs((step * here.normal).sum(axis=-1)) <= PLANE_TOLERANCE * here.depth
    is_aligned = (there.normal[at] * here.normal).sum(axis=-1) >= NORMAL_TOLERANCE
    is_same = there.shape_index[at] == here.shape_index
    same: Mask = is_inside & is_same & ((is_on_plane & is_aligned) | ~here.is_hit)
    return same


def _fetched_sharply(image: F32, x: F32, y: F32) -> F32:
    """An image read bicubically, limited to the pixels around.

    Bilinear reads blur from frame to frame; bicubic ones overshoot beside lights.
    """
    around = np.ones((3, 3), np.uint8)
    least, most = (np.asarray(of(image, around), np.float32) for of in (cv2.erode, cv2.dilate))
    low, high = (_fetched(limit, x, y, cv2.INTER_NEAREST) for limit in (least, most))
    limited: F32 = np.clip(_fetched(image, x, y, cv2.INTER_CUBIC), low, high)
    return limited


def _fetched(image: F32, x: F32, y: F32, interpolation: int) -> F32:
    return np.asarray(cv2.remap(image, x, y, interpolation, borderMode=cv2.BORDER_REPLICATE), np.float32)
