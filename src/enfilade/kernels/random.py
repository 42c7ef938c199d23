"""Random numbers as a function of seed, frame, purpose, pixel and path: not of order, chunk or worker.

A counter-based generator (Philox, Salmon et al. 2011) turns this key into the initial state of a cheap
sequential one (PCG32, O'Neill 2014) for each path.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from drjit.auto.ad import Philox4x32

from enfilade.arrays import PCG32, Array2f, Array4f, Float, UInt, UInt64, opaque
from enfilade.renderer import RandomKey

WHOLE_PIXEL = 0xFFFFFFFF  # in place of the path: the offset that all paths of a pixel share in two dimensions
WHOLE_PIXEL_4 = 0xFFFFFFFE  # the same in four dimensions
R2 = (3242174889, 2447445414)  # 2**32 over powers of the plastic number, the root of x^3 = x + 1
R4 = (3679390609, 3152041523, 2700274806, 2313257605)  # 2**32 over powers of the root of x^5 = x + 1


def streams(pixel: Any, path: Any, random: RandomKey) -> Any:
    """Independent random number generators, one a lane; PCG32.

    Parameters
    ----------
    pixel, path : UInt
        Flat index of the pixel, and index of the path in that pixel.
    random
    """
    a, b, c, d = _philox(pixel, path, random)
    high = UInt64(1 << 32)
    return PCG32(size=1, initstate=UInt64(a) * high + UInt64(b), initseq=UInt64(c) * high + UInt64(d))


def stratified(pixel: Any, path: Any, random: RandomKey) -> Any:
    """A Cranley-Patterson rotated R2 sequence for each pixel: points of the unit square, Array2f in [0, 1).

    Each point is uniform by itself, and the points of any run of paths cover the square evenly
    (Roberts 2018; Cranley and Patterson 1976).

    Parameters
    ----------
    pixel, path, random
        As of :func:`streams`.
    """
    a, b, _, _ = _philox(pixel, UInt(WHOLE_PIXEL), random)
    return Array2f(_unit(a + path * UInt(R2[0])), _unit(b + path * UInt(R2[1])))


def stratified4(pixel: Any, path: Any, random: RandomKey) -> Any:
    """A Cranley-Patterson rotated R4 sequence for each pixel: Array4f in [0, 1); see :func:`stratified`."""
    starts = _philox(pixel, UInt(WHOLE_PIXEL_4), random)
    return Array4f(*(_unit(start + path * UInt(step)) for start, step in zip(starts, R4, strict=True)))


class PrefixedRng:
    """A random number generator whose first numbers are given.

    Parameters
    ----------
    numbers : sequence of Float
        In [0, 1).
    rng : PCG32
        Draws the numbers after them.
    """

    def __init__(self, numbers: Iterable[Any], rng: Any) -> None:
        self._numbers = iter(numbers)
        self._rng = rng

    def next_float32(self, active: Any = True) -> Any:
        """Draw a number in [0, 1); Float."""
        number = next(self._numbers, None)
        return self._rng.next_float32(active) if number is None else number


def _unit(bits: Any) -> Any:
    """32 random bits as a number in [0, 1), of which a float holds 24; Float."""
    return Float(bits >> 8) * 2.0**-24


def _philox(pixel: Any, path: Any, random: RandomKey) -> Any:
    """Four times 32 random bits a lane."""
    return Philox4x32(
        seed=UInt64(opaque(random.seed)),
        counter_0=pixel,
        counter_1=path,
        counter_2=opaque(((random.frame & 0xFFFFFF) << 8) | int(random.purpose)),
    ).next_uint32x4()
