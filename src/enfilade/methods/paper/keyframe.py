"""Keyframes: traced in two independent halves, each of them denoised (§4.3, step 1)."""

from __future__ import annotations

import drjit as dr

from enfilade.arrays import Array3f, UInt, image, opaque
from enfilade.kernels.random import samplers
from enfilade.kernels.rays import box_offsets, camera_rays, pixel_centres
from enfilade.methods.denoise import denoise
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import F32, Halves
from enfilade.renderer import PixelFilter, Purpose
from enfilade.settings import SamplingSettings

MIN_SPP = 2  # one path of each half
MIN_GUIDE_RAYS = 16  # a pixel


def trace_keyframe(walk: Walkthrough, frame: int) -> Halves:
    """Trace a whole frame, with paths distributed over the pixels.

    The paper's ray tracer has no noise. Here each half of the paths is denoised alone, with guides of its
    own: errors that the denoiser makes of the noise, of paths and of guides, are independent, too, and do not
    agree in both halves.

    Returns
    -------
    Halves
        Denoised.
    """
    spp, halves, dropped = walk.settings[SamplingSettings].spp, [], 0
    for purpose, guide, paths in (
        (Purpose.KEYFRAME, Purpose.GUIDE, spp - spp // 2),
        (Purpose.KEYFRAME_SECOND_HALF, Purpose.GUIDE_SECOND_HALF, spp // 2),
    ):
        traced = walk.trace(frame, purpose, spp=paths, pixel_filter=PixelFilter.BOX)
        guides = find_guides(walk, frame, guide, spp=paths)
        halves.append(denoise(traced.color, *guides))
        dropped += traced.dropped
    return Halves(halves[0], halves[1], dropped)


def find_guides(walk: Walkthrough, frame: int, purpose: Purpose, *, spp: int) -> tuple[F32, F32]:
    """Albedo and normal of the surfaces visible in each pixel, box filtered: guides of the denoiser.

    Those of the G-buffer are sampled at pixel centres. As guides they would bring its aliasing into the
    image.

    Parameters
    ----------
    walk
    frame
    purpose
        Of the random numbers.
    spp
        Paths a pixel of the image. There are as many rays, and :data:`MIN_GUIDE_RAYS` or more: the denoiser
        takes the guides to be free of noise, so that textures would have the noise of too few of them.

    Returns
    -------
    albedo : (H, W, 3) float32
        0 where nothing is hit.
    normal : (H, W, 3) float32
        Mean of unit vectors in world space.
    """
    camera, random = walk.path.cameras[frame], walk.random(frame, purpose)
    at, pixel = pixel_centres(camera), dr.arange(UInt, camera.height * camera.width)
    albedo, normal = dr.zeros(Array3f, dr.width(pixel)), dr.zeros(Array3f, dr.width(pixel))
    count = max(spp, MIN_GUIDE_RAYS)
    for ray in range(count):
        offset = box_offsets(samplers(pixel, opaque(ray), random).next_2d())
        hit = walk.renderer.surfaces(camera_rays(camera, at + offset))
        albedo += dr.select(hit.is_hit, hit.albedo, 0)
        normal += dr.select(hit.is_hit, hit.normal, 0)
        dr.eval(albedo, normal)
    size = camera.height, camera.width
    share = opaque(1.0 / count)
    return image(albedo * share, *size), image(normal * share, *size)
