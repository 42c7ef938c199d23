"""Rays through points of the image, and where in a pixel its paths begin."""

from __future__ import annotations

import math
from typing import Any

import drjit as dr

from enfilade.arrays import Array3f


def pinhole_directions(x: Any, y: Any, *, direction_from_pixel: Any) -> Any:
    """World directions of unit depth through image points.

    Parameters
    ----------
    x, y : Float
        Image coordinates, pixels.
    direction_from_pixel : Matrix3f
        The camera's; see ``camera.Camera``.

    Returns
    -------
    Array3f
        Of unit length along the optical axis: a multiple of it is a depth.
    """
    return direction_from_pixel @ Array3f(x, y, 1)


def box_offsets(square: Any) -> Any:
    """Offsets from a pixel's centre, uniform over the pixel, of points of the unit square; Array2f."""
    return square - 0.5


def gaussian_offsets(square: Any, *, sigma: float, radius: float) -> Any:
    """Offsets from a pixel's centre, distributed as a pixel filter (Ernst et al. 2006).

    Each path then counts for one pixel alone: no weights, no order of adding.

    Parameters
    ----------
    square : Array2f
        Points of the unit square.
    sigma
        Standard deviation, pixels.
    radius
        Where the Gaussian is cut along each axis, pixels.

    Returns
    -------
    Array2f
    """
    scale = sigma * math.sqrt(2.0)
    kept = math.erf(radius / scale)
    return scale * dr.erfinv((2.0 * square - 1.0) * kept)
