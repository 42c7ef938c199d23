"""Irradiance of the surfaces that mirrors and panes show: path traced, denoised as they are seen.

Light on surfaces is smooth as seen in a plane mirror, as it is when seen directly. What paths estimate there
one by one stays noisy in the hash grid, whose entries are too small for many of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import UInt, lanes, rows
from enfilade.kernels.estimate import Estimate, RayCount, Samples
from enfilade.kernels.random import one_sequence
from enfilade.kernels.rays import camera_rays, pixel_centres
from enfilade.methods.decoupled.denoising import CORRECTION_LEVELS, OUTLIER, correct_light, denoise_light
from enfilade.methods.decoupled.hash_grid import LEVELS
from enfilade.methods.decoupled.hash_grid_entries import Entries
from enfilade.methods.decoupled.irradiance_cache import IrradianceCache
from enfilade.methods.decoupled.light_camera import virtual_scale
from enfilade.methods.decoupled.paths import WITHIN, Path
from enfilade.methods.decoupled.shot import ShotContext
from enfilade.methods.decoupled.virtual_images import CHOICES, IN_VIRTUAL_IMAGE
from enfilade.records import F32, Geometry, Mask, Shading
from enfilade.renderer import Purpose, Rays

SPP = 16  # paths of a pixel of the light camera (bathroom, staircase2)
GATHER_SPP = 8  # gather rays of a pixel
DENOISED_SAMPLES = 16  # estimates as which a denoised pixel counts


def estimate_virtual_images(
    shot: ShotContext, frame: int, cache: IrradianceCache
) -> tuple[Entries, RayCount]:
    """Estimate irradiance where mirrors and panes of a keyframe show surfaces that no prepass image shows.

    Path traced, it is too noisy where most light comes by several bounces. Gathered, it has the errors of the
    cache, whose light near lamps that the camera does not see is coarse, and after several bounces has a mean
    weight. So what is gathered is corrected as far as the difference exceeds its own noise.
    """
    images = shot.virtual_images.find(shot.images.virtual_geometry(frame))
    estimated = [_estimate(shot, frame, cache, *image) for image in zip(images, CHOICES, strict=True)]
    entries = Entries.joined([found for found, _ in estimated])
    return entries, sum((count for _, count in estimated), RayCount())


def _estimate(
    shot: ShotContext, frame: int, cache: IrradianceCache, virtual: Geometry, choice: float
) -> tuple[Entries, RayCount]:
    """Entries of a virtual image, and the number of rays."""
    camera = virtual.camera

    def seen_along(rays: Rays, sampler: Any) -> Path:
        return shot.virtual_images.seen_along(shot.spawn(frame, rays, sampler), choice)

    # Find the surfaces, and their entries.
    pixels = np.flatnonzero(virtual.shape_index > IN_VIRTUAL_IMAGE).astype(np.uint32)
    if not len(pixels):
        return Entries.joined([]), RayCount()
    path = seen_along(camera_rays(camera, pixel_centres(camera, lanes(pixels))), one_sequence(len(pixels)))
    if not dr.width(path.lane):
        return Entries.joined([]), RayCount()
    keys, cached, is_known, is_missing = shot.integrator.kernels.find_entries(cache, path)
    chosen, lane = np.flatnonzero(np.array(is_missing)), np.array(path.lane)
    if not len(chosen):
        return Entries.joined([]), RayCount()
    known = np.array(is_known)
    known_pixels, known_irradiance = pixels[lane[known]], rows(cached)[known]
    chosen = chosen[np.argsort(lane[chosen])]  # in the order of the pixels
    pixels = pixels[lane[chosen]]

    # Path trace their irradiance, which has noise, and gather it, which has the errors of the cache.
    is_traced = np.zeros(virtual.shape_index.shape, np.bool_)
    is_traced.flat[pixels] = True

    def estimated(irradiance: Callable[..., Samples], spp: int, purpose: Purpose) -> Estimate:
        def radiance(rays: Rays, sampler: Any) -> Samples:
            path = seen_along(rays, sampler)
            # Entries of the hash grid have the light of paths after one bounce.
            path = replace(path, depth=dr.opaque(UInt, 1, dr.width(path.lane)))
            return irradiance(cache, path, dr.width(sampler.seed))

        random, layers = shot.walk.random(frame, purpose), shot.integrator.irradiance_layers
        estimate = shot.estimate(camera, is_traced, radiance, random, layers=layers)
        estimate.add(spp)
        return estimate

    is_denoised = shot.settings.denoiser != "none"
    scale = virtual_scale(shot.walk.path.cameras[frame]) if is_denoised else 1
    # A denoiser needs as many paths in any size of the image; without it all pixels have them.
    traced = estimated(shot.integrator.path_traced, SPP // scale**2, Purpose.VIRTUAL_IMAGES)

    # Denoise what is gathered, and correct it by what is path traced; a denoised pixel is as reliable as many
    # samples.
    layers, times, count = [shading.color for shading in traced.shadings], 1, traced.count
    if is_denoised:
        levels = CORRECTION_LEVELS + scale.bit_length() - 1  # the same part of the view in any size
        gathered = estimated(shot.integrator.gathered, GATHER_SPP, Purpose.GATHERED_VIRTUAL_IMAGES)
        in_prepass = np.zeros((*is_traced.shape, 3), np.float32), np.zeros_like(is_traced)
        in_prepass[0].reshape(-1, 3)[known_pixels] = known_irradiance
        in_prepass[1].flat[known_pixels] = True
        for layer, estimates in enumerate(zip(gathered.shadings, traced.shadings, strict=True)):
            shown = in_prepass if layer == 0 else None  # it has all light
            layers[layer] = _corrected(
                virtual, *estimates, is_traced, shown, levels, quality=shot.settings.denoiser
            )
        times, count = DENOISED_SAMPLES, count + gathered.count
    irradiance = np.hstack(layers)

    # Fill entries of all sizes that are looked up: the smallest are as wide as one or two pixels, so that the
    # centres of pixels leave most of them empty on surfaces at grazing angles. A larger one has the weight of
    # one pixel, since it is for what lies between, not for the wide paths of other lobes.
    keys = [np.array(key)[chosen] for key in keys]
    sizes = [
        Entries.of(keys[level : level + LEVELS + 1], irradiance, unit=shot.unit).weighted(times / 4.0**level)
        for level in range(LEVELS)
    ]
    return Entries.joined(sizes), count


def _corrected(
    virtual: Geometry,
    gathered: Shading,
    traced: Shading,
    where: Mask,
    in_prepass: tuple[F32, Mask] | None,
    levels: int,
    *,
    quality: str,
) -> F32:
    """Denoise what is gathered, and correct it by what is path traced.

    Parameters
    ----------
    virtual
        G-buffer with the virtual image.
    gathered, traced
        Estimates of the pixels of `where`, row by row.
    where : (H, W) bool
    in_prepass
        Light, (H, W, 3), that the prepass images show between these pixels, and where, (H, W); it would be
        black.
    levels
        Of the wavelet that smooths the correction.
    quality
        Of the denoiser.

    Returns
    -------
    (N, 3) float32
        Of the pixels of `where`, row by row.
    """
    gathered_image, traced_image, is_shown = gathered.to_image(where), traced.to_image(where), where
    if in_prepass:
        known, is_known = in_prepass
        is_shown = where | is_known
        for image in (gathered_image, traced_image):
            image.color[is_known] = known[is_known]
    # Without variance all light that is gathered is kept.
    gathered_image = replace(gathered_image, variance=np.zeros_like(gathered_image.variance))
    # Virtual images do not lie in the planes that their depths and normals describe.
    guide = replace(virtual, depth=np.zeros_like(virtual.depth))
    is_within = (virtual.shape_index & WITHIN) > 0
    corrected = np.zeros_like(gathered_image.color)
    for part in (is_within, ~is_within):  # apart, since the denoiser would mix them
        if (where & part).any():
            shown = is_shown & part
            own = replace(gathered_image, color=gathered_image.color * part[..., None])
            clean = denoise_light(guide, own, shown, quality=quality, outlier=OUTLIER, is_excess_kept=True)
            corrected[part] = correct_light(guide, clean, traced_image, shown, levels=levels)[part]
    return corrected[where]
