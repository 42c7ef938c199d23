"""Sensitivity of every channel at every pixel, by retinal velocity and luminance (Fig. 6)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.ndimage

from enfilade.metric.cortex import ORIENTATIONS_DEG, Band
from enfilade.metric.eye import (
    EYE_DRIFT_DEG_S,
    channel_speed,
    held_smear,
    retinal_velocity,
    smeared_contrast,
)
from enfilade.metric.pyramid import Pyramid, double, halve, halved_shape
from enfilade.records import F32, F64, Mask
from enfilade.settings import Pursuit

Indices: TypeAlias = npt.NDArray[np.int32]

FASTEST_DEG_S = 2000.0  # faster retinal motion is clipped to this: nothing is seen any more
SPEEDS = 4096  # 0.23 % between speeds
SPEEDS_BY_LUMINANCE = 512  # 1.9 % between speeds, in a table by luminance
LUMINANCES = 128  # 13 % between luminances, of which sensitivity depends on a small power
LUMINANCE_RANGE_CD_M2 = (1e-3, 1e4)
FINEST_REDUCTION = 2  # velocity and luminance are sampled at every second pixel, for speed
LEAST_SENSITIVITY = 1e-3  # contrast of 1000: never seen, and float32 powers stay normal


class SensitivityTable:
    """Sensitivity of every band by retinal speed and luminance, sampled on logarithmic scales.

    Parameters
    ----------
    csf : callable
        (frequency_cpd, velocities_deg_s, luminances_cd_m2) -> sensitivities, broadcast.
    bands : tuple of Band
    pixels_per_degree : float
    by_luminance : bool
        Whether the CSF depends on luminance.
    """

    def __init__(
        self,
        csf: Callable[[float, F64, F64], F64],
        bands: tuple[Band, ...],
        pixels_per_degree: float,
        *,
        by_luminance: bool = False,
    ) -> None:
        self._pixels_per_degree = pixels_per_degree
        self._size = SPEEDS_BY_LUMINANCE if by_luminance else SPEEDS
        self._luminances = LUMINANCES if by_luminance else 1
        self._steps_per_e = (self._size - 1) / math.log(FASTEST_DEG_S / EYE_DRIFT_DEG_S)
        speeds = np.geomspace(EYE_DRIFT_DEG_S, FASTEST_DEG_S, self._size)
        luminances = np.geomspace(*LUMINANCE_RANGE_CD_M2, self._luminances)[:, None]
        self._rows: list[F32] = []
        for band in bands:
            row = csf(self.frequency_cpd(band), speeds, luminances)
            self._rows.append(np.maximum(row, LEAST_SENSITIVITY).astype(np.float32).ravel())

    def speed_index(self, speed_deg_s: F32) -> Indices:
        """Nearest entries for retinal speeds in deg/s, which are 0.15 or more."""
        steps = np.log(speed_deg_s * np.float32(1.0 / EYE_DRIFT_DEG_S))
        steps *= np.float32(self._steps_per_e)
        steps += np.float32(0.5)
        np.clip(steps, 0, self._size - 1, out=steps)
        return np.asarray(steps, dtype=np.int32)

    def luminance_index(self, luminance_cd_m2: F32) -> Indices:
        """Summand of `speed_index` for luminances in cd/m2, above 0."""
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

    def row(self, band: Band) -> F32:
        """Sensitivities of a band by the sum of both indices; at speed index 0 that of an eye at rest."""
        return self._rows[band.level - 1]


class ChannelSensitivity:
    """Weights of all channels for one pair of images: sensitivity times contrast of a unit response.

    Speeds are averaged over the area of a coarse sample as magnitudes, after the projection on the
    channel's direction, so that motions to the left and to the right do not cancel; but for
    :meth:`towards`.

    Parameters
    ----------
    table : SensitivityTable
        The CSF.
    image_shape : tuple of int
        Height and width, pixels.
    adapting, contrast : Pyramid
        Adapting luminance, cd/m2, and contrast of a response of one.
    velocity : (2, h, w) float32 or None
        Image velocity at every second pixel (`coarse_velocity`), deg/s; None where nothing moves.
    eyes : sequence of Pursuit
        Eye movements that may happen; the largest sensitivity counts.
    hold_s : float
        Time for which a frame is lit, seconds; 0 for a display that flashes.
    """

    def __init__(
        self,
        table: SensitivityTable,
        image_shape: tuple[int, int],
        *,
        adapting: Pyramid,
        contrast: Pyramid,
        velocity: F32 | None,
        eyes: Sequence[Pursuit],
        hold_s: float = 0.0,
    ) -> None:
        self._is_still = velocity is None
        self._table, self._image_shape = table, image_shape
        self._adapting, self._contrast = adapting, contrast
        self._eyes, self._hold_s = eyes, hold_s
        self._motions = [] if velocity is None else [self._motion(velocity, eye) for eye in eyes]
        self._reduction = 0
        self._speeds: dict[int | None, list[Indices]] = {}
        self._luminances: dict[int, Indices] = {}

    def weights(self, band: Band) -> Iterator[F32]:
        """Weight of every channel of a band, () or (h, w) float32 at the band's size."""
        if self._is_still:
            yield from [self.at_rest(band)] * len(band.orientations)
            return
        for orientation in band.orientations:
            yield self._weight(self._moving(band, orientation), band)

    def at_rest(self, band: Band) -> F32:
        """Weight of patterns at rest on the retina."""
        return self._weight(self._table.row(band)[self._luminance(_reduction(band))], band)

    def contrast(self, band: Band) -> F32:
        """Contrast of a response of one, () or (h, w) float32 at the band's size."""
        return self._contrast.at(band.reduction)

    def towards(self, band: Band, velocity: F32, thetas_deg: Iterable[F32], reduction: int) -> Iterator[F32]:
        """Sensitivity to patterns of each of several maps of directions, (h, w) degrees, at a reduced size.

        They move at `velocity`, (2, h, w) deg/s: one sample for each of the reduced size, not a mean. Of the
        samples the last row or column may be missing.
        """
        row, rho = self._table.row(band), self._table.frequency_cpd(band)
        rows, columns = velocity.shape[1:]
        luminance = self._luminance(reduction)[:rows, :columns]
        motions = [self._motion(velocity, eye) for eye in self._eyes]
        for theta in thetas_deg:
            best = np.zeros((), dtype=np.float32)
            for moved, smear in motions:
                found = row.take(self._table.speed_index(channel_speed(moved, theta)) + luminance)
                if smear is not None:
                    found *= smeared_contrast(smear, theta, rho)
                best = np.maximum(best, found)
            yield best

    def _motion(self, velocity: F32, eye: Pursuit) -> tuple[F32, F32 | None]:
        return retinal_velocity(velocity, eye), held_smear(velocity, eye, self._hold_s)

    def _moving(self, band: Band, orientation: int | None) -> F32:
        """Sensitivity of a channel to moving patterns, the largest over eye movements."""
        theta = None if orientation is None else ORIENTATIONS_DEG[orientation]
        row, rho, reduction = self._table.row(band), self._table.frequency_cpd(band), _reduction(band)
        best = np.zeros((), dtype=np.float32)
        for index, (_, smear) in zip(self._indices(orientation, reduction), self._motions, strict=True):
            found = row.take(index)
            if smear is not None:
                found *= _reduced(smeared_contrast(smear, theta, rho), reduction)
            best = np.maximum(best, found)
        return best

    def _indices(self, orientation: int | None, reduction: int) -> list[Indices]:
        """Table entries by speed and luminance for each eye movement, kept for the bands of one size."""
        if reduction != self._reduction:
            self._speeds.clear()
            self._reduction = reduction
        if orientation not in self._speeds:
            theta = None if orientation is None else ORIENTATIONS_DEG[orientation]
            speeds = (_reduced(channel_speed(moved, theta), reduction) for moved, _ in self._motions)
            self._speeds[orientation] = [
                self._table.speed_index(speed) + self._luminance(reduction) for speed in speeds
            ]
        return self._speeds[orientation]

    def _luminance(self, reduction: int) -> Indices:
        if reduction not in self._luminances:
            self._luminances[reduction] = self._table.luminance_index(self._adapting.at(reduction))
        return self._luminances[reduction]

    def _weight(self, sensitivity: F32, band: Band) -> F32:
        """Weights at the band's own size; sensitivities of the finest bands come at half of it."""
        weight = np.asarray(sensitivity * self._contrast.at(_reduction(band)))
        if weight.ndim and band.reduction < FINEST_REDUCTION:
            return double(weight, halved_shape(self._image_shape, band.reduction))
        return weight


