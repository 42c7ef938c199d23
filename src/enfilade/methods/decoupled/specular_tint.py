"""The tint of specular lobes: textures that colour metal are divided out while its light is filtered.

A denoiser would blur the texture together with the light that the metal reflects.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, to_float, to_half
from enfilade.kernels.estimate import Confined, Samples
from enfilade.kernels.tone import luminance
from enfilade.methods.decoupled.records import SpecularAov
from enfilade.methods.decoupled.shot import ShotContext
from enfilade.records import F32, Mask, Shading
from enfilade.renderer import PixelFilter, Purpose, Rays

TINT_RAYS = 16  # camera rays of a pixel that shows metal with a texture


@dataclass(frozen=True, eq=False)
class Tint:
    """Mean tints of the specular lobes in the pixels.

    Attributes
    ----------
    sampled : (H, W, 3) float32
        By the camera rays that specular rays continue; of pixels with another number of them, as `whole`.
    whole : (H, W, 3) float32
        By :data:`TINT_RAYS`, which are not counted.
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
    shot: ShotContext, frame: int, where: Mask, confined: Confined, others: Mask, spp: int
) -> Tint | None:
    """The tint of the pixels of a frame; None where no metal with a texture is seen.

    Parameters
    ----------
    shot
    frame
    where : (H, W) bool
        Pixels with specular rays.
    confined
        As of the specular rays.
    others : (H, W) bool
        Those that may have more or fewer rays than `spp`.
    spp
        Number of rays of all other pixels.
    """
    if not shot.renderer.has_specular_texture():
        return None
    see = shot.integrator.kernels.see_tint

    def radiance(rays: Rays, sampler: Any) -> Samples:
        tint, is_textured = see(shot.spawn(frame, rays, sampler))
        is_specular = dr.select(dr.max(tint) > 0.0, Array3f(1), 0.0)
        return Samples((tint, is_specular), is_textured)

    def mean() -> F32:
        """Of rays that meet specular lobes; the mean of all pixels where none does."""
        tint, coverage = (of.to_image(where).color for of in estimate.shadings)
        is_known = coverage > 0.0
        average = tint.sum(axis=(0, 1)) / coverage.sum(axis=(0, 1))
        return np.where(is_known, tint / np.where(is_known, coverage, np.float32(1)), average)

    estimate = shot.estimate(
        shot.walk.view(frame).geometry.camera,
        where,
        radiance,
        shot.walk.random(frame, Purpose.SPECULAR),
        pixel_filter=PixelFilter.GAUSSIAN,
        confined=confined,
    )
    estimate.add(spp)
    is_textured = estimate.is_marked
    if not is_textured.any():
        return None
    sampled = mean()
    estimate.add(max(TINT_RAYS - spp, 0), is_textured)
    whole = mean()
    return Tint(np.where(others[..., None], whole, sampled), whole)
