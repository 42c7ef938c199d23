"""Specular AOVs of a frame: traced for the surface at a pixel's centre, filtered, and antialiased at edges.

A denoiser would blur edges between surfaces, where a pixel's rays meet both. So the rays of a pixel beside
an edge meet the surface at its centre alone; then the filtered values are looked up over the whole pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from enfilade.arrays import release_memory, to_float
from enfilade.kernels.estimate import Confined, RayCount
from enfilade.methods.decoupled.adaptive_sampling import (
    FAINT,
    SPECULAR_CONTRAST,
    SPECULAR_DEVIATION,
    AdaptiveSampling,
    variance_around,
)
from enfilade.methods.decoupled.edges import dilated, is_outline
from enfilade.methods.decoupled.integrator import SPECULAR_AOVS
from enfilade.methods.decoupled.irradiance_cache import IrradianceCache
from enfilade.methods.decoupled.reconstruction import ReconstructedEstimate
from enfilade.methods.decoupled.records import SpecularAov
from enfilade.methods.decoupled.sample_counts import specular_spp
from enfilade.methods.decoupled.shot import ShotContext
from enfilade.methods.decoupled.specular_filter import filter_spatially, upload_aovs, with_edges
from enfilade.methods.decoupled.specular_tint import find_tint
from enfilade.methods.decoupled.surface_edges import narrow_surfaces, own_sides, surface_edges
from enfilade.methods.decoupled.virtual_images import IN_VIRTUAL_IMAGE
from enfilade.records import F32, Geometry, Mask, Shading
from enfilade.renderer import PixelFilter, Purpose

FAINT_SHARE = 4  # one in so many of the rays are traced first, and suffice for faint pixels


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
    # Surfaces thinner than a pixel, which no centre of a pixel around hits, are not denoised. Cut-outs and
    # thin cloth are no such surfaces: their G-buffer may be of another class, or of what is behind.
    geometry, near = shot.walk.view(frame).geometry, dilated(seen)
    is_wide = dilated(geometry.is_specular | ~dilated(~seen))
    where, is_missed = near & is_wide, near & ~is_wide
    nowhere, no_variance = np.zeros_like(where), np.zeros(where.shape, np.float32)
    black = SpecularAov(np.zeros((*where.shape, 3), np.float16), np.zeros(where.shape, np.float16))
    if not near.any():
        return SpecularShading([black], nowhere, no_variance, RayCount())
    is_seen_in = where & np.any([g.shape_index >= IN_VIRTUAL_IMAGE for g in virtual], axis=0)
    in_mirrors = is_seen_in & dilated(np.any([is_outline(g) for g in virtual], axis=0))

    # Trace over the whole pixel; beside another surface where the pixel shows its own, unless it shows a
    # virtual image.
    is_edge, is_thin = surface_edges(geometry)
    # Narrow surfaces have more rays, but for those whose rays are traced at edges again.
    is_traced_later = in_mirrors | is_thin
    is_narrow = narrow_surfaces(is_edge, where) & ~is_traced_later
    confined = Confined(where & (is_edge | is_thin) & ~is_seen_in, *own_sides(geometry))
    sampling = AdaptiveSampling.of(shot.walk, times=SPECULAR_DEVIATION, beneath=beneath)
    estimate = shot.estimate(
        geometry.camera,
        where,
        lambda rays, sampler: shot.integrator.specular_radiance(cache, shot.spawn(frame, rays, sampler)),
        shot.walk.random(frame, Purpose.SPECULAR),
        pixel_filter=PixelFilter.GAUSSIAN,
        layers=SPECULAR_AOVS,
        confined=confined,
    )
    spp = specular_spp(shot.settings, shot.frames)
    few = -(-spp // FAINT_SHARE)  # rounded up
    estimate.add(few)
    is_faint = AdaptiveSampling.of(shot.walk, times=FAINT, beneath=beneath).is_faint(estimate, where, few)
    estimate.add(spp - few, ~is_faint[where])
    sampling.reduce_noise(estimate, where, is_narrow & ~is_faint, spp)
    traced = [of.to_image(where) for of in estimate.shadings]
    count = estimate.count
    del estimate  # its sums take 80 bytes a pixel
    release_memory()

    # Filter the AOVs along the surfaces that are seen in them, without the texture of metal.
    tint = find_tint(shot, frame, where, confined, is_narrow | is_faint, spp)
    if tint:
        traced[0] = tint.divided(traced[0])
        release_memory()
    counts = np.where(is_faint, few, spp)
    traced = [_with_variance(aov, where, is_faint, counts) for aov in traced]
    used = 1 + max((k for k, aov in enumerate(traced) if aov.color.any()), default=0)
    is_denoised = shot.settings.denoiser != "none"
    aovs = filter_spatially(
        virtual[:used], traced[:used], where, is_denoised=is_denoised, unit=shot.stored_unit
    )
    if tint:
        aovs[0] = tint.multiplied(aovs[0])
    del traced, confined

    # Choose the edges: those in mirrors and panes, surfaces that centres miss, and those between surfaces
    # where the AOVs differ visibly. Aliasing is more visible than noise: its tolerance is a sixth of that of
    # noise.
    has_visible_contrast = AdaptiveSampling.of(
        shot.walk, times=SPECULAR_CONTRAST, beneath=beneath
    ).has_visible_contrast
    shown = np.float32(shot.stored_unit) * np.sum([to_float(aov.color) for aov in aovs], axis=0)
    edges = in_mirrors | is_missed | (where & (is_edge | is_thin) & has_visible_contrast(shown))
    if not edges.any():
        return SpecularShading(aovs, nowhere, no_variance, count)

    # Look up the AOVs over the whole pixel, and trace what the centres of the pixels around do not show well.
    within = (edges | is_seen_in) & dilated(edges, sampling.reach)  # sums take 340 bytes a pixel
    fine = _looked_up(shot, frame, cache, aovs, where & ~is_traced_later, within)
    refined = sampling.refine(fine, within, edges, within, 0)
    layers = [of.to_image(within) for of in fine.shadings]
    if any(layer.color.any() for layer in layers[len(aovs) :]):  # transmission that is seen at edges alone
        aovs = [*aovs, *[black] * (SPECULAR_AOVS - len(aovs))]
    aovs = [
        with_edges(aov, layer, refined, unit=shot.stored_unit)
        for aov, layer in zip(aovs, layers, strict=False)
    ]
    variance = np.where(refined, sum(layer.variance for layer in layers), no_variance)
    return SpecularShading(aovs, refined, variance, count + fine.count)


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
    count : RayCount
    """

    aovs: list[SpecularAov]
    is_refined: Mask
    variance: F32
    count: RayCount


