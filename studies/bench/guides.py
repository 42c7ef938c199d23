"""Noise-free guides of a denoiser: albedo and normal of each pixel."""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt

from enfilade.arrays import PCG32, Array2f, Array3f, Bool, Float, UInt, lanes, matrix3, opaque, vector3
from enfilade.camera.pinhole import Camera
from enfilade.kernels.random import streams
from enfilade.kernels.rays import pinhole_directions
from enfilade.kernels.replay import padded
from enfilade.records import F32, SurfaceClass
from enfilade.renderer import LobeRenderer, Purpose, RandomKey, Rays, Renderer, Surfaces

SIDE = 4  # strata along each side of a pixel: 16 rays
BOUNCES = 6  # reflections and transmissions, before a path ends
SHARP = (SurfaceClass.MIRROR, SurfaceClass.TRANSPARENT)


def guides(
    renderer: Renderer, camera: Camera, *, seed: int, frame: int, chunk: int, is_followed: bool = False
) -> tuple[F32, F32]:
    """Albedo and normal of an image, through a box filter.

    Parameters
    ----------
    renderer
    camera
    seed, frame
        Of the random numbers.
    chunk
        Rays in flight; no result depends on it.
    is_followed
        Whether rays continue through mirrors and clear glass, as Open Image Denoise recommends, with a
        :class:`LobeRenderer`; otherwise they end at the first surface.

    Returns
    -------
    albedo : (H, W, 3) float32
        Diffuse reflectance times the throughput of mirrors and glass in front; 0 to 1, 0 where nothing is
        hit.
    normal : (H, W, 3) float32
        World-space normal of the surface where the path ends, averaged over the pixel (not normalized).
    """
    pixels = np.arange(camera.width * camera.height, dtype=np.uint32)
    step = max(chunk // SIDE**2, 1)
    random = RandomKey(seed, frame, Purpose.GUIDE)
    batches = [
        _pixel_guides(renderer, camera, pixels[i : i + step], random, is_followed)
        for i in range(0, len(pixels), step)
    ]
    found = np.concatenate(batches, axis=1).reshape(6, camera.height, camera.width).transpose(1, 2, 0)
    albedo = np.clip(found[..., :3], 0.0, 1.0)
    return np.ascontiguousarray(albedo), np.ascontiguousarray(found[..., 3:])


def _pixel_guides(
    renderer: Renderer,
    camera: Camera,
    pixels: npt.NDArray[np.uint32],
    random: RandomKey,
    is_followed: bool,
) -> npt.NDArray[np.float32]:
    # Trace one ray for each stratum of each pixel, in neighbouring lanes.
    count = SIDE * SIDE
    lane = dr.arange(UInt, len(pixels) * count)
    slot = lane // count
    stratum = lane - slot * count
    pixel = dr.gather(UInt, lanes(pixels), slot)
    rng = streams(pixel, stratum, random)
    row = pixel // opaque(camera.width)
    inside = Array2f(stratum % SIDE, stratum // SIDE) + Array2f(rng.next_float32(), rng.next_float32())
    at = Array2f(pixel - row * opaque(camera.width), row) + inside / SIDE
    direction = pinhole_directions(at.x, at.y, direction_from_pixel=matrix3(camera.direction_from_pixel))
    albedo, normal = _trace_guides(renderer, Rays(vector3(camera.eye), direction), rng, is_followed)

    # Average over the strata.
    dr.eval(albedo, normal)
    sums = [np.array(dr.block_sum(v, count)) for v in (*albedo, *normal)]
    return np.asarray(np.stack(sums) / count, np.float32)


def _trace_guides(
    renderer: Renderer,
    rays: Rays,
    rng: Any,
    is_followed: bool,
) -> tuple[Any, Any]:
    """Albedo and normal of the first surface, or behind mirrors and clear glass."""
    # Find the first surface.
    hit = renderer.surfaces(rays)
    albedo, normal = _guides_of(hit)
    is_sharp = _is_sharp(hit)
    dr.eval(albedo, normal, is_sharp, rng)
    if not is_followed or not isinstance(renderer, LobeRenderer):
        return albedo, normal
    lane = dr.arange(UInt, dr.width(is_sharp))
    throughput = dr.full(Array3f, 1, dr.width(lane))
    for _ in range(BOUNCES):
        # Keep the paths at sharp surfaces.
        active: Any = dr.compress(is_sharp)
        if not len(active):
            break
        lane, rng = dr.gather(UInt, lane, active), dr.gather(PCG32, rng, active)
        rays, throughput = dr.gather(Rays, rays, active), dr.gather(Array3f, throughput, active)

        # Reflect or transmit them.
        point = renderer.intersect(rays, opaque_only=True)
        sample = renderer.sample_specular(point, rng)
        throughput = dr.select(sample.is_alive, throughput * sample.throughput, 0)
        rays = sample.rays

        # Find the next surface, with lanes padded to the size of a recorded kernel.
        dr.eval(rays, throughput, rng)
        every = dr.arange(UInt, len(lane))
        padded_lanes, _ = padded(every)
        hit = dr.gather(Surfaces, renderer.surfaces(dr.gather(Rays, rays, padded_lanes)), every)
        next_albedo, next_normal = _guides_of(hit)
        for target, value in zip(albedo, throughput * next_albedo, strict=True):
            dr.scatter_add(target, Float(value), lane, mode=dr.ReduceMode.NoConflicts)
        for target, value in zip(normal, next_normal, strict=True):
            dr.scatter(target, value, lane)
        is_sharp = _is_sharp(hit) & sample.is_alive
        dr.eval(albedo, normal, is_sharp, throughput)
    return albedo, normal


def _guides_of(hit: Surfaces) -> tuple[Any, Any]:
    return Array3f(dr.select(hit.is_hit, hit.albedo, 0)), Array3f(dr.select(hit.is_hit, hit.normal, 0))


def _is_sharp(hit: Surfaces) -> Any:
    found = Bool(False)
    for one in SHARP:
        found |= hit.surface == int(one)
    return found & hit.is_hit
