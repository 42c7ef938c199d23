"""Compositing of two warped keyframes with correct occlusion (Mark et al. 1997; §2.2, Fig. 3)."""

from __future__ import annotations

import numpy as np

from enfilade.methods.paper.disparity import outline_pixels
from enfilade.records import F32, Geometry, Mask, Warped
from enfilade.settings import WarpSettings


def composite(
    before: Warped, after: Warped, geometry: Geometry, *, progress: float, settings: WarpSettings
) -> tuple[F32, Mask]:
    """Composite two warped keyframes at a frame between them.

    Only samples of the surface that the frame's own G-buffer shows are used: all others are occluded, or
    occlude it. Samples from an outline of the keyframe, which have a share of another surface, are used at
    outlines alone. Two such samples are blended by the distance of the keyframes in time and by the
    magnification of the surface.

    Parameters
    ----------
    before, after
        The warps of the earlier and the later keyframe.
    geometry
        G-buffer of the frame.
    progress
        Position of the frame between the keyframes, 0..1.
    settings

    Returns
    -------
    color : (H, W, 3) float32
        0 where it is disoccluded.
    is_disoccluded : (H, W) bool
        Pixels whose surface neither keyframe shows; the paper calls them holes.
    """
    # Weight each keyframe where it shows the surface.
    is_outline = outline_pixels(geometry, settings.depth_tolerance)
    weight_before = (1.0 - progress) * _confidence(before, geometry, is_outline, settings.depth_tolerance)
    weight_after = progress * _confidence(after, geometry, is_outline, settings.depth_tolerance)
    total = weight_before + weight_after
    is_disoccluded = total <= 0.0

    # Blend.
    total = np.where(is_disoccluded, 1.0, total)
    first, last = ((weight / total)[..., None] for weight in (weight_before, weight_after))
    color = first * before.color + last * after.color
    return color.astype(np.float32), is_disoccluded


def agrees(warped: Warped, geometry: Geometry, is_outline: Mask, tolerance: float) -> Mask:
    """Pixels at which a warped keyframe shows the same surface as the frame, and no other, (H, W).

    Parameters
    ----------
    warped
    geometry
        G-buffer of the frame.
    is_outline : (H, W) bool
        Pixels of the frame beside another surface, where it shows both, too.
    tolerance
        Largest relative difference of depth.
    """
    difference = np.abs(warped.depth - geometry.depth)
    is_same = (warped.shape_index == geometry.shape_index) & (difference <= tolerance * geometry.depth)
    agreed: Mask = ~warped.is_disoccluded & is_same & (is_outline | ~warped.is_mixed)
    return agreed


def _confidence(warped: Warped, geometry: Geometry, is_outline: Mask, tolerance: float) -> F32:
    """Inverse magnification where the keyframe shows the surface, 0 elsewhere."""
    sharpness = 1.0 / np.maximum(warped.magnification, 1.0)
    agreed = agrees(warped, geometry, is_outline, tolerance)
    return np.where(agreed, sharpness, 0.0).astype(np.float32)
