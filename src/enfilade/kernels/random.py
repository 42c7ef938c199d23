"""Random numbers as a function of seed, frame, purpose, pixel and path: not of order, batch or worker.

A counter-based generator (Philox, Salmon et al. 2011) turns this key into the scrambling of a Sobol sequence
for each pixel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt
from drjit.auto.ad import Philox4x32

from enfilade.arrays import Array2f, Float, UInt, UInt64, lanes, opaque
from enfilade.renderer import RandomKey

BELOW_ONE = 1.0 - 2.0**-24  # the largest float32 below one


@dataclass
class PaddedSobolSampler:
    """A sequence of points for each pixel, in as many dimensions as its paths need; one point a lane.

    Pairs of dimensions are (0, 2)-sequences: the first two dimensions of Sobol's, nested uniformly scrambled
    (Owen 1995) by the hash function of Laine and Karras (2011), in an order that is shuffled likewise (Burley
    2020). Each number is uniform by itself, pairs are independent of each other, and the points of the first
    paths of a pixel cover the square evenly. As pbrt-v4's sampler of this name.

    Attributes
    ----------
    path : UInt
        Index of the path in its pixel.
    seed : UInt
        Of the pixel, or of the use that is made of its paths.
    dimension : UInt
        Next pair of dimensions.
    """

    path: Any
    seed: Any
    dimension: Any

    def next_1d(self) -> Any:
        """Draw a number in [0, 1); Float."""
        return self.next_2d()[0]

    def next_2d(self) -> Any:
        """Draw a point of [0, 1)^2; Array2f."""
        seed = _hashed(self.seed ^ _hashed(self.dimension))
        self.dimension = self.dimension + 1  # a copy may share the array
        index = _scrambled(dr.brev(self.path), seed)
        # Both dimensions of the sequence reverse the bits of the index; in the second they are mixed before.
        x = _scrambled(index, _hashed(seed + 1))
        y = _scrambled(_pascal(index), _hashed(seed + 2))
        return Array2f(Float(x >> 8), Float(y >> 8)) * 2.0**-24  # a float holds 24 bits

    def copy(self) -> PaddedSobolSampler:
        """A copy that draws the same numbers."""
        return replace(self)

    def fork(self, salt: Any) -> PaddedSobolSampler:
        """A copy that draws numbers of its own.

        Parameters
        ----------
        salt : UInt or int
            Tells copies of the same dimension apart.
        """
        return replace(self, seed=_hashed(self.seed ^ UInt(salt) ^ _hashed(self.dimension)))


def one_sequence(count: int, seed: int = 0) -> PaddedSobolSampler:
    """Points of a single sequence, one a lane."""
    return PaddedSobolSampler(
        path=dr.arange(UInt, count),
        seed=dr.opaque(UInt, seed, count),
        dimension=dr.opaque(UInt, 0, count),
    )


def samplers(pixel: Any, path: Any, random: RandomKey) -> PaddedSobolSampler:
    """A sampler for each path.

    Parameters
    ----------
    pixel, path : UInt
        Flat index of the pixel, and index of the path in that pixel.
    random
        Key of the random numbers.
    """
    seed = Philox4x32(
        seed=UInt64(opaque(random.seed)),
        counter_0=pixel,
        counter_1=UInt(0),
        counter_2=opaque(((random.frame & 0xFFFFFF) << 8) | int(random.purpose)),
    ).next_uint32x4()[0]
    return PaddedSobolSampler(path, seed, dr.opaque(UInt, 0, dr.width(path)))


def _scrambled(reversed_bits: Any, seed: Any) -> Any:
    """Nested uniform scrambling of numbers that are given with their bits in reverse; UInt.

    Each bit is flipped by a hash of those above it. The constants are those of pbrt-v4, by Vegdahl.
    """
    bits = reversed_bits ^ (reversed_bits * UInt(0x3D20ADEA))
    bits = (bits + seed) * ((seed >> 16) | 1)
    bits = bits ^ (bits * UInt(0x05526C56))
    bits = bits ^ (bits * UInt(0x53A22864))
    return dr.brev(bits)


def _pascal(index: Any) -> Any:
    """Product of Pascal's matrix modulo 2 and the bits of an index (Ahmed 2024); UInt."""
    for shift, mask in ((16, 0xFFFF0000), (8, 0xFF00FF00), (4, 0xF0F0F0F0), (2, 0xCCCCCCCC), (1, 0xAAAAAAAA)):
        index = index ^ ((index & UInt(mask)) >> shift)
    return index


def _hashed(bits: Any) -> Any:
    """An integer hash (Wellons 2018); UInt."""
    bits = (bits ^ (bits >> 16)) * UInt(0x21F0AAAD)
    bits = (bits ^ (bits >> 15)) * UInt(0xD35A2D97)
    return bits ^ (bits >> 15)


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
