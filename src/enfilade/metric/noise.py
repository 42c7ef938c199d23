"""Monte Carlo noise in the images compared: its part in their difference.

The variance of the noise is known at every pixel and propagates linearly. A channel with the impulse
response h_kl responds to independent noise with the variance

    sigma_kl^2 = h_kl^2 * Var = G_kl (q_k * Var)    (* is a convolution),

which is separated into the filter's noise gain G_kl = sum h_kl^2 and a local average of the variance over the
band's reach, q_k = sum_l h_kl^2 / sum_l G_kl (the mean over orientations). A channel's difference counts as
far as it exceeds NOISE_SIGMAS standard deviations (soft threshold), max(abs(C' - C'') - 4 sigma_kl, 0). Three
standard deviations would leave 0.3 % of the samples in each of up to 31 channels; four leave 0.006 %.

Images that were filtered by a Gaussian since have less noise in their fine channels, and smaller differences:
given its deviation at each pixel, the noise of a channel is scaled by the share that the filter passes of
white noise in the channel's ring.

Limits: noise that is otherwise correlated between neighbouring pixels (after bilinear resampling, splatting
or a denoiser) has more power at low and less at high frequencies than its variance says, so that low bands
may still count it; give such images the variance they had before, or larger. Fireflies are not Gaussian, and
exceed four of their poorly estimated standard deviations more often. Noise remains a mask for the viewer:
thresholds are elevated by the images as they are.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.fft

from enfilade.metric.amplitude import response
from enfilade.metric.cortex import Band, Complex64, CortexTransform
from enfilade.metric.pyramid import halve_periodic
from enfilade.records import F32

NOISE_SIGMAS = 4.0  # no unit: our choice, see above
LEAST_DEVIATION_CD_M2 = 1e-4  # keeps the slope finite where there is no noise
BLUR_SIGMAS = 3.0  # the Gaussian filter ends after so many standard deviations to either side ...
BLUR_STEPS = 12  # ... and is tabulated at so many widths a pixel


def response_variance(mean_cd_m2: F32, variance: F32) -> F32:
    """Variance of the noise in a difference after the amplitude nonlinearity.

    Var_R = slope^2 Var, slope = (R(L + s) - R(max(L - s, 0))) / (2 s): the local slope of R around the mean
    L of the two images over the range s = sqrt(Var / 2) of one image's noise. The derivative itself is
    infinite at black.
    """
    deviation = np.sqrt(np.float32(0.5) * variance)
    reach = np.maximum(deviation, np.float32(LEAST_DEVIATION_CD_M2))
    above = response(mean_cd_m2 + reach)
    below = response(np.maximum(mean_cd_m2 - reach, np.float32(0.0)))
    slope: F32 = (above - below) / (np.float32(2.0) * reach)
    return variance * slope * slope


class NoiseFilters:
    """Noise gain and reach of every channel filter of a Cortex transform, from an impulse through all."""

    def __init__(self, cortex: CortexTransform) -> None:
        self.cortex = cortex
        self.deviations: dict[tuple[int, int | None], float] = {}  # sqrt(G_kl) by level and orientation
        self._reaches: dict[int, F32] = {}
        impulse = np.zeros((1, cortex.height_px, cortex.width_px), dtype=np.float32)
        impulse[0, 0, 0] = 1.0
        spectrum = cortex.spectra(impulse)
        for band in cortex.bands:
            ring = cortex.ring(spectrum, band)
            energies = [np.square(cortex.fan(ring, band, o)[0]) for o in band.orientations]
            for orientation, energy in zip(band.orientations, energies, strict=True):
                # A coarse band samples the impulse response at every reduction-th pixel.
                gain = float(energy.sum(dtype=np.float64)) * band.reduction**2
                self.deviations[band.level, orientation] = gain**0.5
            kernel = sum(energies[1:], start=energies[0])
            kernel /= np.float32(kernel.sum(dtype=np.float64))
            self._reaches[band.level] = cortex.spectra(kernel[None])[0].real.copy()

    def passing(self, band: Band, blur_px: F32) -> F32:
        """Share of the variance of a band's white noise that Gaussians of these deviations pass."""
        widths = np.arange(math.ceil(float(blur_px.max()) * BLUR_STEPS) + 1) / BLUR_STEPS
        spectrum = np.ones((1, self.cortex.height_px, self.cortex.width_px // 2 + 1), np.complex64)
        power = np.square(np.abs(self.cortex.ring(spectrum, band)[0]))
        power[:, 1:] *= np.float32(2.0)  # the other half of the spectrum
        rows, columns = power.shape
        down = _gaussian_transfer(np.fft.fftfreq(rows) / band.reduction, widths)
        across = _gaussian_transfer(np.fft.rfftfreq(self.cortex.width_px)[:columns], widths)
        left = np.einsum("kr,rc,kc->k", np.square(down), power, np.square(across), optimize=True)
        passing: F32 = np.interp(blur_px, widths, left / left[0]).astype(np.float32)
        return passing

    def average(self, spectrum: Complex64, band: Band) -> F32:
        """Local average q_k of a map at a band's size, from the map's spectrum."""
        size = self.cortex.reduced_shape(band)
        averaged = scipy.fft.irfft2(spectrum * self._reaches[band.level], s=size)
        return np.maximum(averaged, np.float32(0.0))


class ChannelNoise:
    """Standard deviation of the noise in every channel's difference, for one pair of images.

    Parameters
    ----------
    filters : NoiseFilters
    variance : (padded height, padded width) float32
        Noise variance in the difference of the transformed images.
    blur_px : (padded height, padded width) float32 or None
        Of the Gaussian that has filtered the images since.
    """

    def __init__(self, filters: NoiseFilters, variance: F32, blur_px: F32 | None = None) -> None:
        self._filters = filters
        self._averages: dict[int, F32] = {}
        reduction = 1
        for band in filters.cortex.bands:
            while reduction < band.reduction:
                variance = halve_periodic(variance)
                blur_px = None if blur_px is None else halve_periodic(blur_px)
                reduction *= 2
            passed = variance if blur_px is None else variance * filters.passing(band, blur_px)
            spectrum = filters.cortex.spectra(passed)
            self._averages[band.level] = np.sqrt(filters.average(spectrum, band))

    def deviation(self, band: Band, orientation: int | None) -> F32:
        """Standard deviation sigma_kl, a map at the band's padded reduced size."""
        return self._averages[band.level] * np.float32(self._filters.deviations[band.level, orientation])


def _gaussian_transfer(frequency_cpp: npt.NDArray[Any], widths_px: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Transfer of Gaussians with taps at whole pixels, (widths, frequencies)."""
    reach = np.floor(BLUR_SIGMAS * widths_px)
    taps = np.arange(int(reach.max()) + 1)
    weights = np.exp(-0.5 * np.square(taps / np.maximum(widths_px[:, None], 1e-9)))
    weights *= (taps <= reach[:, None]) * np.where(taps > 0, 2.0, 1.0)
    weights /= weights.sum(axis=1, keepdims=True)
    transfer: npt.NDArray[Any] = weights @ np.cos(2.0 * np.pi * taps[:, None] * frequency_cpp)
    return transfer
