"""Monte Carlo noise in the images compared: how much of a difference it explains.

The metric compares images that are path traced with few samples, so that part of their difference
is noise. Its variance is known for every pixel, and it follows through the chain by linear
propagation: a channel's response to independent noise has the variance

    sigma_kl^2 = (h_kl^2 * (R'^2 Var))    (a convolution with the filter's squared impulse response)

which is taken apart into the filter's noise gain G_kl = sum h_kl^2 and a local average of the
variance over the band's reach, q_k = sum_l h_kl^2 / sum_l G_kl (the mean over orientations):

    sigma_kl^2 = G_kl (q_k * (R'^2 Var)).

A channel's difference then counts only as far as it exceeds NOISE_SIGMAS standard deviations
(soft threshold), max(abs(C' - C'') - 4 sigma_kl, 0): a difference that noise of that size explains
is not counted, and of a larger one the part that noise may have added is taken off. Three standard
deviations would leave 0.3 % of the samples in each of up to 31 channels; four leave 0.006 %.

Images that were filtered by a Gaussian since have less noise in their fine channels, and less of any
difference: given the Gaussian's deviation at each pixel, a channel's noise is taken to pass as much as
that filter leaves of white noise in the channel's ring.

What it does not do: noise that is otherwise correlated between neighbouring pixels (after bilinear
resampling, splatting or a denoiser) has more power at low and less at high frequencies than its
variance says, so that low bands may still count it; give such images the variance they had before,
or larger. Fireflies are not Gaussian, and exceed four of their (badly known) standard deviations
more often. Noise remains a mask for the viewer: thresholds are elevated by the images as they are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.fft

from enfilade.metric.amplitude import response
from enfilade.metric.cortex import Band, CortexTransform
from enfilade.metric.pyramid import halve_periodic

__all__ = ["NOISE_SIGMAS", "ChannelNoise", "Noise", "NoiseFilters", "response_noise"]

Float32Array: TypeAlias = npt.NDArray[np.float32]
Complex64Array: TypeAlias = npt.NDArray[np.complex64]

NOISE_SIGMAS = 4.0  # no unit: our choice, see above
LEAST_DEVIATION_CD_M2 = 1e-4  # keeps the slope finite where there is no noise
BLUR_SIGMAS = 3.0  # the Gaussian filter ends after so many standard deviations to either side ...
BLUR_STEPS = 12  # ... and is tabulated at so many widths a pixel


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise in the difference of two images.

    Attributes
    ----------
    variance : (H, W) float32
        (cd/m2)^2, before the images were filtered.
    blur_px : (H, W) float32 or None
        Standard deviation of the Gaussian that filtered both since, pixels.
    """

    variance: Float32Array
    blur_px: Float32Array | None = None


def response_noise(mean_cd_m2: Float32Array, variance: Float32Array) -> Float32Array:
    """Noise variance after the amplitude nonlinearity.

    Var_R = slope^2 Var, slope = (R(L + s) - R(max(L - s, 0))) / (2 s): the local slope of R over
    the range s = sqrt(Var / 2) of one image's noise. The derivative itself is infinite at black.

    Parameters
    ----------
    mean_cd_m2 : (H, W) float32
        Mean L of the two images, cd/m2, 0 or more.
    variance : (H, W) float32
        Of the noise in the difference of the two images, (cd/m2)^2.

    Returns
    -------
    (H, W) float32
        Variance of the noise in the difference of the two responses.
    """
    deviation = np.sqrt(np.float32(0.5) * variance)
    reach = np.maximum(deviation, np.float32(LEAST_DEVIATION_CD_M2))
    above = response(mean_cd_m2 + reach)
    below = response(np.maximum(mean_cd_m2 - reach, np.float32(0.0)))
    slope: Float32Array = (above - below) / (np.float32(2.0) * reach)
    return variance * slope * slope


