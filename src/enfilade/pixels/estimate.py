"""Monte Carlo estimates of lists of pixels: what all backends that trace paths share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt

from enfilade.arrays import Array2f, Array3f, Float, UInt, lanes, matrix3, opaque, vector3
from enfilade.camera import Camera
from enfilade.pixels.random import streams
from enfilade.pixels.rays import box_offsets, gaussian_offsets, pinhole_directions
from enfilade.records import Shading
from enfilade.renderer import PixelFilter, Rays

PASS = 64  # paths of a pixel summed in one go; fixed, so that no chunking changes a rounding
GAUSSIAN_SIGMA_PX, GAUSSIAN_RADIUS_PX = 0.5, 1.5  # PixelFilter.GAUSSIAN
LUMINANCE = (0.2126, 0.7152, 0.0722)  # linear Rec.709

Radiance = Callable[[Rays, Any], Any]


def estimate(
    camera: Camera,
    pixels: npt.NDArray[np.uint32],
    radiance: Radiance,
    *,
    spp: int,
    chunk: int,
    pixel_filter: PixelFilter,
    random: dict[str, int],
) -> Shading:
    """Average the paths of each pixel.

    Parameters
    ----------
    camera
    pixels : (N,) uint32
    radiance
        What arrives along rays (:class:`Rays`, any length of direction), given a random number
        generator for each: an Array3f. Called once a chunk.
    spp
        Paths a pixel.
    chunk
        Paths in flight at once; changes no result.
    pixel_filter
        Where in the image the paths begin.
    random
        Seed, frame and purpose of :func:`enfilade.pixels.random.streams`.

    Returns
    -------
    Shading
        Of shape (N,), over the finite samples of each pixel.
    """
    sums = np.zeros((5, len(pixels)))  # r, g, b, squared luminance, number of finite paths
    for first in range(0, spp, PASS):
        width = min(PASS, spp - first)
        step = max(chunk // width, 1)
        for start in range(0, len(pixels), step):
            part = slice(start, start + step)
            pixel, path = _numbered(pixels[part], first, width)
            rng = streams(pixel, path, **random)
            rays = _camera_rays(camera, pixel, rng, pixel_filter)
            sums[:, part] += _summed(radiance(rays, rng), width)
    return _mean(sums, spp)


def _numbered(pixels: npt.NDArray[np.uint32], first: int, width: int) -> tuple[Any, Any]:
    """Pixel and number of each path: `width` neighbouring lanes a pixel."""
    lane = dr.arange(UInt, len(pixels) * width)
    slot = lane // opaque(width)
    return dr.gather(UInt, lanes(pixels), slot), lane - slot * opaque(width) + opaque(first)


def _camera_rays(camera: Camera, pixel: Any, rng: Any, pixel_filter: PixelFilter) -> Rays:
    row = pixel // opaque(camera.width)
    at = Array2f(pixel - row * opaque(camera.width), row) + 0.5
    match pixel_filter:
        case PixelFilter.BOX:
            at += box_offsets(rng)
        case PixelFilter.GAUSSIAN:
            at += gaussian_offsets(rng, sigma=GAUSSIAN_SIGMA_PX, radius=GAUSSIAN_RADIUS_PX)
    direction = pinhole_directions(at.x, at.y, direction_from_pixel=matrix3(camera.direction_from_pixel))
    return Rays(origin=vector3(camera.eye), direction=direction)


def _summed(radiance: Any, width: int) -> npt.NDArray[np.float32]:
    """Sums over the finite paths of each pixel: r, g, b, squared luminance, count; (5, N)."""
    radiance = Array3f(radiance)
    luminance = dr.dot(radiance, Array3f(*LUMINANCE))
    squared = luminance * luminance
    is_valid = dr.isfinite(squared)  # what overflows when squared is no radiance either
    values = [*radiance, squared, Float(1)]
    values = [dr.select(is_valid, v, 0) for v in values]
    # Together, before any sum: each block_sum evaluates its input, and would trace all anew.
    dr.eval(values)
    return np.stack([np.array(dr.block_sum(v, width)) for v in values])


def _mean(sums: npt.NDArray[np.float64], spp: int) -> Shading:
    """Mean colour of each pixel, and the variance of the mean of its luminance."""
    count = np.maximum(sums[4], 1.0)
    mean = sums[:3] / count
    spread = np.maximum(sums[3] / count - np.dot(LUMINANCE, mean) ** 2, 0.0)
    return Shading(
        color=np.ascontiguousarray(mean.T, np.float32),
        variance=np.where(count > 1.0, spread / np.maximum(count - 1.0, 1.0), 0.0).astype(np.float32),
        dropped=int(spp * sums.shape[1] - sums[4].sum()),
    )
