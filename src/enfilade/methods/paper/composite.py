"""Compositing two warped keyframes with correct occlusion (Mark, McMillan and Bishop 1997; Fig. 3)."""

from __future__ import annotations

import numpy as np

from enfilade.records import F32, Geometry, Mask, Warped
from enfilade.settings import WarpSettings


def composite(
    before: Warped, after: Warped, geometry: Geometry, *, progress: float, settings: WarpSettings
) -> tuple[F32, Mask]:
    """Join what two keyframes know of a frame between them.

    Of two samples on different surfaces the one that the frame's own range and item buffers show
    is taken: it alone is unoccluded. Two samples of one surface are mixed: the nearer keyframe in
    time counts more, and so does the one in which the surface is less magnified.

    Parameters
    ----------
    before, after
        The warps of the earlier and the later keyframe.
    geometry
        Of the frame itself.
    progress
        Where between the keyframes the frame lies, 0..1.

    Returns
    -------
    color : (H, W, 3) float32
        0 in holes.
    is_hole : (H, W) bool
        Pixels whose surface neither keyframe sees.
    """
    weight_before = (1.0 - progress) * _confidence(before, geometry, settings.depth_tolerance)
    weight_after = progress * _confidence(after, geometry, settings.depth_tolerance)
    total = weight_before + weight_after
    is_hole = total <= 0.0
    share = np.where(is_hole, 0.0, weight_before / np.where(is_hole, 1.0, total))[..., None]
    rest = np.where(is_hole[..., None], 0.0, 1.0 - share)
    color = share * before.color + rest * after.color
    return color.astype(np.float32), is_hole


def agrees(warped: Warped, geometry: Geometry, tolerance: float) -> Mask:
    """Pixels at which a warped keyframe shows the surface that the frame itself sees, (H, W)."""
    difference = np.abs(warped.depth - geometry.depth)
    is_same = (warped.shape_index == geometry.shape_index) & (difference <= tolerance * geometry.depth)
    agreed: Mask = ~warped.is_hole & is_same
    return agreed


def _confidence(warped: Warped, geometry: Geometry, tolerance: float) -> F32:
    sharpness = 1.0 / np.maximum(warped.magnification, 1.0)
    return np.where(agrees(warped, geometry, tolerance), sharpness, 0.0).astype(np.float32)