def coarse_velocity(velocity_deg_s: F32, valid: Mask) -> F32:
    """Velocity at every second pixel, (H, W, 2) -> (2, h, w) float32; where invalid the nearest valid one.

    Weights are interpolated between these samples: at rest, those of invalid pixels would be too large beside
    moving ones.
    """
    rows, columns = (
        np.minimum(FINEST_REDUCTION * np.arange(samples), pixels - 1)
        for samples, pixels in zip(halved_shape(valid.shape, FINEST_REDUCTION), valid.shape, strict=True)
    )
    here = np.ix_(rows, columns)
    is_missing = ~valid[here]
    velocity = np.moveaxis(velocity_deg_s[here], -1, 0)
    if is_missing.all():
        return np.zeros_like(velocity)
    if is_missing.any():
        nearest = scipy.ndimage.distance_transform_edt(
            is_missing, return_distances=False, return_indices=True
        )
        velocity = velocity[:, *nearest]
    return np.ascontiguousarray(velocity)


def _reduction(band: Band) -> int:
    return max(band.reduction, FINEST_REDUCTION)


def _reduced(values: F32, reduction: int) -> F32:
    """Reduce a map at every second pixel to every `reduction`-th."""
    for _ in range((reduction // FINEST_REDUCTION).bit_length() - 1):
        values = halve(values)
    return values
