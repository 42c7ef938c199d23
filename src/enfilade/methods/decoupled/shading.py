"""Shading of frames: camera rays, and specular rays where they meet specular lobes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enfilade.arrays import release_memory, to_half
from enfilade.kernels.tone import luminance
from enfilade.methods.base import Output
from enfilade.methods.decoupled.adaptive_sampling import AdaptiveSampling
from enfilade.methods.decoupled.edges import dilated, is_outline, small_emitter_pixels
from enfilade.methods.decoupled.irradiance_cache import IrradianceCache
from enfilade.methods.decoupled.reconstruction import ReconstructedEstimate
from enfilade.methods.decoupled.records import ShadedFrame
from enfilade.methods.decoupled.sharp_shadows import smooth_shadows
from enfilade.methods.decoupled.shot import ShotContext
from enfilade.methods.decoupled.specular_rays import shade_specular
from enfilade.records import U8, Geometry, Mask, Provenance
from enfilade.renderer import Purpose


def shade(shot: ShotContext, frame: int) -> Output:
    """Shade a frame, without the temporal accumulation."""
    geometry = shot.walk.view(frame).geometry

    # Trace camera rays, then specular rays where they meet specular lobes.
    cache = shot.shading_cache(frame)
    diffuse, refined = _shade_diffuse(shot, frame, cache)
    diffuse_image, *sharp = (of.to_image(np.ones_like(refined)) for of in diffuse.shadings)
    quality = shot.settings.denoiser
    if sharp and quality != "none":
        light = (of.to_image(np.ones_like(refined)).color for of in diffuse.unfiltered[1:])
        change = smooth_shadows(geometry, sharp[0], *light, quality=quality)
        diffuse_image = replace(diffuse_image, color=diffuse_image.color + change)
    seen, count = diffuse.is_marked.reshape(refined.shape), diffuse.count
    del diffuse  # its sums take 200 to 400 bytes a pixel
    release_memory()
    virtual = shot.virtual_images.find(geometry) if seen.any() else []
    specular = shade_specular(shot, frame, cache, seen, virtual, luminance(diffuse_image.color))

    # Store the AOVs with the deviation of refined pixels, and count the rays.
    variance = diffuse_image.variance + specular.variance
    variance = np.where(refined | specular.is_refined, variance, np.float32(0))
    provenance = _provenance(geometry, cache, seen, is_keyframe=frame in shot.keyframes)
    reflection, *others = specular.aovs
    transmission = others[0] if others else None
    scale = np.float32(1.0 / shot.stored_unit)
    shaded = ShadedFrame(
        to_half(scale * diffuse_image.color),
        reflection,
        transmission,
        to_half(scale * np.sqrt(variance)),
        provenance,
    )
    rays = {"camera": count.rays, "specular": specular.count.rays}
    return Output({frame: shaded}, {"rays": rays, "dropped": (count + specular.count).dropped})


def _shade_diffuse(
    shot: ShotContext, frame: int, cache: IrradianceCache
) -> tuple[ReconstructedEstimate, Mask]:
    """Emission, diffuse reflection and highlights of sharp emitters; where it has more rays, (H, W).

    Auxiliary layers, if the scene has sharp emitters, are their irradiance, and that without occluders.
    """
    walk, settings = shot.walk, shot.settings
    geometry, sampling = walk.view(frame).geometry, AdaptiveSampling.of(walk)
    everywhere, is_divided = np.ones(geometry.shape_index.shape, np.bool_), shot.renderer.has_sharp_light()
    estimate = shot.reconstructed_estimate(
        geometry.camera,
        everywhere,
        lambda rays, sampler: shot.integrator.diffuse_radiance(cache, shot.spawn(frame, rays, sampler)),
        walk.random(frame, Purpose.DIFFUSE),
        layers=1,
        auxiliary=2 * is_divided,
        reconstructed=1 + is_divided,
    )
    estimate.add(settings.min_spp)

    # Add rays at edges.
    emitters = small_emitter_pixels(shot.renderer.emitters(), geometry)
    edges = is_outline(geometry) | dilated(sampling.uncertain(estimate, everywhere) | emitters)
    return estimate, sampling.refine(estimate, everywhere, edges, everywhere, settings.min_spp)


def _provenance(geometry: Geometry, cache: IrradianceCache, is_specular: Mask, *, is_keyframe: bool) -> U8:
    """Provenance of the pixels of a shaded frame, (H, W)."""
    assert cache.view is not None  # noqa: S101  (`ShotContext.shading_cache`)
    is_known = np.array(cache.view.shape_indices).reshape(is_specular.shape) > 0
    base = Provenance.KEYFRAME if is_keyframe else Provenance.REUSED
    provenance = np.full(is_specular.shape, base, np.uint8)
    provenance[geometry.has_diffuse & ~is_known] = Provenance.DISOCCLUDED
    provenance[is_specular] = Provenance.SPECULAR
    return provenance
