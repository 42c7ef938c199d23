"""Cortex transform: channels of radial frequency and orientation (Watson 1987, Daly 1993).

Frequencies rho are in cycles per pixel, directions theta those of the frequency vector (the normal
of the bars) in degrees from x (right) towards y (down).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt
import scipy.fft

__all__ = ["ORIENTATIONS_DEG", "Band", "CortexTransform", "Partition", "bands"]

Float32Array: TypeAlias = npt.NDArray[np.float32]
Complex64Array: TypeAlias = npt.NDArray[np.complex64]
AnyArray = TypeVar("AnyArray", Float32Array, Complex64Array)

ORIENTATIONS_DEG = (-90.0, -60.0, -30.0, 0.0, 30.0, 60.0)  # centres of the fans (Daly 1993)
FAN_HALF_WIDTH_DEG = 30.0  # (Daly 1993)
HALF_TURN_DEG = 180.0
TRANSITION = 2.0 / 3.0  # width of a mesa's edge, as a share of its radius (Daly 1993)
BASE_SIGMAS = 3.0  # standard deviations of the base Gaussian inside its cut-off (Daly 1993)

LEVELS_AT_REFERENCE = 6  # radial levels, base included ...
REFERENCE_PPD = 28.0  # ... at the paper's pixels per degree (§6)
FEWEST_LEVELS = 2
NYQUIST = 0.5  # cycles per pixel
# No unit: our choice. What follows the transform is not linear, and its maps are interpolated; sampled
# at the limit they would be off by 13 % in a tenth of the pixels.
OVERSAMPLING = 2.0
CORNER = math.hypot(NYQUIST, NYQUIST)  # highest frequency of all, cycles per pixel


class Partition(Enum):
    """What the channel filters sum to.

    AMPLITUDE
        Filters sum to one, so the channels sum to the image (Daly 1993). Contrast half way between
        four channels appears in each at a quarter: 8.6 dB less after pooling with exponent 3.5.
    POWER
        Squares of the filters sum to one, so no contrast falls between channels: the dip is at
        most 2.6 dB. Made from the same windows, w -> sin(pi w / 2), which stay as smooth.
    """

    AMPLITUDE = "amplitude"
    POWER = "power"


@dataclass(frozen=True)
class Band:
    """A ring of the frequency plane.

    Attributes
    ----------
    level : int
        1 for the finest, counting up to the base.
    low_cpp, high_cpp : float
        Where the filter passes half the amplitude, cycles per pixel; `low_cpp` is 0 in the base.
    centre_cpp : float
        Geometric mean of the two; in the base the power-weighted mean. Cycles per pixel.
    cutoff_cpp : float
        Nothing passes at or above, cycles per pixel; infinite in the finest band.
    oversampling : float
        How much finer than the sampling theorem asks the band is sampled at least.
    """

    level: int
    low_cpp: float
    high_cpp: float
    centre_cpp: float
    cutoff_cpp: float
    oversampling: float = OVERSAMPLING

    @property
    def is_base(self) -> bool:
        """Whether this is the lowpass rest, which has no orientations."""
        return self.low_cpp == 0.0

    @property
    def reduction(self) -> int:
        """Power of two by which the band is sampled more coarsely than the image."""
        if math.isinf(self.cutoff_cpp):
            return 1
        coarsest = NYQUIST / self.cutoff_cpp / self.oversampling
        return int(2 ** math.floor(math.log2(max(coarsest, 1.0))))


def _radius(level: int) -> float:
    return 2.0**-level


def _cutoff(level: int) -> float:
    return _radius(level) * (1.0 + TRANSITION / 2.0)


def _base_sigma(levels: int) -> float:
    return _cutoff(levels - 1) / BASE_SIGMAS


def bands(pixels_per_degree: float, oversampling: float = OVERSAMPLING) -> tuple[Band, ...]:
    """Radial bands for a viewing condition, finest first, base last.

    The ladder hangs on the pixel, one octave a level; viewers far from the screen (many pixels per
    degree) get more levels, so that the lowest ones stay where they are in cycles per degree.
    K = 6 + round(log2(ppd / 28)), at least 2, whatever the size of the image.

    Parameters
    ----------
    pixels_per_degree : float
        Above 0.
    oversampling : float
        1 or more; 1 will do where energies are summed over an area, and nothing else is done.

    Returns
    -------
    tuple of Band
        K bands: centres 16.6 (only corners of the spectrum), 9.9, 4.9, 2.5, 0.90 and 0.22 cycles
        per degree at 27.93 px/deg.
    """
    octaves = round(math.log2(pixels_per_degree / REFERENCE_PPD))
    levels = max(LEVELS_AT_REFERENCE + octaves, FEWEST_LEVELS)
    sigma = _base_sigma(levels)
    base_edge = sigma * math.sqrt(2.0 * math.log(2.0))
    rings = []
    for level in range(1, levels):
        high = CORNER if level == 1 else _radius(level - 1)
        low = base_edge if level == levels - 1 else _radius(level)
        cutoff = math.inf if level == 1 else _cutoff(level - 1)
        rings.append(Band(level, low, high, math.sqrt(low * high), cutoff, oversampling))
    base = Band(levels, 0.0, base_edge, sigma / math.sqrt(math.pi), _cutoff(levels - 1), oversampling)
    return (*rings, base)


def _mesa(rho: Float32Array, level: int) -> Float32Array:
    if level == 0:
        return np.ones_like(rho)
    edge = (rho / _radius(level) - 1.0) / TRANSITION + 0.5
    ramp: Float32Array = 0.5 * (1.0 + np.cos(np.pi * np.clip(edge, 0.0, 1.0)))
    return ramp


def _base(rho: Float32Array, levels: int) -> Float32Array:
    gauss = np.exp(-0.5 * np.square(rho / _base_sigma(levels)))
    return np.where(rho < _cutoff(levels - 1), gauss, np.float32(0.0))


def _radial(rho: Float32Array, band: Band, levels: int) -> Float32Array:
    if band.is_base:
        return _base(rho, levels)
    is_lowest = band.level == levels - 1
    inner = _base(rho, levels) if is_lowest else _mesa(rho, band.level)
    return _mesa(rho, band.level - 1) - inner


def _fan(theta_deg: Float32Array, centre_deg: float) -> Float32Array:
    away = np.abs((theta_deg - centre_deg + HALF_TURN_DEG / 2) % HALF_TURN_DEG - HALF_TURN_DEG / 2)
    window = 0.5 * (1.0 + np.cos(np.pi * away / FAN_HALF_WIDTH_DEG))
    return np.where(away < FAN_HALF_WIDTH_DEG, window, np.float32(0.0))


class CortexTransform:
    """The filters for one image size, and images through them.

    Images are taken as periodic: pad them first (`metric.borders`). Coarse bands are cropped out of
    the spectrum and come back at reduced size, sample i of a band standing at pixel
    i * band.reduction.

    Parameters
    ----------
    height_px, width_px : int
        Padded size; each a multiple of twice the coarsest reduction.
    pixels_per_degree : float
        Sets the ladder, see `bands`.
    partition : Partition
        What the filters sum to.
    tilt : callable, optional
        (rho, band, base band) -> what every frequency of a band is multiplied by besides.
    oversampling : float
        Of the bands, see `bands`.
    workers : int
        Threads of the FFT.
    """

    def __init__(
        self,
        height_px: int,
        width_px: int,
        pixels_per_degree: float,
        *,
        partition: Partition = Partition.POWER,
        tilt: Callable[[Float32Array, Band, Band], Float32Array] | None = None,
        oversampling: float = OVERSAMPLING,
        workers: int = 1,
    ) -> None:
        self.height_px, self.width_px = height_px, width_px
        self.bands = bands(pixels_per_degree, oversampling)
        self._workers = workers
        down = np.fft.fftfreq(height_px).astype(np.float32)[:, None]
        across = np.fft.rfftfreq(width_px).astype(np.float32)[None, :]
        rho = np.hypot(across, down)
        theta = np.degrees(np.arctan2(down, across))
        self._radials = [
            self._window(_radial(self._crop(rho, band), band, len(self.bands)), partition)
            / np.float32(band.reduction**2)
            for band in self.bands
        ]
        if tilt is not None:
            for band in self.bands:
                self._radials[band.level - 1] *= tilt(self._crop(rho, band), band, self.bands[-1])
        self._fans = [self._window(_fan(theta, centre), partition) for centre in ORIENTATIONS_DEG]

    @staticmethod
    def _window(window: Float32Array, partition: Partition) -> Float32Array:
        if partition is Partition.AMPLITUDE:
            return window.astype(np.float32)
        rooted: Float32Array = np.sin(np.float32(np.pi / 2.0) * window)
        return rooted.astype(np.float32)

    def _crop(self, spectrum: AnyArray, band: Band) -> AnyArray:
        """Rows of the band's reduced size, columns up to its cut-off."""
        height, width = self.reduced_shape(band)
        columns = math.ceil(min(width / 2, self.width_px * band.cutoff_cpp)) + 1
        if band.reduction == 1:
            return spectrum[..., :columns]
        half = height // 2
        low, high = spectrum[..., :half, :columns], spectrum[..., -half:, :columns]
        return np.concatenate((low, high), axis=-2)

    def spectra(self, images: Float32Array) -> Complex64Array:
        """Spectra of images, (n, height, width) float32 -> (n, height, width/2 + 1) complex64."""
        return scipy.fft.rfft2(images, workers=self._workers)

    def ring(self, spectra: Complex64Array, band: Band) -> Complex64Array:
        """The part of the spectra in a band, cropped to the band's reduced size."""
        return self._crop(spectra, band) * self._radials[band.level - 1]

    def fan(self, ring: Complex64Array, band: Band, orientation: int | None) -> Float32Array:
        """One channel, back in the image plane.

        Parameters
        ----------
        ring : (n, ...) complex64
            What `ring` gave for the same band.
        band : Band
            The band.
        orientation : int or None
            Index into ORIENTATIONS_DEG; None for all orientations together (the base band).

        Returns
        -------
        (n, height / reduction, width / reduction) float32
            The channel's response, in the units of the images.
        """
        width, workers = self.reduced_shape(band)[1], self._workers
        if orientation is not None:
            ring = ring * self._crop(self._fans[orientation], band)
        # Columns beyond the cut-off are zero, and the transform down them is saved.
        columns = scipy.fft.ifft(ring, axis=-2, overwrite_x=orientation is not None, workers=workers)
        return scipy.fft.irfft(columns, n=width, axis=-1, workers=workers)

    def orientations(self, band: Band) -> tuple[int | None, ...]:
        """Orientations of a band: indices into ORIENTATIONS_DEG, or one None in the base."""
        return (None,) if band.is_base else tuple(range(len(ORIENTATIONS_DEG)))

    def reduced_shape(self, band: Band) -> tuple[int, int]:
        """Height and width of a band's channels."""
        return self.height_px // band.reduction, self.width_px // band.reduction
