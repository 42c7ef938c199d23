"""Random numbers as a function of seed, frame, purpose, pixel and path: not of order, chunk or worker.

A counter-based generator (Philox, Salmon et al. 2011) turns this key into the initial state of a cheap
sequential one (PCG32, O'Neill 2014) for each path.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt
from drjit.auto.ad import Philox4x32

from enfilade.arrays import PCG32, Array2f, Array4f, Float, UInt, UInt64, lanes, opaque
from enfilade.renderer import RandomKey

WHOLE_PIXEL = 0xFFFFFFFF  # in place of the path: the offset that all paths of a pixel share in two dimensions
WHOLE_PIXEL_4 = 0xFFFFFFFE  # the same in four dimensions
BELOW_ONE = 1.0 - 2.0**-24  # the largest float32 below one
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


@dataclass(frozen=True)
class Discrete:
    """A discrete distribution. Unlike Mitsuba's, a recorded kernel finds its arrays.

    Attributes
    ----------
    before, pmf : Float
        By index: probability of all earlier ones, and its own.
    """

    before: Any
    pmf: Any

    @staticmethod
    def of(weights: npt.NDArray[np.float64]) -> Discrete:
        """The distribution with probabilities in proportion to weights, (N,), not all of them 0."""
        pmf = weights / weights.sum()
        before = np.cumsum(pmf) - pmf
        before[np.flatnonzero(pmf)[-1] + 1 :] = 2.0  # rounding must not reach the impossible ones at the end
        return Discrete(lanes(before.astype(np.float32)), lanes(pmf.astype(np.float32)))

    def sample(self, sample: Any) -> tuple[Any, Any, Any]:
        """An index (UInt), the sample (Float in [0, 1)) within it, to be used again, and its probability."""
        last = dr.width(self.pmf) - 1

        def is_later(index: Any) -> Any:
            return dr.gather(Float, self.before, dr.minimum(index + 1, last)) <= sample

        index = UInt(dr.binary_search(0, last, is_later))  # type: ignore[no-untyped-call]
        pmf = dr.gather(Float, self.pmf, index)
        within = (sample - dr.gather(Float, self.before, index)) / pmf
        return index, dr.clip(within, 0.0, BELOW_ONE), pmf
