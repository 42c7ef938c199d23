"""Maps at half and double size, samples standing on every second pixel of the finer map."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

__all__ = ["double", "halve", "halve_periodic", "halved_shape"]

Float32Array: TypeAlias = npt.NDArray[np.float32]


def halved_shape(shape: tuple[int, int], reduction: int) -> tuple[int, int]:
    """Samples at every `reduction`-th pixel, the last at or beyond the last pixel.

    Parameters
    ----------
    shape : tuple of int
        Height and width in pixels.
    reduction : int
        A power of two.

    Returns
    -------
    tuple of int
        Height and width in samples.
    """
    height, width = shape
    return -(-(height - 1) // reduction) + 1, -(-(width - 1) // reduction) + 1


def _halve(fine: Float32Array, coarse: Float32Array) -> Float32Array:
    """Rows of a map, weights 1/4, 1/2, 1/4 around every second; transposed views do columns."""
    even, odd = fine[::2], fine[1::2]
    inner, outer = coarse[: len(even)], coarse[len(even) :]
    np.multiply(even, np.float32(2.0), out=inner)
    inner[: len(odd)] += odd
    inner[0] += fine[0]
    inner[1:] += odd[: len(even) - 1]
    inner[len(odd) :] += fine[-1]
    inner *= np.float32(0.25)
    outer[...] = fine[-1]
    return coarse


def halve(fine: Float32Array) -> Float32Array:
    """Average a map down by two, weights 1/4, 1/2, 1/4 around every second pixel.

    Parameters
    ----------
    fine : (H, W) float32
        The map, repeated beyond its borders.

    Returns
    -------
    (H // 2 + 1, W // 2 + 1) float32
        Never outside the range of `fine`.
    """
    height, width = fine.shape
    rows = _halve(fine, np.empty((height // 2 + 1, width), dtype=np.float32))
    coarse = np.empty((height // 2 + 1, width // 2 + 1), dtype=np.float32)
    _halve(rows.T, coarse.T)
    return coarse


def halve_periodic(fine: Float32Array) -> Float32Array:
    """Average a periodic map down by two, with the weights of `halve`; the mean stays.

    Parameters
    ----------
    fine : (H, W) float32
        The map, H and W even.

    Returns
    -------
    (H / 2, W / 2) float32
        Never outside the range of `fine`.
    """
    for axis in (0, 1):
        even, odd = (fine[::2], fine[1::2]) if axis == 0 else (fine[:, ::2], fine[:, 1::2])
        quarter = np.float32(0.25)
        fine = np.float32(0.5) * even + quarter * odd + quarter * np.roll(odd, 1, axis=axis)
    return fine


def double(coarse: Float32Array, shape: tuple[int, int]) -> Float32Array:
    """Interpolate a map up by two, bilinearly.

    Parameters
    ----------
    coarse : (h, w) float32
        The map; h, w as `halve` makes them.
    shape : tuple of int
        Height and width of the result.

    Returns
    -------
    shape float32
        Never outside the range of `coarse`.
    """
    rows = np.empty((shape[0], coarse.shape[1]), dtype=np.float32)
    _double(coarse, rows)
    fine = np.empty(shape, dtype=np.float32)
    _double(rows.T, fine.T)
    return fine


def _double(coarse: Float32Array, fine: Float32Array) -> None:
    between = fine[1::2]
    fine[::2] = coarse[: (len(fine) + 1) // 2]
    np.add(coarse[: len(between)], coarse[1 : len(between) + 1], out=between)
    between *= np.float32(0.5)
