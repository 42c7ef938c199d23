"""Sensitivity where energies are gathered: to what stands, and by the direction of what moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.metric.adaptation import AdaptingLight
from enfilade.metric.cortex import ORIENTATIONS_DEG, Band
from enfilade.metric.direction import channel_directions
from enfilade.metric.eye import Pursuit, channel_speed, held_smear, retinal_velocity, smeared_share
from enfilade.metric.pyramid import halved_shape
from enfilade.metric.sensitivity import FINEST_REDUCTION, SensitivityTable
from enfilade.metric.spatial import Aperture

__all__ = ["BandWeight", "FixedWeight", "Turning"]

Float32Array: TypeAlias = npt.NDArray[np.float32]

FAINTEST = 1e-30  # keeps means finite where there is no error


class BandWeight(Protocol):
    """What gathered energies of one band are multiplied by."""

    def look(self, difference: Float32Array) -> None:
        """Look at the difference of a channel before sensitivity, at the band's size."""
        ...

    def note(self, error: Float32Array, step: int = 1) -> None:
        """Look at the energy of the same difference in units of the threshold's, before it is gathered.

        It is given at every `step`-th sample of the band, `step` being at most `samples_apart`.
        """
        ...

    @property
    def samples_apart(self) -> int:
        """How far apart the samples are that count, in samples of the band."""
        ...

    def power(self) -> Float32Array:
        """By how much to multiply gathered energies, broadcasting to (n, h', w')."""
        ...


@dataclass(frozen=True, eq=False)
class FixedWeight:
    """A weight of contrast that is the same for all channels of a band.

    Attributes
    ----------
    weight : () or (h', w') float32
        On the aperture's grid; energies take its square.
    """

    weight: Float32Array

    def look(self, difference: Float32Array) -> None:
        """Nothing to look at."""

    def note(self, error: Float32Array, step: int = 1) -> None:
        """Nothing to look at."""

    @property
    def samples_apart(self) -> int:
        """One."""
        return 1

    def power(self) -> Float32Array:
        """The square of the weight."""
        return np.square(self.weight)


@dataclass(frozen=True, eq=False)
class Turning:
    """Corrects sensitivities for the directions that errors have within their channels.

    Each channel was weighed by the sensitivity in the direction of its centre, pixel by pixel. Its
    energies under the aperture are multiplied by the square of what the sensitivity in their own
    direction is to that. The velocity is the mean of those under the aperture, weighed by the errors that
    are seen, so that what stands before a background in motion keeps its own.

    Attributes
    ----------
    table : SensitivityTable
        The CSF.
    aperture : Aperture
        The grid.
    light : AdaptingLight
        What the eye is adapted to.
    velocity : (2, h, w) float32
        Image velocity at every second pixel, deg/s.
    movements : sequence of Pursuit
        Eye movements that may happen; the most sensitive counts.
    hold_s : float
        How long a frame is held, seconds; 0 for a display that flashes.
    """

    table: SensitivityTable
    aperture: Aperture
    light: AdaptingLight
    velocity: Float32Array
    movements: Sequence[Pursuit]
    hold_s: float

    def of(self, band: Band) -> BandWeight:
        """The weight of a band that has orientations; look at all its channels, in their order."""
        return _Turned(self, band)

    def sensitivity(self, band: Band, velocity: Float32Array, theta_deg: Float32Array) -> Float32Array:
        """Sensitivity to what moves at (2, h', w') deg/s in directions (n, h', w'), (n, h', w')."""
        row, rho = self.table.row(band), self.table.frequency_cpd(band)
        offset = self.light.offset(self.table.luminance_offset, self.aperture.reduction)
        best = np.zeros((), dtype=np.float32)
        for eye in self.movements:
            index = self.table.index(channel_speed(retinal_velocity(velocity, eye), theta_deg))
            found = row.take(index + offset)
            smear = held_smear(velocity, eye, self.hold_s) if self.hold_s else None
            if smear is not None:
                found *= smeared_share(smear, theta_deg, rho)
            best = np.maximum(best, found)
        return best


class _Turned:
    def __init__(self, of: Turning, band: Band) -> None:
        self._of = of
        self._band = band
        self._step = max(
            FINEST_REDUCTION // band.reduction, 1
        )  # energies are looked at as coarsely as velocity
        self._reduction = self._step * band.reduction
        self._seen: list[Float32Array] = []
        self._errors = np.zeros((), dtype=np.float32)

    def look(self, difference: Float32Array) -> None:
        """Keep the energy of a channel, of which the share of its neighbours tells the direction."""
        energy = np.square(self._thinned(difference))
        self._seen.append(self._of.aperture.coarse(energy, self._reduction))

    def note(self, error: Float32Array, step: int = 1) -> None:
        """Add to the errors by which velocities are weighed."""
        self._errors = self._errors + (self._thinned(error) if step == 1 else error)

    @property
    def samples_apart(self) -> int:
        """Two in fine bands: errors are looked at as coarsely as velocity."""
        return self._step

    def _thinned(self, channel: Float32Array) -> Float32Array:
        shape = halved_shape(channel.shape, self._step)
        return _sized(channel[:: self._step, :: self._step], shape)

    def power(self) -> Float32Array:
        """Squares of the ratios of sensitivities, (6, h', w')."""
        aperture = self._of.aperture
        centres = np.array(ORIENTATIONS_DEG, dtype=np.float32)[:, None, None]
        directions = channel_directions(aperture.gather(np.stack(self._seen), self._reduction))
        velocity = self._mean_velocity()
        ratio = self._of.sensitivity(self._band, velocity, directions)
        ratio /= np.maximum(self._of.sensitivity(self._band, velocity, centres), np.float32(FAINTEST))
        return np.square(ratio, out=ratio)

    def _mean_velocity(self) -> Float32Array:
        """Mean velocity under the aperture, weighed by errors, (2, h', w')."""
        step = self._reduction // FINEST_REDUCTION
        weight = self._errors + np.float32(FAINTEST)
        planes = (weight, *(weight * _sized(p[::step, ::step], weight.shape) for p in self._of.velocity))
        aperture = self._of.aperture
        on_grid = np.stack([aperture.coarse(part, self._reduction) for part in planes])
        share, across, down = aperture.gather(on_grid, self._reduction)
        share = np.maximum(share, np.float32(FAINTEST))
        return np.stack((across / share, down / share))


def _sized(samples: Float32Array, shape: tuple[int, int]) -> Float32Array:
    """Samples of a map, the last repeated where the grid goes on by one."""
    if samples.shape == shape:
        return samples
    missing = [(0, max(wanted - has, 0)) for has, wanted in zip(samples.shape, shape, strict=True)]
    return np.pad(samples, missing, mode="edge")[: shape[0], : shape[1]]
