"""Irradiance of the surfaces that mirrors and panes show: path traced, denoised as they are seen.

Light on surfaces is smooth as seen in a plane mirror, as it is when seen directly. What paths estimate there
one by one stays noisy in the hash grid, whose entries are too small for many of them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import lanes, rows
from enfilade.kernels.estimate import RayCount, Samples
from enfilade.kernels.random import one_sequence
from enfilade.kernels.rays import camera_rays, pixel_centres
from enfilade.methods.decoupled.denoising import NOISE_SHARE, OUTLIER, denoise_light
from enfilade.methods.decoupled.hash_grid import LEVELS
from enfilade.methods.decoupled.hash_grid_entries import Entries
from enfilade.methods.decoupled.paths import WITHIN, Path
from enfilade.methods.decoupled.shot import ShotContext
from enfilade.methods.decoupled.virtual_images import CHOICES, IN_VIRTUAL_IMAGE
from enfilade.records import Geometry, Shading
from enfilade.renderer import Purpose, Rays

SPP = 16  # paths of a pixel (bathroom, staircase2)
DENOISED_SAMPLES = 16  # estimates as which a denoised pixel counts


def trace_virtual_images(shot: ShotContext, frame: int) -> tuple[Entries, RayCount]:
    """Estimate irradiance where mirrors and panes of a keyframe show surfaces that no prepass image shows.

    It is not gathered from the cache: that has the light of paths that are one edge longer than those by way
    of a mirror may be.

    Parameters
    ----------
    shot
    frame

    Returns
    -------
    entries : Entries
    count : RayCount
    """
    images = shot.virtual_images.find(shot.images.virtual_geometry(frame))
    traced = [_trace(shot, frame, *image) for image in zip(images, CHOICES, strict=True)]
    entries = Entries.joined([found for found, _ in traced])
    return entries, sum((count for _, count in traced), RayCount())


def _trace(shot: ShotContext, frame: int, virtual: Geometry, choice: float) -> tuple[Entries, RayCount]:
    """Entries of a virtual image, and the number of rays."""
    cache, camera = shot.prepass_cache(frame), virtual.camera

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

    # Estimate their irradiance.
    def radiance(rays: Rays, sampler: Any) -> Samples:
        return shot.integrator.path_traced(cache, seen_along(rays, sampler), dr.width(sampler.seed))

    is_traced = np.zeros(virtual.shape_index.shape, np.bool_)
    is_traced.flat[pixels] = True
    random = shot.walk.random(frame, Purpose.VIRTUAL_IMAGES)
    estimate = shot.estimate(camera, is_traced, radiance, random, layers=shot.integrator.irradiance_layers)
    estimate.add(SPP)

    # Denoise it; a denoised pixel is as reliable as many samples.
    layers, times = [shading.color for shading in estimate.shadings], 1
    if (denoiser := shot.settings.denoiser) != "none":
        # Virtual images do not lie in the planes that their depths and normals describe.
        guide = replace(virtual, depth=np.zeros_like(virtual.depth))
        is_within = (virtual.shape_index & WITHIN) > 0
        for layer, shading in enumerate(estimate.shadings):
            variance = np.float32(NOISE_SHARE) * shading.variance
            light, is_shown = Shading(shading.color, variance).to_image(is_traced), is_traced.copy()
            if layer == 0:  # what the prepass images show is black among these; they have all light
                is_shown.flat[known_pixels] = True
                light.color.reshape(-1, 3)[known_pixels] = known_irradiance
            for part in (is_within, ~is_within):  # apart, since the denoiser would mix them
                pixels_of = is_traced & part
                if pixels_of.any():
                    own = Shading(light.color * part[..., None], light.variance * part)
                    found = denoise_light(guide, own, is_shown & part, quality=denoiser, outlier=OUTLIER)
                    layers[layer][part[is_traced]] = found[pixels_of]
        times = DENOISED_SAMPLES
    irradiance = np.hstack(layers)

    # Fill entries of all sizes that are looked up: the smallest are as wide as one or two pixels, so that the
    # centres of pixels leave most of them empty on surfaces at grazing angles. A larger one has the weight of
    # one pixel, since it is for what lies between, not for the wide paths of other lobes.
    keys = [np.array(key)[chosen] for key in keys]
    sizes = [
        Entries.of(keys[level : level + LEVELS + 1], irradiance, unit=shot.unit).weighted(times / 4.0**level)
        for level in range(LEVELS)
    ]
    return Entries.joined(sizes), estimate.count
