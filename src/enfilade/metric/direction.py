"""Motion-direction correction: sensitivity by the direction that contrast has within its channel.

A channel passes frequency vectors up to 30 degrees to either side of its centre. Motion blurs a pattern by
its frequency along the motion, and the channel's centre is a poor estimate of that: half way between two
channels, at 45 degrees, it is 0.71 of the whole, where the two centres give 0.87 and 0.5. The squares of
the fans sum to one, so the energies of two neighbouring channels determine the direction.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enfilade.metric.aperture import Aperture, averaged
from enfilade.metric.cortex import FAN_HALF_WIDTH_DEG, ORIENTATIONS_DEG, Band
from enfilade.metric.pyramid import double
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
    """Integrated energies of one band, weighted by the sensitivity in the direction of its differences.

    The direction is that of the difference under the aperture. The sensitivity in that direction is taken
    at the velocity and luminance of every sample, before the integration: so no energy exceeds that of the
    sample's contrast at the sample's sensitivity, and an object at rest before a moving background keeps
    its own.

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
        # Maps are kept as coarse as velocities, and at the aperture's size at most.
        self._reduction = max(band.reduction, min(FINEST_REDUCTION, aperture.reduction))
        self._differences: list[F32] = []
        self._maps: list[list[F32]] = []

    def accumulate(self, difference: F32, energies: Sequence[F32]) -> None:
        """Add the next orientation: the contrast (h, w) of its difference, and maps of its energies."""
        thinned = _resampled(difference, self._band.reduction, self._reduction)
        self._differences.append(self._aperture.coarse(np.square(thinned), self._reduction))
        self._maps.append([averaged(energy, self._band.reduction, self._reduction) for energy in energies])

    def integrated(self) -> F32:
        """Energies in units of the threshold's, integrated, (n, 6, h', w') float32 of n maps."""
        differences = self._aperture.integrate(np.stack(self._differences), self._reduction)
        velocity = np.stack([self._sampled(plane, FINEST_REDUCTION) for plane in self._velocity])
        directions = (
            self._sampled(theta, self._aperture.reduction) for theta in channel_directions(differences)
        )
        weights = self._sensitivity.towards(self._band, velocity, directions, self._reduction)
        found = np.empty((len(self._maps[0]), len(self._maps), *self._aperture.shape), dtype=np.float32)
        for index, (weight, maps) in enumerate(zip(weights, self._maps, strict=True)):
            power = np.square(weight)
            found[:, index] = [self._aperture.coarse(power * energy, self._reduction) for energy in maps]
        return self._aperture.integrate(found, self._band.reduction)

    def _sampled(self, plane: F32, reduction: int) -> F32:
        """A map at every `reduction`-th pixel at the samples of energies."""
        return _sized(_resampled(plane, reduction, self._reduction), self._maps[0][0].shape)


def _centres(dimensions: int) -> F32:
    """ORIENTATIONS_DEG, along the first of so many axes."""
    return np.array(ORIENTATIONS_DEG, dtype=np.float32).reshape(-1, *(1,) * (dimensions - 1))


def _resampled(samples: F32, reduction: int, wanted: int) -> F32:
    """A map at every `reduction`-th pixel at every `wanted`-th: thinned, or interpolated."""
    if wanted >= reduction:
        return samples[:: wanted // reduction, :: wanted // reduction]
    while reduction > wanted:
        reduction //= 2
        samples = double(samples, (2 * samples.shape[0] - 1, 2 * samples.shape[1] - 1))
    return samples


def _sized(samples: F32, shape: tuple[int, ...]) -> F32:
    """Samples of a map of a shape, the last repeated where that has more."""
    if samples.shape == shape:
        return samples
    missing = [(0, max(wanted - has, 0)) for has, wanted in zip(samples.shape, shape, strict=True)]
    return np.pad(samples, missing, mode="edge")[: shape[0], : shape[1]]
