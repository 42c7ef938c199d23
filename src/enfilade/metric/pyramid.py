"""Maps at half and double size; coarse samples stand on every second pixel of the finer map."""

from __future__ import annotations

import numpy as np

from enfilade.records import F32


def halved_shape(shape: tuple[int, int], reduction: int) -> tuple[int, int]:
    """Height and width in samples at every `reduction`-th pixel, the last at or beyond the last pixel."""
    height, width = shape
    return -(-(height - 1) // reduction) + 1, -(-(width - 1) // reduction) + 1


def halve(fine: F32) -> F32:
    """Average a map down by two, weights 1/4, 1/2, 1/4 around every second pixel.

    Parameters
    ----------
    fine : (H, W) float32
        The map, repeated beyond its borders.

    Returns
    -------
    (H // 2 + 1, W // 2 + 1) float32
    """
    height, width = halved_shape(fine.shape, 2)
    padded = np.pad(fine, (1, 2), mode="edge")
    two, quarter = np.float32(2.0), np.float32(0.25)
    rows = two * padded[1::2][:height] + padded[2::2][:height] + padded[::2][:height]
    rows *= quarter
    coarse: F32 = two * rows[:, 1::2][:, :width] + rows[:, 2::2][:, :width] + rows[:, ::2][:, :width]
    coarse *= quarter
    return coarse


def double(coarse: F32, shape: tuple[int, int]) -> F32:
    """Interpolate a map up by two, bilinearly, to a height and width; the inverse of `halve` in size."""
    rows = np.empty((shape[0], coarse.shape[1]), dtype=np.float32)
    _double_rows(coarse, rows)
    fine = np.empty(shape, dtype=np.float32)
    _double_rows(rows.T, fine.T)
    return fine


def _double_rows(coarse: F32, fine: F32) -> None:
    between = fine[1::2]
    fine[::2] = coarse[: (len(fine) + 1) // 2]
    np.add(coarse[: len(between)], coarse[1 : len(between) + 1], out=between)
    between *= np.float32(0.5)


class Pyramid:
    """A map at the size of each band; levels are computed on first use and kept.

    Parameters
    ----------
    values : () or (H, W) float32
        A constant or a map.
    """

    def __init__(self, values: F32) -> None:
        self._maps: dict[int, F32] = {1: values}

    def at(self, reduction: int) -> F32:
        """The map at every `reduction`-th pixel."""
        if reduction not in self._maps:
            finer = self.at(reduction // 2)
            self._maps[reduction] = halve(finer) if finer.ndim else finer
        return self._maps[reduction]
