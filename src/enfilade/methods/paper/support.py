"""Spatial and temporal support of the filter, by the velocity (§5.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enfilade.records import F32, Geometry
from enfilade.settings import AntialiasSettings

PAPER_PIXELS_PER_DEGREE = 27.928  # 640x480 on a diagonal of 0.25 m, seen from 0.5 m (§5.2)
COVERED_PX = 0.5  # length of a trajectory whose samples cover the pixel (§5.2)


@dataclass(frozen=True, eq=False)
class TemporalLimits:
    """Temporal support of the pixels of a frame.

    Attributes
    ----------
    reach : (H, W) float32
        Most frames to either side.
    least : (H, W) float32
        Frames to either side before a slow trajectory may end; elsewhere the same as `reach`.
    """

    reach: F32
    least: F32


def spatial_support_px(speed_deg_s: F32, pixels_per_degree: float, settings: AntialiasSettings) -> F32:
    """Full width of the spatial filter, (H, W) pixels: linear up to 16 deg/s, then constant.

    The paper's rises from 3 to 9 pixels, and is 11 beyond. It has one sample a pixel; here paths are
    distributed over the pixel, and 3 pixels are the default at any velocity.

    The support at rest antialiases: it is three pixels on any display. The part that velocity adds is blur
    that the eye does not resolve, an angle: it is given in the paper's pixels, of which 28 make a degree.
    The support is at least one pixel.
    """
    rise = settings.support_fast_px - settings.support_still_px
    beyond = settings.support_beyond_px - settings.support_still_px
    added = np.where(speed_deg_s > settings.fast_deg_s, beyond, rise * speed_deg_s / settings.fast_deg_s)
    support = settings.support_still_px + added * (pixels_per_degree / PAPER_PIXELS_PER_DEGREE)
    return np.maximum(support, 1.0).astype(np.float32)


def temporal_limits(speed_deg_s: F32, geometry: Geometry, settings: AntialiasSettings) -> TemporalLimits:
    """Temporal support: 11 frames, up to 15 for slow pixels, few on specular surfaces.

    The samples of slow pixels (below 0.15 deg/s) are collected until they cover half a pixel, or up to the
    largest support. On glossy, mirroring and transparent surfaces the motion of the surface is not that of
    the reflection or transmission (§5.4).
    """
    normal, most = settings.frames // 2, max(settings.slow_frames, settings.frames) // 2
    is_slow = speed_deg_s < settings.slow_deg_s
    reach = np.where(is_slow, most, normal)
    reach = np.where(geometry.is_specular, np.minimum(settings.specular_frames // 2, reach), reach)
    least = np.minimum(reach, normal)
    return TemporalLimits(reach.astype(np.float32), least.astype(np.float32))
