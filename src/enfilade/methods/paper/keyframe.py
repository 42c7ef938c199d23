"""Keyframes: traced in two independent halves, each of them denoised (§4.3, step 1)."""

from __future__ import annotations

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, UInt, image, opaque
from enfilade.kernels.random import stratified
from enfilade.kernels.rays import box_offsets, camera_rays, pixel_centres
from enfilade.methods.denoise import denoise
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import F32, Halves
from enfilade.renderer import PixelFilter, Purpose
from enfilade.settings import SamplingSettings

MIN_SPP = 2  # one path of each half
GUIDE_RAYS = 16  # a pixel


def trace_keyframe(walk: Walkthrough, frame: int) -> Halves:
    """Trace a whole frame, with paths distributed over the pixels.

    The paper's ray tracer has no noise. Here each half of the paths is denoised alone: errors that the
    denoiser makes of the noise are independent, too, and do not agree in both halves.

    Returns
    -------
    Halves
        Denoised.
    """
    spp, size = walk.settings[SamplingSettings].spp, (walk.path.height, walk.path.width)
    everywhere, guides = np.ones(size, np.bool_), find_guides(walk, frame)
    first, second = (
        walk.trace(frame, everywhere, purpose, spp=paths, pixel_filter=PixelFilter.BOX)
        for purpose, paths in ((Purpose.KEYFRAME, spp - spp // 2), (Purpose.KEYFRAME_SECOND_HALF, spp // 2))
    )
    return Halves(
        denoise(first.color.reshape(*size, 3), *guides),
        denoise(second.color.reshape(*size, 3), *guides),
        first.dropped + second.dropped,
    )


def find_guides(walk: Walkthrough, frame: int) -> tuple[F32, F32]:
    """Albedo and normal of the surfaces visible in each pixel, box filtered: guides of the denoiser.

    Those of the G-buffer are sampled at pixel centres. As guides they would bring its aliasing into the
    image.

    Returns
    -------
    albedo : (H, W, 3) float32
        0 where nothing is hit.
    normal : (H, W, 3) float32
        Mean of unit vectors in world space.
    """
    camera, random = walk.path.cameras[frame], walk.random(frame, Purpose.GUIDE)
    at, pixel = pixel_centres(camera), dr.arange(UInt, camera.height * camera.width)
    albedo, normal = dr.zeros(Array3f, dr.width(pixel)), dr.zeros(Array3f, dr.width(pixel))
    for ray in range(GUIDE_RAYS):
        offset = box_offsets(stratified(pixel, opaque(ray), random))
        hit = walk.renderer.surfaces(camera_rays(camera, at + offset))
        albedo += dr.select(hit.is_hit, hit.albedo, 0)
        normal += dr.select(hit.is_hit, hit.normal, 0)
        dr.eval(albedo, normal)
    size = camera.height, camera.width
    return image(albedo / opaque(float(GUIDE_RAYS)), *size), image(normal / opaque(float(GUIDE_RAYS)), *size)
