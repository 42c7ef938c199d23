"""Bilinear interpolation of images at positions between their pixels."""

from __future__ import annotations

from typing import Any

import drjit as dr

from enfilade.arrays import Float, Int, UInt

STEPS = 256  # positions are known to 1/256 pixel, as in graphics hardware: an identity stays exact


def bilinear_taps(x: Any, y: Any, *, width: int, height: int) -> list[tuple[Any, Any]]:
    """The four pixels around each position and their weights.

    Parameters
    ----------
    x, y : Float
        Image coordinates; pixel (0, 0) has its centre at (0.5, 0.5). Beyond the border the outermost
        pixels are repeated.

    Returns
    -------
    list of (UInt, Float)
        Lane of the pixel, and its weight; the weights sum to one. At a pixel's centre that pixel
        has weight one, exactly.
    """
    u = dr.round((x - 0.5) * STEPS) / STEPS
    v = dr.round((y - 0.5) * STEPS) / STEPS
    left, top = dr.floor(u), dr.floor(v)
    across, down = u - left, v - top

    taps = []
    for row, weight_y in ((0, 1.0 - down), (1, down)):
        for column, weight_x in ((0, 1.0 - across), (1, across)):
            i = dr.clip(Int(left) + column, 0, width - 1)
            j = dr.clip(Int(top) + row, 0, height - 1)
            taps.append((UInt(j * width + i), weight_x * weight_y))
    return taps


def sample(values: Any, x: Any, y: Any, *, width: int, height: int) -> Any:
    """Bilinearly interpolated values of an image at positions between its pixels.

    Parameters
    ----------
    values : Float, Array2f or Array3f
        The image, width * height lanes.
    x, y : Float
        Image coordinates, pixels.
    """
    kind = type(values)
    total = kind(0)
    for lane, weight in bilinear_taps(x, y, width=width, height=height):
        total += Float(weight) * dr.gather(kind, values, lane)
    return total
