"""Noise-free guides of a denoiser: albedo and normal of each pixel, traced through mirrors and glass."""

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
from enfilade.records import F32, SPECULAR, SurfaceClass
from enfilade.renderer import LobeRenderer, Purpose, RandomKey, Rays, Renderer, Surfaces

SIDE = 4  # strata along each side of a pixel: 16 rays
BOUNCES = 6  # reflections and transmissions, before a path ends
SHARP = (SurfaceClass.MIRROR, SurfaceClass.TRANSPARENT)


def guides(renderer: Renderer, camera: Camera, *, seed: int, frame: int, chunk: int) -> tuple[F32, F32]:
    """Albedo and normal of an image, through a box filter.

    Parameters
    ----------
    renderer
        With a :class:`LobeRenderer` rays continue through mirrors and glass, as Open Image Denoise
        recommends; with others they end at the first surface.
    camera
    seed, frame
        Of the random numbers.
    chunk
        Rays in flight; no result depends on it.

    Returns
    -------
    albedo : (H, W, 3) float32
        Diffuse reflectance, plus that of the lobe on glossy surfaces, times the throughput of mirrors and
        glass in front; 0 to 1, 0 where nothing is hit.
    normal : (H, W, 3) float32
        World-space normal of the surface where the path ends, averaged over the pixel (not normalized).
    """
    pixels = np.arange(camera.width * camera.height, dtype=np.uint32)
    step = max(chunk // SIDE**2, 1)
    random = RandomKey(seed, frame, Purpose.GUIDE)
    batches = [
        _pixel_guides(renderer, camera, pixels[i : i + step], random) for i in range(0, len(pixels), step)
    ]
    found = np.concatenate(batches, axis=1).reshape(6, camera.height, camera.width).transpose(1, 2, 0)
    albedo = np.clip(found[..., :3], 0.0, 1.0)
    return np.ascontiguousarray(albedo), np.ascontiguousarray(found[..., 3:])


def _pixel_guides(
    renderer: Renderer, camera: Camera, pixels: npt.NDArray[np.uint32], random: RandomKey
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
    albedo, normal = _trace_guides(renderer, Rays(vector3(camera.eye), direction), rng)

    # Average over the strata.
    dr.eval(albedo, normal)
    sums = [np.array(dr.block_sum(v, count)) for v in (*albedo, *normal)]
    return np.asarray(np.stack(sums) / count, np.float32)


def _trace_guides(renderer: Renderer, rays: Rays, rng: Any) -> tuple[Any, Any]:
    """Trace paths through sharp surfaces; albedo and normal at the end of each."""
    # Find the first surface.
    hit = renderer.surfaces(rays)
    albedo, normal = _guides_of(hit)
    is_specular = _is_one_of(hit, SPECULAR)
    dr.eval(albedo, normal, is_specular, rng)
    lane: Any = dr.compress(is_specular)
    if not isinstance(renderer, LobeRenderer) or len(lane) == 0:
        return albedo, normal
    rays, rng = dr.gather(Rays, rays, lane), dr.gather(PCG32, rng, lane)
    throughput = dr.full(Array3f, 1, len(lane))
    for bounce in range(BOUNCES):
        point = renderer.intersect(rays, opaque_only=True)
        sample = renderer.sample_specular(point, rng)
        throughput = dr.select(sample.is_alive, throughput * sample.throughput, 0)

        # End paths at lobes that are not sharp, with their reflectance.
        is_sharp = sample.is_alive & _is_one_of(point.surfaces, SHARP) & (bounce < BOUNCES - 1)
        _add(albedo, lane, dr.select(is_sharp, 0, throughput))
        dr.eval(sample.rays, throughput, is_sharp, rng)
        active: Any = dr.compress(is_sharp)
        if len(active) == 0:
            break
        lane, rng = dr.gather(UInt, lane, active), dr.gather(PCG32, rng, active)
        rays, throughput = dr.gather(Rays, sample.rays, active), dr.gather(Array3f, throughput, active)

        # Find the next surface, with lanes padded to the size of a recorded kernel.
        every = dr.arange(UInt, len(lane))
        padded_lanes, _ = padded(every)
        hit = dr.gather(Surfaces, renderer.surfaces(dr.gather(Rays, rays, padded_lanes)), every)
        next_albedo, next_normal = _guides_of(hit)
        is_specular = _is_one_of(hit, SPECULAR)
        _add(albedo, lane, throughput * next_albedo)
        for target, value in zip(normal, next_normal, strict=True):
            dr.scatter(target, value, lane)

        # Continue paths at specular surfaces.
        dr.eval(normal, is_specular, rays, throughput, rng)
        active = dr.compress(is_specular)
        if len(active) == 0:
            break
        lane, rng = dr.gather(UInt, lane, active), dr.gather(PCG32, rng, active)
        rays, throughput = dr.gather(Rays, rays, active), dr.gather(Array3f, throughput, active)
    return albedo, normal


def _guides_of(hit: Surfaces) -> tuple[Any, Any]:
    return Array3f(dr.select(hit.is_hit, hit.albedo, 0)), Array3f(dr.select(hit.is_hit, hit.normal, 0))


def _is_one_of(hit: Surfaces, classes: tuple[SurfaceClass, ...]) -> Any:
    found = Bool(False)
    for one in classes:
        found |= hit.surface == int(one)
    return found & hit.is_hit


def _add(total: Any, lane: Any, value: Any) -> None:
    for target, part in zip(total, value, strict=True):
        dr.scatter_add(target, Float(part), lane, mode=dr.ReduceMode.NoConflicts)
    dr.eval(total)
