"""Bilinear interpolation of images at positions between their pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from enfilade.arrays import Float, Int, UInt

STEPS = 256  # positions are rounded to 1/256 pixel, as in graphics hardware: an identity stays exact


@dataclass(frozen=True)
class Tap:
    """One of the four pixels around positions, as lanes.

    Attributes
    ----------
    column, row : Int
    lane : UInt
        Of the pixel.
    weight : Float
        Bilinear; those of the four taps sum to one.
    """

    column: Any
    row: Any
    lane: Any
    weight: Any


def bilinear_taps(x: Any, y: Any, *, width: Any, height: Any) -> list[Tap]:
    """The four pixels around positions, with weights in steps of 1/65536, which sum to one exactly.

    Parameters
    ----------
    x, y : Float
        Image coordinates; pixel (0, 0) has its centre at (0.5, 0.5). The outermost pixels are repeated
        beyond the border. At a pixel's centre that pixel has weight one.
    width, height : int or Int
        Of the image. Integers are compiled into the kernel.
    """
    u = dr.round((x - 0.5) * STEPS) / STEPS
    v = dr.round((y - 0.5) * STEPS) / STEPS
    return taps_around(u, v, width=width, height=height)


def taps_around(u: Any, v: Any, *, width: Any, height: Any) -> list[Tap]:
    """The four pixels around positions, which are not rounded.

    Parameters
    ----------
    u, v : Float
        Image coordinates less one half: pixel (0, 0) has its centre at (0, 0).
    width, height : int or Int
        As of :func:`bilinear_taps`.
    """
    left, top = dr.floor(u), dr.floor(v)
    across, down = u - left, v - top
    taps = []
    for below, weight_y in ((0, 1.0 - down), (1, down)):
        for beside, weight_x in ((0, 1.0 - across), (1, across)):
            column = dr.clip(Int(left) + beside, 0, width - 1)
            row = dr.clip(Int(top) + below, 0, height - 1)
            taps.append(Tap(column, row, UInt(row * width + column), weight_x * weight_y))
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
    for tap in bilinear_taps(x, y, width=width, height=height):
        total += Float(tap.weight) * dr.gather(kind, values, tap.lane)
    return total
