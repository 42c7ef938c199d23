"""Camera rays: centres of pixels, directions through image points, and samples of the pixel filter."""

from __future__ import annotations

import math
from typing import Any

import drjit as dr

from enfilade.arrays import Array2f, Array3f, UInt, matrix3, opaque, vector3
from enfilade.camera.pinhole import Camera
from enfilade.renderer import Rays


def pixel_centres(camera: Camera, pixel: Any = None) -> Any:
    """Image coordinates of the centres of pixels; Array2f.

    Parameters
    ----------
    camera
    pixel : UInt
        Flat indices ``y * width + x``; None for all pixels.
    """
    if pixel is None:
        pixel = dr.arange(UInt, camera.height * camera.width)
    row = pixel // opaque(camera.width)
    return Array2f(pixel - row * opaque(camera.width), row) + 0.5


def camera_rays(camera: Camera, at: Any) -> Rays:
    """Rays through image points, with directions of unit depth: a distance along them is a depth.

    Parameters
    ----------
    camera
    at : Array2f
        Image coordinates, pixels.
    """
    return Rays(vector3(camera.eye), matrix3(camera.direction_from_pixel) @ Array3f(at.x, at.y, 1))


def points_at(camera: Camera, depths: Any, pixel: Any = None) -> Any:
    """Points in the world at some depths (Float) on the rays through the centres of pixels; Array3f.

    Parameters
    ----------
    camera
    depths : Float
        Distances along the optical axis, scene units.
    pixel
        As of :func:`pixel_centres`.
    """
    rays = camera_rays(camera, pixel_centres(camera, pixel))
    return rays.origin + depths * rays.direction


def box_offsets(sample_point: Any) -> Any:
    """Offsets from a pixel's centre, uniform over the pixel, of points of the unit square; Array2f."""
    return sample_point - 0.5


def gaussian_offsets(sample_point: Any, *, sigma: float, radius: float) -> Any:
    """Offsets from a pixel's centre, distributed as a Gaussian pixel filter (Ernst et al. 2006); Array2f.

    Filter importance sampling: each path contributes to a single pixel with weight one, so that no result
    depends on an order of additions.

    Parameters
    ----------
    sample_point : Array2f
        Points of the unit square.
    sigma
        Standard deviation, pixels.
    radius
        Of the filter along each axis, pixels: the Gaussian is cut there.
    """
    scale = sigma * math.sqrt(2.0)
    kept = math.erf(radius / scale)
    return scale * dr.erfinv((2.0 * sample_point - 1.0) * kept)
