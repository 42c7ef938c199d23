"""The direction that the contrast in a channel has, from what its neighbours see of it.

A channel passes frequency vectors up to 30 degrees to either side of its centre. What moves blurs by its
frequency along the motion, so that the centre will not do: half way between two channels, at 45 degrees, it
is 0.71 of the whole where the two centres say 0.87 and 0.5. The squares of the fans (`Partition.POWER`) sum
to one, so that the shares of two neighbours tell the direction of what both see.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.metric.cortex import FAN_HALF_WIDTH_DEG, ORIENTATIONS_DEG

__all__ = ["channel_directions"]

Float32Array: TypeAlias = npt.NDArray[np.float32]

FAINTEST = 1e-30  # keeps shares finite where there is no contrast


def _towards(share: Float32Array) -> Float32Array:
    """How far towards a neighbour a direction lies of which that neighbour sees a share, signed, degrees."""
    window = np.float32(2.0 / np.pi) * np.arcsin(np.sqrt(np.abs(share)))
    away = np.arccos(np.maximum(1.0 - 2.0 * window, -1.0)) * np.float32(FAN_HALF_WIDTH_DEG / np.pi)
    signed: Float32Array = np.copysign(away, share)
    return signed


def channel_directions(energies: Float32Array) -> Float32Array:
    """Direction of the frequency vector of what each channel of a band sees.

    Exact where there is one direction; the channel's centre where both neighbours see as much, as in noise.

    Parameters
    ----------
    energies : (6, ...) float32
        Of the channels, 0 or more, in the order of ORIENTATIONS_DEG, gathered over more than a period.

    Returns
    -------
    (6, ...) float32
        Degrees from x (right) towards y (down), within 30 of the channel's centre.
    """
    before, after = np.roll(energies, 1, axis=0), np.roll(energies, -1, axis=0)
    total = energies + before
    total += after
    np.maximum(total, np.float32(FAINTEST), out=total)
    after -= before
    after /= total
    centres = np.array(ORIENTATIONS_DEG, dtype=np.float32).reshape(-1, *(1,) * (energies.ndim - 1))
    return centres + _towards(after)