def _with_variance(
    aov: Shading, sampled: Mask, is_faint: Mask, counts: npt.NDArray[np.integer[Any]]
) -> Shading:
    """An AOV whose faint pixels, of a single ray perhaps, have the variance of the rays around."""
    variance = variance_around(aov, sampled, counts) / counts.astype(np.float32)
    return replace(aov, variance=np.where(is_faint, variance, aov.variance))


def _looked_up(
    shot: ShotContext,
    frame: int,
    cache: IrradianceCache,
    aovs: Sequence[SpecularAov],
    known: Mask,
    within: Mask,
) -> ReconstructedEstimate:
    """An estimate by lookups of filtered AOVs, without rays yet.

    Parameters
    ----------
    shot, frame, cache
        As of :func:`shade_specular`.
    aovs
    known, within : (H, W) bool
        Pixels whose AOVs are looked up, and those that are estimated.
    """
    geometry = shot.walk.view(frame).geometry
    uploaded = upload_aovs(geometry, aovs, SPECULAR_AOVS, known)
    colors = [np.float32(shot.stored_unit) * to_float(aov.color) for aov in aovs]
    black = [np.zeros_like(colors[0])] * (SPECULAR_AOVS - len(colors))
    return shot.reconstructed_estimate(
        geometry.camera,
        within,
        lambda rays, sampler: shot.integrator.specular_radiance_at_edges(
            uploaded, cache, shot.spawn(frame, rays, sampler), unit=shot.stored_unit
        ),
        shot.walk.random(frame, Purpose.SPECULAR_EDGES),
        layers=SPECULAR_AOVS,
        background=[*colors, *black],
    )
