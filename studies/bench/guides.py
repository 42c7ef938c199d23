"""Noise-free guides of a denoiser: albedo and normal of each pixel, seen in mirrors and through glass."""

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
BOUNCES = 6  # off mirrors and through glass, before the chain counts as it is
SHARP = (SurfaceClass.MIRROR, SurfaceClass.TRANSPARENT)


def guides(renderer: Renderer, camera: Camera, *, seed: int, frame: int, chunk: int) -> tuple[F32, F32]:
    """Find what guides a denoiser, filtered by a box as its colours are.

    Parameters
    ----------
    renderer
        One that can be asked for lobes (:class:`LobeRenderer`) is followed through mirrors and glass, as
        Open Image Denoise recommends; of another, the first surface counts.
    camera, seed, frame
        Of the image; what the random numbers depend on.
    chunk
        Rays in flight at once; changes no result.

    Returns
    -------
    albedo : (H, W, 3) float32
        Diffuse reflectance plus, where a surface shines, that of its lobe; times what mirrors and glass
        before it leave. 0..1; 0 where nothing is seen.
    normal : (H, W, 3) float32
        Of the surface where the chain ends, in the world, not of unit length where several meet.
    """
    pixels = np.arange(camera.width * camera.height, dtype=np.uint32)
    step = max(chunk // SIDE**2, 1)
    random = RandomKey(seed, frame, Purpose.GUIDE)
    parts = [_of_pixels(renderer, camera, pixels[i : i + step], random) for i in range(0, len(pixels), step)]
    found = np.concatenate(parts, axis=1).reshape(6, camera.height, camera.width).transpose(1, 2, 0)
    albedo = np.clip(found[..., :3], 0.0, 1.0)
    return np.ascontiguousarray(albedo), np.ascontiguousarray(found[..., 3:])


def _of_pixels(
    renderer: Renderer, camera: Camera, pixels: npt.NDArray[np.uint32], random: RandomKey
) -> npt.NDArray[np.float32]:
    # One ray in each of the strata of each pixel, neighbouring lanes.
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
    rays = Rays(origin=vector3(camera.eye), direction=direction)

    albedo, normal = _followed(renderer, rays, rng)
    dr.eval(albedo, normal)
    sums = [np.array(dr.block_sum(v, count)) for v in (*albedo, *normal)]
    return np.asarray(np.stack(sums) / count, np.float32)


def _first(seen: Surfaces) -> tuple[Any, Any]:
    return Array3f(dr.select(seen.is_hit, seen.albedo, 0)), Array3f(dr.select(seen.is_hit, seen.normal, 0))


def _followed(renderer: Renderer, rays: Rays, rng: Any) -> tuple[Any, Any]:
    # What the pixel itself shows.
    seen = renderer.surfaces(rays)
    albedo, normal = _first(seen)
    shines = _is_one_of(seen, SPECULAR)
    dr.eval(albedo, normal, shines, rng)
    lane: Any = dr.compress(shines)
    if not isinstance(renderer, LobeRenderer) or len(lane) == 0:
        return albedo, normal
    rays, rng = dr.gather(Rays, rays, lane), dr.gather(PCG32, rng, lane)
    throughput = dr.full(Array3f, 1, len(lane))
    for bounce in range(BOUNCES):
        point = renderer.intersect(rays, opaque_only=True)
        sample = renderer.sample_specular(point, rng)
        throughput = dr.select(sample.is_alive, throughput * sample.throughput, 0)

        # A lobe that is not sharp adds its reflectance and ends the chain.
        is_sharp = sample.is_alive & _is_one_of(point.surfaces, SHARP) & (bounce < BOUNCES - 1)
        _add(albedo, lane, dr.select(is_sharp, 0, throughput))
        dr.eval(sample.rays, throughput, is_sharp, rng)
        going: Any = dr.compress(is_sharp)
        if len(going) == 0:
            break
        lane, rng = dr.gather(UInt, lane, going), dr.gather(PCG32, rng, going)
        rays, throughput = dr.gather(Rays, sample.rays, going), dr.gather(Array3f, throughput, going)

        # A sharp one shows what is behind.
        seen = _surfaces(renderer, rays, len(lane))
        behind, turned = _first(seen)
        shines = _is_one_of(seen, SPECULAR)
        _add(albedo, lane, throughput * behind)
        for target, value in zip(normal, turned, strict=True):
            dr.scatter(target, value, lane)
        dr.eval(normal, shines, rays, throughput, rng)
        going = dr.compress(shines)
        if len(going) == 0:
            break
        lane, rng = dr.gather(UInt, lane, going), dr.gather(PCG32, rng, going)
        rays, throughput = dr.gather(Rays, rays, going), dr.gather(Array3f, throughput, going)
    return albedo, normal


def _surfaces(renderer: Renderer, rays: Rays, count: int) -> Surfaces:
    """What so many rays meet, asked in a number of lanes that suits recorded kernels."""
    every = dr.arange(UInt, count)
    more, _ = padded(every)
    found: Surfaces = dr.gather(Surfaces, renderer.surfaces(dr.gather(Rays, rays, more)), every)
    return found


def _is_one_of(seen: Surfaces, classes: tuple[SurfaceClass, ...]) -> Any:
    found = Bool(False)
    for one in classes:
        found |= seen.surface == int(one)
    return found & seen.is_hit


def _add(total: Any, lane: Any, value: Any) -> None:
    for target, part in zip(total, value, strict=True):
        dr.scatter_add(target, Float(part), lane, mode=dr.ReduceMode.NoConflicts)
    dr.eval(total)
