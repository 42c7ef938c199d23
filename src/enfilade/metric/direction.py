"""Motion-direction correction: sensitivity by the direction that contrast has within its channel.

A channel passes frequency vectors up to 30 degrees to either side of its centre. Motion blurs a pattern by
its frequency along the motion, and the channel's centre is a poor estimate of that: half way between two
channels, at 45 degrees, it is 0.71 of the whole, where the two centres give 0.87 and 0.5. The squares of
the fans sum to one, so the energies of two neighbouring channels determine the direction.
"""

from __future__ import annotations

import numpy as np

from enfilade.metric.aperture import Aperture
from enfilade.metric.cortex import FAN_HALF_WIDTH_DEG, ORIENTATIONS_DEG, Band
from enfilade.metric.pyramid import halved_shape
from enfilade.metric.sensitivity import FINEST_REDUCTION, ChannelSensitivity
from enfilade.records import F32

FAINTEST = 1e-30  # keeps ratios finite where there is no contrast


def channel_directions(energies: F32) -> F32:
    """Direction of the frequency vector of the contrast in each channel of a band, (6, ...) degrees.

    Exact for a single direction; the channel's centre where both neighbours have equal energy, as in noise.
    Energies are 0 or more, in the order of ORIENTATIONS_DEG, averaged over more than a period.
    """
    before, after = np.roll(energies, 1, axis=0), np.roll(energies, -1, axis=0)
    total = energies + before + after
    excess = (after - before) / np.maximum(total, np.float32(FAINTEST))
    # Invert the squared fan, sin^2(pi/2 w), and its window w.
    window = np.float32(2.0 / np.pi) * np.arcsin(np.sqrt(np.abs(excess)))
    away = np.arccos(np.maximum(1.0 - 2.0 * window, -1.0)) * np.float32(FAN_HALF_WIDTH_DEG / np.pi)
    directions: F32 = _centres(energies.ndim) + np.copysign(away, excess)
    return directions


class MotionDirection:
    """Correction of the integrated energies of one band, accumulated channel by channel.

    Each channel was weighted by the sensitivity in the direction of its centre, pixel by pixel. The
    correction is the squared ratio of the sensitivity in the direction of the differences to that. The
    velocity is the mean under the aperture, weighted by visible differences, so that an object at rest
    before a moving background keeps its own.

    Parameters
    ----------
    sensitivity : ChannelSensitivity
        Of the pair of images.
    velocity : (2, h, w) float32
        Image velocity at every second pixel, deg/s.
    aperture : Aperture
    band : Band
        Any but the base.
    """

    def __init__(
        self, sensitivity: ChannelSensitivity, velocity: F32, aperture: Aperture, band: Band
    ) -> None:
        self._sensitivity, self._velocity = sensitivity, velocity
        self._aperture, self._band = aperture, band
        self._step = max(FINEST_REDUCTION // band.reduction, 1)  # as coarse as velocities
        self._reduction = self._step * band.reduction
        self._energies: list[F32] = []
        self._visible = np.zeros((), dtype=np.float32)

    def accumulate(self, difference: F32, visible: F32) -> None:
        """Add the next orientation: its difference (h, w), and its energy in units of the threshold's."""
        energy = np.square(self._thinned(difference))
        self._energies.append(self._aperture.coarse(energy, self._reduction))
        self._visible = self._visible + self._thinned(visible)

    def correction(self) -> F32:
        """Factors on integrated energies, (6, h', w') float32."""
        energies = self._aperture.integrate(np.stack(self._energies), self._reduction)
        directions, velocity = channel_directions(energies), self._mean_velocity()
        own, centre = (
            self._sensitivity.towards(self._band, velocity, theta, self._aperture.reduction)
            for theta in (directions, _centres(3))
        )
        own /= np.maximum(centre, np.float32(FAINTEST))
        return np.square(own, out=own)

    def _mean_velocity(self) -> F32:
        """Mean velocity under the aperture, weighted by visible differences, (2, h', w')."""
        step = self._reduction // FINEST_REDUCTION
        weight = self._visible + np.float32(FAINTEST)
        velocity = (_sized(plane[::step, ::step], weight.shape) for plane in self._velocity)
        planes = (weight, *(weight * plane for plane in velocity))
        on_grid = np.stack([self._aperture.coarse(plane, self._reduction) for plane in planes])
        total, across, down = self._aperture.integrate(on_grid, self._reduction)
        total = np.maximum(total, np.float32(FAINTEST))
        return np.stack((across / total, down / total))

    def _thinned(self, channel: F32) -> F32:
        shape = halved_shape(channel.shape, self._step)
        return _sized(channel[:: self._step, :: self._step], shape)


def _centres(dimensions: int) -> F32:
    """ORIENTATIONS_DEG, along the first of so many axes."""
    return np.array(ORIENTATIONS_DEG, dtype=np.float32).reshape(-1, *(1,) * (dimensions - 1))


def _sized(samples: F32, shape: tuple[int, ...]) -> F32:
    """Samples of a map, the last repeated where the grid has one more."""
    if samples.shape == shape:
        return samples
    missing = [(0, max(wanted - has, 0)) for has, wanted in zip(samples.shape, shape, strict=True)]
    return np.pad(samples, missing, mode="edge")[: shape[0], : shape[1]]
