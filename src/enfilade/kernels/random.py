"""Random numbers that depend on what they are for, and not on order, chunking or worker.

A counter-based generator (Philox, Salmon et al. 2011) turns seed, frame, purpose, pixel and path into
the start of a cheap sequential one (PCG32, O'Neill 2014) for each path.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from drjit.auto.ad import Philox4x32

from enfilade.arrays import PCG32, Array2f, Array4f, Float, UInt, UInt64, opaque
from enfilade.renderer import RandomKey

WHOLE_PIXEL = 0xFFFFFFFF  # the path's number in draws that all paths of a pixel share
WHOLE_PIXEL_4 = 0xFFFFFFFE  # ... in four dimensions
R4 = (3679390609, 3152041523, 2700274806, 2313257605)  # 2**32 over powers of the root of x^5 = x + 1
R2 = (3242174889, 2447445414)  # 2**32 over the plastic number, and over its square: Roberts 2018


def streams(pixel: Any, path: Any, random: RandomKey) -> Any:
    """One random number generator a lane.

    Parameters
    ----------
    pixel, path : UInt
        Flat index of the pixel, and number of the path in that pixel.
    random

    Returns
    -------
    PCG32
    """
    a, b, c, d = _drawn(pixel, path, random)
    high = UInt64(1 << 32)
    return PCG32(size=1, initstate=UInt64(a) * high + UInt64(b), initseq=UInt64(c) * high + UInt64(d))


def stratified(pixel: Any, path: Any, random: RandomKey) -> Any:
    """Points of the unit square that the paths of a pixel share out evenly among them.

    The R2 sequence (Roberts 2018), moved by a random offset of each pixel (Cranley and Patterson 1976): each
    point is uniform by itself, and any run of path numbers covers the square.

    Parameters are those of :func:`streams`.

    Returns
    -------
    Array2f
        In [0, 1).
    """
    a, b, _, _ = _drawn(pixel, UInt(WHOLE_PIXEL), random)
    return Array2f(_unit(a + path * UInt(R2[0])), _unit(b + path * UInt(R2[1])))


def stratified4(pixel: Any, path: Any, random: RandomKey) -> Any:
    """The same in the unit cube of four dimensions; Array4f."""
    starts = _drawn(pixel, UInt(WHOLE_PIXEL_4), random)
    return Array4f(*(_unit(start + path * UInt(step)) for start, step in zip(starts, R4, strict=True)))


class Leading:
    """A random number generator whose first numbers are given.

    Parameters
    ----------
    numbers : sequence of Float
        In [0, 1).
    rng : PCG32
        Draws what comes after them.
    """

    def __init__(self, numbers: Iterable[Any], rng: Any) -> None:
        self._numbers = iter(numbers)
        self._rng = rng

    def next_float32(self, active: Any = True) -> Any:
        """Draw a number in [0, 1); Float."""
        number = next(self._numbers, None)
        return self._rng.next_float32(active) if number is None else number


def _unit(number: Any) -> Any:
    """32 random bits as a number in [0, 1): as many of them as a float holds."""
    return Float(number >> 8) * 2.0**-24


def _drawn(pixel: Any, path: Any, random: RandomKey) -> Any:
    return Philox4x32(
        seed=UInt64(opaque(random.seed)),
        counter_0=pixel,
        counter_1=path,
        counter_2=opaque(((random.frame & 0xFFFFFF) << 8) | int(random.purpose)),
    ).next_uint32x4()
