"""Sensitivity of every channel at every pixel: velocity and luminance through the CSF (Fig. 6)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.metric.adaptation import AdaptingLight
from enfilade.metric.cortex import ORIENTATIONS_DEG, Band
from enfilade.metric.eye import EYE_DRIFT_DEG_S, channel_speed, smeared_share
from enfilade.metric.pyramid import halve

__all__ = ["FINEST_REDUCTION", "ChannelSensitivity", "SensitivityTable"]

Float32Array: TypeAlias = npt.NDArray[np.float32]
Float64Array: TypeAlias = npt.NDArray[np.float64]
IndexArray: TypeAlias = npt.NDArray[np.int32]
Csf: TypeAlias = Callable[[float, Float64Array, Float64Array], Float64Array]

FASTEST_DEG_S = 2000.0  # faster retinal motion is taken as this: nothing is seen any more
SPEEDS = 4096  # 0.23 % between speeds
SPEEDS_BY_LUMINANCE = 512  # 1.9 % between speeds, where luminance matters too
LUMINANCES = 128  # 13 % between luminances, of which sensitivity depends on a small power
LUMINANCE_RANGE_CD_M2 = (1e-3, 1e4)
FINEST_REDUCTION = 2  # velocity and light are taken from every second pixel, for speed
LEAST_SENSITIVITY = 1e-3  # contrast of 1000: never seen, and float32 powers stay normal


class SensitivityTable:
    """Sensitivity by retinal speed and luminance for every band, looked up on logarithmic scales.

    Parameters
    ----------
    csf : callable
        (frequency_cpd, velocities_deg_s, luminances_cd_m2) -> sensitivities, broadcast.
    bands : tuple of Band
        Bands of the Cortex transform.
    pixels_per_degree : float
        Turns their centres into cycles per degree.
    by_luminance : bool
        Whether the CSF depends on luminance.
    """

    def __init__(
        self, csf: Csf, bands: tuple[Band, ...], pixels_per_degree: float, *, by_luminance: bool = False
    ) -> None:
        self._pixels_per_degree = pixels_per_degree
        self._size = SPEEDS_BY_LUMINANCE if by_luminance else SPEEDS
        self._luminances = LUMINANCES if by_luminance else 1
        speeds = np.geomspace(EYE_DRIFT_DEG_S, FASTEST_DEG_S, self._size)
        luminances = np.geomspace(*LUMINANCE_RANGE_CD_M2, self._luminances)[:, None]
        rows = [csf(band.centre_cpp * pixels_per_degree, speeds, luminances) for band in bands]
        self._rows: list[Float32Array] = [
            np.maximum(row, LEAST_SENSITIVITY).astype(np.float32).ravel() for row in rows
        ]
        self._steps_per_e = (self._size - 1) / math.log(FASTEST_DEG_S / EYE_DRIFT_DEG_S)

    def index(self, speed_deg_s: Float32Array) -> IndexArray:
        """Nearest entries for retinal speeds in deg/s, which are 0.15 or more."""
        steps = np.log(speed_deg_s * np.float32(1.0 / EYE_DRIFT_DEG_S))
        steps *= np.float32(self._steps_per_e)
        steps += np.float32(0.5)
        np.clip(steps, 0, self._size - 1, out=steps)
        return np.asarray(steps, dtype=np.int32)

    def luminance_offset(self, luminance_cd_m2: Float32Array) -> IndexArray:
        """What to add to `index` for luminances in cd/m2, above 0."""
        if self._luminances == 1:
            return np.zeros((), dtype=np.int32)
        darkest, brightest = LUMINANCE_RANGE_CD_M2
        steps = np.log(luminance_cd_m2 * np.float32(1.0 / darkest))
        steps = steps * np.float32((self._luminances - 1) / math.log(brightest / darkest))
        steps = np.clip(steps + np.float32(0.5), 0, self._luminances - 1)
        return np.asarray(steps, dtype=np.int32) * self._size

    def frequency_cpd(self, band: Band) -> float:
        """Centre of a band, cycles per degree."""
        return band.centre_cpp * self._pixels_per_degree

    def row(self, band: Band) -> Float32Array:
        """Sensitivities of a band by entry; the first is that of a still eye."""
        return self._rows[band.level - 1]


class ChannelSensitivity:
    """Sensitivities of all channels, band after band, at the size of each.

    Speeds are averaged over the area of a coarse sample as magnitudes, after the projection on the
    channel's direction, so that motions to the left and to the right do not cancel.

    Parameters
    ----------
    table : SensitivityTable
        The CSF.
    velocities : sequence of (2, h, w) float32
        Retinal velocities at every second pixel, deg/s, one for each eye movement that may happen;
        the largest sensitivity counts. Empty when nothing moves.
    light : AdaptingLight, optional
        What the eye is adapted to; needed where the CSF depends on luminance.
    smears : sequence of (2, h, w) float32 or None
        How far a held frame smears for each of `velocities`, degrees; None where it does not. Empty
        for a display that flashes.
    """

    def __init__(
        self,
        table: SensitivityTable,
        velocities: Sequence[Float32Array],
        light: AdaptingLight | None = None,
        smears: Sequence[Float32Array | None] = (),
    ) -> None:
        self._table = table
        self._smears = smears or [None] * len(velocities)
        self._velocities = velocities
        self._light = light
        self._reduction = 0
        self._indices: dict[int | None, list[IndexArray]] = {}

    def _entries(self, orientation: int | None, reduction: int) -> list[IndexArray]:
        """Places in the table by speed and luminance, kept for the bands of one size."""
        if reduction != self._reduction:
            self._indices.clear()
            self._reduction = reduction
        if orientation not in self._indices:
            theta = None if orientation is None else ORIENTATIONS_DEG[orientation]
            offset = self._offset(reduction)
            found = []
            for velocity in self._velocities:
                speed = channel_speed(velocity, theta)
                for _ in range((reduction // FINEST_REDUCTION).bit_length() - 1):
                    speed = halve(speed)
                index = self._table.index(speed)
                index += offset
                found.append(index)
            self._indices[orientation] = found
        return self._indices[orientation]

    def map(self, band: Band, orientation: int | None) -> Float32Array:
        """Sensitivity of a channel; ask for all of one size together.

        Parameters
        ----------
        band : Band
            The channel's band.
        orientation : int or None
            Index into ORIENTATIONS_DEG; None for the base band.

        Returns
        -------
        () or (h, w) float32
            A single number when nothing moves and the light is even, else a map at the size of
            `reduction`.
        """
        if self.is_still:
            return self.still(band)
        row = self._table.row(band)
        indices = self._entries(orientation, self.reduction(band))
        maps = [row.take(index) for index in indices]
        for found, smear in zip(maps, self._smears, strict=True):
            if smear is not None:
                np.multiply(found, self._smeared(smear, band, orientation), out=found)
        first, *others = maps
        for other in others:
            np.maximum(first, other, out=first)
        return first

    def _smeared(self, smear: Float32Array, band: Band, orientation: int | None) -> Float32Array:
        theta = None if orientation is None else ORIENTATIONS_DEG[orientation]
        share = smeared_share(smear, theta, self._table.frequency_cpd(band))
        for _ in range((self.reduction(band) // FINEST_REDUCTION).bit_length() - 1):
            share = halve(share)
        return share

    @property
    def is_still(self) -> bool:
        """Whether nothing moves, so that all orientations are alike."""
        return not self._velocities

    def still(self, band: Band) -> Float32Array:
        """Sensitivity of an eye that rests, shaped as `map`."""
        return np.asarray(self._table.row(band)[self._offset(self.reduction(band))])

    @staticmethod
    def reduction(band: Band) -> int:
        """How coarse the maps of a band are: at every second pixel in the finest bands too."""
        return max(band.reduction, FINEST_REDUCTION)

    def _offset(self, reduction: int) -> IndexArray:
        if self._light is None:
            return np.zeros((), dtype=np.int32)
        return self._light.offset(self._table.luminance_offset, reduction)