class NoiseFilters:
    """Noise gain and reach of every channel filter, for one Cortex transform.

    Parameters
    ----------
    cortex : CortexTransform
        The filters; the set-up runs an impulse through all of them.
    """

    def __init__(self, cortex: CortexTransform) -> None:
        self.cortex = cortex
        self._gains: dict[tuple[int, int | None], float] = {}
        self._reaches: dict[int, Float32Array] = {}
        impulse = np.zeros((1, cortex.height_px, cortex.width_px), dtype=np.float32)
        impulse[0, 0, 0] = 1.0
        spectrum = cortex.spectra(impulse)
        for band in cortex.bands:
            ring = cortex.ring(spectrum, band)
            energies = [
                np.square(cortex.fan(ring, band, orientation)[0]) for orientation in cortex.orientations(band)
            ]
            for orientation, energy in zip(cortex.orientations(band), energies, strict=True):
                # A coarse band samples the impulse response at every reduction-th pixel.
                gain = float(energy.sum(dtype=np.float64)) * band.reduction**2
                self._gains[band.level, orientation] = gain
            kernel = sum(energies[1:], start=energies[0])
            kernel /= np.float32(kernel.sum(dtype=np.float64))
            self._reaches[band.level] = cortex.spectra(kernel[None])[0].real.copy()

    def passing(self, band: Band, blur_px: Float32Array) -> Float32Array:
        """Share of the variance of a band's white noise that Gaussians of these deviations leave."""
        widths = np.arange(math.ceil(float(blur_px.max()) * BLUR_STEPS) + 1) / BLUR_STEPS
        spectrum = np.ones((1, self.cortex.height_px, self.cortex.width_px // 2 + 1), np.complex64)
        power = np.square(np.abs(self.cortex.ring(spectrum, band)[0]))
        power[:, 1:] *= np.float32(2.0)  # the other half of the spectrum
        rows, columns = power.shape
        down = _gaussian_response(np.fft.fftfreq(rows) / band.reduction, widths)
        across = _gaussian_response(np.fft.rfftfreq(self.cortex.width_px)[:columns], widths)
        left = np.einsum("kr,rc,kc->k", np.square(down), power, np.square(across), optimize=True)
        passing: Float32Array = np.interp(blur_px, widths, left / left[0]).astype(np.float32)
        return passing

    def gain(self, band: Band, orientation: int | None) -> float:
        """Variance of a channel's response to white noise of variance one."""
        return self._gains[band.level, orientation]

    def average(self, spectrum: Complex64Array, band: Band) -> Float32Array:
        """Local average q_k of a map at a band's size, from the map's spectrum."""
        size = self.cortex.reduced_shape(band)
        averaged = scipy.fft.irfft2(spectrum * self._reaches[band.level], s=size)
        return np.maximum(averaged, np.float32(0.0))


class ChannelNoise:
    """Standard deviation of the noise in every channel's difference, for one pair of images.

    Parameters
    ----------
    filters : NoiseFilters
        Of the Cortex transform.
    variance : (padded height, padded width) float32
        Noise variance in the difference of the responses (`response_noise`), padded.
    blur_px : (padded height, padded width) float32 or None
        Of the Gaussian that filtered the images since, padded.
    """

    def __init__(
        self, filters: NoiseFilters, variance: Float32Array, blur_px: Float32Array | None = None
    ) -> None:
        self._filters = filters
        self._averages: dict[int, Float32Array] = {}
        reduction = 1
        spectrum = filters.cortex.spectra(variance)
        for band in filters.cortex.bands:
            if band.reduction != reduction:
                while reduction < band.reduction:
                    variance = halve_periodic(variance)
                    blur_px = None if blur_px is None else halve_periodic(blur_px)
                    reduction *= 2
                spectrum = filters.cortex.spectra(variance)
            if blur_px is not None:
                spectrum = filters.cortex.spectra(variance * filters.passing(band, blur_px))
            self._averages[band.level] = np.sqrt(filters.average(spectrum, band))

    def deviation(self, band: Band, orientation: int | None) -> Float32Array:
        """Standard deviation sigma_kl, a map at the band's padded reduced size."""
        return self._averages[band.level] * np.float32(self._filters.gain(band, orientation) ** 0.5)


def _gaussian_response(
    frequency_cpp: npt.NDArray[np.floating], widths_px: npt.NDArray[np.floating]
) -> npt.NDArray[np.floating]:
    """Transfer of Gaussians with taps at whole pixels, (widths, frequencies)."""
    reach = np.floor(BLUR_SIGMAS * widths_px)
    taps = np.arange(int(reach.max()) + 1)
    weights = np.exp(-0.5 * np.square(taps / np.maximum(widths_px[:, None], 1e-9)))
    weights *= (taps <= reach[:, None]) * np.where(taps > 0, 2.0, 1.0)
    weights /= weights.sum(axis=1, keepdims=True)
    transfer: npt.NDArray[np.floating] = weights @ np.cos(2.0 * np.pi * taps[:, None] * frequency_cpp)
    return transfer
