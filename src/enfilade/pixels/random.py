"""Random numbers that depend on what they are for, and not on order, chunking or worker.

A counter-based generator (Philox, Salmon et al. 2011) turns seed, frame, purpose, pixel and path into
the start of a cheap sequential one (PCG32, O'Neill 2014) for each path.
"""

from __future__ import annotations

from typing import Any

from drjit.auto.ad import Philox4x32

from enfilade.arrays import PCG32, Array2f, Float, UInt, UInt64, opaque

WHOLE_PIXEL = 0xFFFFFFFF  # the path's number in draws that all paths of a pixel share
R2 = (3242174889, 2447445414)  # 2**32 over the plastic number, and over its square: Roberts 2018


def streams(pixel: Any, path: Any, *, seed: int, frame: int, purpose: int) -> Any:
    """One random number generator a lane.

    Parameters
    ----------
    pixel, path : UInt
        Flat index of the pixel, and number of the path in that pixel.
    seed, frame, purpose
        The run's seed (32 bits), the frame's index (24 bits), what the numbers are for (8 bits).

    Returns
    -------
    PCG32
    """
    a, b, c, d = _drawn(pixel, path, seed=seed, frame=frame, purpose=purpose)
    high = UInt64(1 << 32)
    return PCG32(size=1, initstate=UInt64(a) * high + UInt64(b), initseq=UInt64(c) * high + UInt64(d))


def stratified(pixel: Any, path: Any, *, seed: int, frame: int, purpose: int) -> Any:
    """Points of the unit square that the paths of a pixel share out evenly among them.

    The R2 sequence (Roberts 2018), moved by a random offset of each pixel (Cranley and Patterson 1976): each
    point is uniform by itself, and any run of path numbers covers the square.

    Parameters are those of :func:`streams`.

    Returns
    -------
    Array2f
        In [0, 1).
    """
    a, b, _, _ = _drawn(pixel, UInt(WHOLE_PIXEL), seed=seed, frame=frame, purpose=purpose)
    return Array2f(_unit(a + path * UInt(R2[0])), _unit(b + path * UInt(R2[1])))


def _unit(number: Any) -> Any:
    """32 random bits as a number in [0, 1): as many of them as a float holds."""
    return Float(number >> 8) * 2.0**-24


def _drawn(pixel: Any, path: Any, *, seed: int, frame: int, purpose: int) -> Any:
    return Philox4x32(
        seed=UInt64(opaque(seed)),
        counter_0=pixel,
        counter_1=path,
        counter_2=opaque(((frame & 0xFFFFFF) << 8) | purpose),
    ).next_uint32x4()
