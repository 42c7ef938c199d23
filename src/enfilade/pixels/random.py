"""Random numbers that depend on what they are for, and not on order, chunking or worker.

A counter-based generator (Philox, Salmon et al. 2011) turns seed, frame, purpose, pixel and path into
the start of a cheap sequential one (PCG32, O'Neill 2014) for each path.
"""

from __future__ import annotations

from typing import Any

from drjit.auto.ad import Philox4x32

from enfilade.arrays import PCG32, UInt64, opaque


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
    philox = Philox4x32(
        seed=UInt64(opaque(seed)),
        counter_0=pixel,
        counter_1=path,
        counter_2=opaque(((frame & 0xFFFFFF) << 8) | purpose),
    )
    a, b, c, d = philox.next_uint32x4()
    high = UInt64(1 << 32)
    return PCG32(size=1, initstate=UInt64(a) * high + UInt64(b), initseq=UInt64(c) * high + UInt64(d))
