"""The tint of specular lobes: textures that colour metal are divided out while its light is filtered.

A denoiser would blur the texture together with the light that the metal reflects.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from enfilade.arrays import to_float, to_half
from enfilade.kernels.estimate import Samples
from enfilade.kernels.tone import luminance
from enfilade.methods.decoupled.records import SpecularAov
from enfilade.methods.decoupled.shot import ShotContext
from enfilade.records import F32, Mask, Shading
from enfilade.renderer import PixelFilter, Purpose, Rays

TINT_RAYS = 16  # camera rays of a pixel that shows metal with a texture
MIN_TINT = np.float32(1e-3)  # mean of a pixel


@dataclass(frozen=True, eq=False)
class Tint:
    """Mean tints of the specular lobes over the pixels.

    Attributes
    ----------
    sampled : (H, W, 3) float32
        By the camera rays that specular rays continue.
    whole : (H, W, 3) float32
        By more of them.
    """

    sampled: F32
    whole: F32

    def divided(self, aov: Shading) -> Shading:
        """An AOV without the tint of its own rays."""
        squared: F32 = np.square(luminance(self.sampled))
        return replace(aov, color=aov.color / self.sampled, variance=aov.variance / squared)

    def multiplied(self, aov: SpecularAov) -> SpecularAov:
        """A filtered AOV with the tint."""
        color, deviation = to_float(aov.color) * self.whole, to_float(aov.deviation) * luminance(self.whole)
        return SpecularAov(to_half(color), to_half(deviation))


def find_tint(
    shot: ShotContext, frame: int, where: Mask, centred: Mask, narrow: Mask, spp: int
) -> Tint | None:
    """The tint of the pixels of a frame; None where no metal with a texture is seen.

    Parameters
    ----------
    shot
    frame
    where : (H, W) bool
        Pixels with specular rays.
    centred : (H, W) bool
        Those whose rays all pass through their centre.
    narrow : (H, W) bool
        Those that may have more rays than the first ones.
    spp
        Number of the first rays of a pixel.
    """
    if not shot.renderer.has_specular_texture():
        return None
    see = shot.integrator.kernels.see_tint

    def radiance(rays: Rays, sampler: Any) -> Samples:
        tint, is_textured = see(shot.spawn(frame, rays, sampler))
        return Samples((tint,), is_textured)

    def mean() -> F32:
        tint = np.maximum(estimate.shading.to_image(where).color, MIN_TINT)
        return np.where(where[..., None], tint, np.float32(1))

    estimate = shot.estimate(
        shot.walk.view(frame).geometry.camera,
        where,
        radiance,
        shot.walk.random(frame, Purpose.SPECULAR),
        pixel_filter=PixelFilter.GAUSSIAN,
        layers=1,
        centred=centred,
    )
    estimate.add(spp)
    is_textured = estimate.is_marked
    if not is_textured.any():
        return None
    sampled = mean()
    estimate.add(max(TINT_RAYS - spp, 0), is_textured)
    whole = mean()
    return Tint(np.where(narrow[..., None], whole, sampled), whole)
