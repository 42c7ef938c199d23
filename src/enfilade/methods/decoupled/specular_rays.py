"""Specular AOVs of a frame: traced for the surface at a pixel's centre, filtered, and antialiased at edges.

A denoiser would blur edges between surfaces, where a pixel's rays meet both. So the rays of a pixel beside
an edge meet the surface at its centre alone; then the filtered values are looked up over the whole pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from enfilade.arrays import to_float
from enfilade.kernels.estimate import Estimate, Samples
from enfilade.kernels.reconstruction import ReconstructedEstimate
from enfilade.methods.decoupled.adaptive_sampling import (
    SPECULAR_CONTRAST,
    SPECULAR_DEVIATION,
    AdaptiveSampling,
)
from enfilade.methods.decoupled.edges import dilated, is_outline
from enfilade.methods.decoupled.integrator import SPECULAR_AOVS
from enfilade.methods.decoupled.irradiance_cache import IrradianceCache
from enfilade.methods.decoupled.light_camera import light_camera
from enfilade.methods.decoupled.records import SpecularAov
from enfilade.methods.decoupled.sample_counts import specular_spp
from enfilade.methods.decoupled.shot import ShotContext
from enfilade.methods.decoupled.specular_filter import filter_spatially, upload_aovs, with_edges
from enfilade.methods.decoupled.surface_edges import narrow_surfaces, surface_edges
from enfilade.methods.decoupled.surface_image import UploadedImage
from enfilade.methods.decoupled.virtual_images import IN_VIRTUAL_IMAGE
from enfilade.records import F32, SPECULAR, Geometry, Mask
from enfilade.renderer import PixelFilter, Purpose, Rays
from enfilade.settings import LimitSettings


def shade_specular(
    shot: ShotContext,
    frame: int,
    cache: IrradianceCache,
    seen: Mask,
    virtual: Sequence[Geometry],
    beneath: F32,
) -> SpecularShading:
    """Specular AOVs of a frame before temporal accumulation.

    Parameters
    ----------
    shot
    frame
    cache
        Of the frame.
    seen : (H, W) bool
        Pixels whose camera rays meet specular lobes.
    virtual
        G-buffers of the frame with the virtual images of its AOVs; empty where no pixel has specular lobes.
    beneath : (H, W) float32
        Luminance of what camera rays see, which is displayed together with the AOVs.
    """
    # The denoiser would blur surfaces thinner than a pixel, which the centres of no pixels around meet.
    # Cut-outs and veils are no such surfaces: their G-buffer may be of another class, or of what is behind.
    near, is_specular = dilated(seen), np.isin(shot.walk.view(frame).geometry.surface, SPECULAR)
    is_wide = dilated(is_specular | ~dilated(~seen))
    where, is_missed = near & is_wide, near & ~is_wide
    nowhere, no_variance = np.zeros_like(where), np.zeros(where.shape, np.float32)
    black = SpecularAov(np.zeros((*where.shape, 3), np.float16), np.zeros(where.shape, np.float16))
    if not near.any():
        return SpecularShading([black], nowhere, no_variance, 0, 0)
    frame_rays = _FrameRays(shot, frame, cache)
    is_seen_in = where & np.any([g.shape_index >= IN_VIRTUAL_IMAGE for g in virtual], axis=0)
    in_mirrors = is_seen_in & dilated(np.any([is_outline(g) for g in virtual], axis=0))

    # Trace over the whole pixel; beside another surface through its centre, unless it shows a virtual image.
    is_edge, is_thin = surface_edges(frame_rays.geometry)
    # Narrow surfaces have more rays, but for those whose rays are traced at edges again.
    is_traced_later = in_mirrors | is_thin
    is_narrow = narrow_surfaces(is_edge, where) & ~is_traced_later
    is_centre = where & (is_edge | is_thin) & ~is_seen_in
    sampling = AdaptiveSampling.of(shot.walk, times=SPECULAR_DEVIATION, beneath=beneath)
    estimate = frame_rays.estimate(where, is_centre)
    spp = specular_spp(shot.settings)
    estimate.add(spp)
    sampling.reduce_noise(estimate, where, is_narrow, spp)
    traced = [of.to_image(where) for of in estimate.shadings]
    paths, dropped = estimate.paths, estimate.dropped
    del estimate  # its sums take 80 bytes a pixel

    # Filter the AOVs along the surfaces that are seen in them.
    count = 1 + max((k for k, aov in enumerate(traced) if aov.color.any()), default=0)
    is_denoised = shot.settings.denoiser != "none"
    aovs = filter_spatially(virtual[:count], traced[:count], where, is_denoised=is_denoised)

    # Choose the edges: those in mirrors and panes, surfaces that centres miss, and those between surfaces
    # where the AOVs differ visibly. Aliasing is more visible than noise: its tolerance is a third of that of
    # noise.
    matters = AdaptiveSampling.of(shot.walk, times=SPECULAR_CONTRAST, beneath=beneath).matters
    shown = np.sum([to_float(aov.color) for aov in aovs], axis=0)
    edges = in_mirrors | is_missed | (where & (is_edge | is_thin) & matters(shown))
    if not edges.any():
        return SpecularShading(aovs, nowhere, no_variance, paths, dropped)

    # Look up the AOVs over the whole pixel, and trace what the centres of the pixels around do not show well.
    uploaded = upload_aovs(frame_rays.geometry, aovs, SPECULAR_AOVS, where & ~is_traced_later)
    within = edges | is_seen_in
    fine = frame_rays.looked_up(within, uploaded, aovs)
    refined = sampling.refine(fine, within, edges, within, 0)
    layers = [of.to_image(within) for of in fine.shadings]
    if any(layer.color.any() for layer in layers[len(aovs) :]):  # transmission that is seen at edges alone
        aovs = [*aovs, *[black] * (SPECULAR_AOVS - len(aovs))]
    aovs = [with_edges(aov, layer, refined) for aov, layer in zip(aovs, layers, strict=False)]
    variance = np.where(refined, sum(layer.variance for layer in layers), no_variance)
    return SpecularShading(aovs, refined, variance, paths + fine.paths, dropped + fine.dropped)


@dataclass(frozen=True, eq=False)
class SpecularShading:
    """Specular AOVs of a frame.

    Attributes
    ----------
    aovs : list of SpecularAov
        Reflection, and transmission if there is any.
    is_refined : (H, W) bool
        Pixels at edges, which have rays of their own.
    variance : (H, W) float32
        Of the luminance of the AOVs' sum in these pixels; 0 elsewhere.
    paths, dropped : int
        Number of rays, and of those that were not finite.
    """

    aovs: list[SpecularAov]
    is_refined: Mask
    variance: F32
    paths: int
    dropped: int


@dataclass(frozen=True)
class _FrameRays:
    """Specular rays of a frame.

    Attributes
    ----------
    shot, frame, cache
        As of :func:`shade_specular`.
    """

    shot: ShotContext
    frame: int
    cache: IrradianceCache

    @property
    def geometry(self) -> Geometry:
        """G-buffer of the frame."""
        return self.shot.walk.view(self.frame).geometry

    def estimate(self, pixels: Mask, centred: Mask) -> Estimate:
        """An estimate of pixels, without rays yet.

        Parameters
        ----------
        pixels, centred : (H, W) bool
            Pixels, and those whose rays all pass through their centre.
        """

        def radiance(rays: Rays, sampler: Any) -> Samples:
            return self.shot.integrator.specular_radiance(
                self.cache, rays, sampler, pixel_angle=self._pixel_angle
            )

        return Estimate(
            self.geometry.camera,
            np.flatnonzero(pixels).astype(np.uint32),
            radiance,
            paths_in_flight=self._paths_in_flight,
            pixel_filter=PixelFilter.GAUSSIAN,
            random=self.shot.walk.random(self.frame, Purpose.SPECULAR),
            layers=SPECULAR_AOVS,
            centred=centred[pixels],
        )

    def looked_up(
        self, pixels: Mask, uploaded: UploadedImage, aovs: Sequence[SpecularAov]
    ) -> ReconstructedEstimate:
        """An estimate of pixels, (H, W), by lookups of uploaded AOVs, without rays yet."""

        def radiance(rays: Rays, sampler: Any) -> Samples:
            return self.shot.integrator.specular_radiance_at_edges(
                uploaded, self.cache, rays, sampler, pixel_angle=self._pixel_angle
            )

        colors = [to_float(aov.color) for aov in aovs]
        black = [np.zeros_like(colors[0])] * (SPECULAR_AOVS - len(colors))
        return ReconstructedEstimate(
            self.geometry.camera,
            np.flatnonzero(pixels).astype(np.uint32),
            radiance,
            paths_in_flight=self._paths_in_flight,
            random=self.shot.walk.random(self.frame, Purpose.SPECULAR_EDGES),
            layers=SPECULAR_AOVS,
            background=[*colors, *black],
        )

    @property
    def _pixel_angle(self) -> float:
        return light_camera(self.geometry.camera).pixel_angle

    @property
    def _paths_in_flight(self) -> int:
        return self.shot.walk.settings[LimitSettings].paths_in_flight
