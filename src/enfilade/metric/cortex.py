"""Cortex transform: channels of radial frequency and orientation (Watson 1987, Daly 1993).

Frequencies rho are in cycles per pixel, directions theta those of the frequency vector (the normal
of the bars) in degrees from x (right) towards y (down).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt
import scipy.fft

from enfilade.records import F32

Complex64: TypeAlias = npt.NDArray[np.complex64]
Spectrum = TypeVar("Spectrum", F32, Complex64)
Tilt: TypeAlias = Callable[[F32, "Band", "Band"], F32]

ORIENTATIONS_DEG = (-90.0, -60.0, -30.0, 0.0, 30.0, 60.0)  # centres of the fans (Daly 1993)
FAN_HALF_WIDTH_DEG = 30.0  # (Daly 1993)
HALF_TURN_DEG = 180.0
TRANSITION = 2.0 / 3.0  # width of a mesa's edge, relative to its radius (Daly 1993)
BASE_SIGMAS = 3.0  # standard deviations of the base Gaussian inside its cut-off (Daly 1993)

LEVELS_AT_REFERENCE = 6  # radial levels, base included ...
REFERENCE_PPD = 28.0  # ... at the paper's pixels per degree (§6)
FEWEST_LEVELS = 2
NYQUIST = 0.5  # cycles per pixel
# No unit: our choice. The stages after the transform are not linear, and their maps are interpolated; at
# critical sampling they would be off by 13 % in a tenth of the pixels.
OVERSAMPLING = 2.0
CORNER = math.hypot(NYQUIST, NYQUIST)  # highest frequency of all, cycles per pixel


@dataclass(frozen=True)
class Band:
    """A ring of the frequency plane.

    Attributes
    ----------
    level : int
        1 for the finest, counting up to the base.
    low_cpp, high_cpp : float
        Frequencies of half power before `tilt`, cycles per pixel; `low_cpp` is 0 in the base.
    centre_cpp : float
        Geometric mean of the two; in the base the power-weighted mean.
    cutoff_cpp : float
        Nothing passes at or above; infinite in the finest band.
    oversampling : float
        Least sampling rate relative to the Nyquist rate.
    """

    level: int
    low_cpp: float
    high_cpp: float
    centre_cpp: float
    cutoff_cpp: float
    oversampling: float = OVERSAMPLING

    @property
    def is_base(self) -> bool:
        """Whether this is the lowpass residual, which has no orientations."""
        return self.low_cpp == 0.0

    @property
    def orientations(self) -> tuple[int | None, ...]:
        """Indices into ORIENTATIONS_DEG, or one None in the base."""
        return (None,) if self.is_base else tuple(range(len(ORIENTATIONS_DEG)))

    @property
    def reduction(self) -> int:
        """Power of two by which the band is sampled more coarsely than the image."""
        if math.isinf(self.cutoff_cpp):
            return 1
        coarsest = NYQUIST / self.cutoff_cpp / self.oversampling
        return int(2 ** math.floor(math.log2(max(coarsest, 1.0))))


def _cutoff(level: int) -> float:
    return 2.0**-level * (1.0 + TRANSITION / 2.0)


def _base_sigma(levels: int) -> float:
    return _cutoff(levels - 1) / BASE_SIGMAS


def bands(pixels_per_degree: float, oversampling: float = OVERSAMPLING) -> tuple[Band, ...]:
    """Radial bands for a viewing condition, finest first, base last.

    The bands are fixed to the pixel, one octave a level; more pixels per degree give more levels,
    6 + round(log2(ppd / 28)), at least 2, so that the lowest ones stay where they are in cycles per
    degree. At 27.93 px/deg their centres are 16.6 (corners of the spectrum only), 9.9, 4.9, 2.5, 0.90 and
    0.22 cycles per degree. An oversampling of 1 suffices where energies are only summed over an area.
    """
    octaves = round(math.log2(pixels_per_degree / REFERENCE_PPD))
    levels = max(LEVELS_AT_REFERENCE + octaves, FEWEST_LEVELS)
    sigma = _base_sigma(levels)
    base_edge = sigma * math.sqrt(2.0 * math.log(2.0))
    rings = []
    for level in range(1, levels):
        high = CORNER if level == 1 else 2.0 ** (1 - level)
        low = base_edge if level == levels - 1 else 2.0**-level
        cutoff = math.inf if level == 1 else _cutoff(level - 1)
        rings.append(Band(level, low, high, math.sqrt(low * high), cutoff, oversampling))
    base = Band(levels, 0.0, base_edge, sigma / math.sqrt(math.pi), _cutoff(levels - 1), oversampling)
    return (*rings, base)


def _mesa(rho: F32, level: int) -> F32:
    if level == 0:
        return np.ones_like(rho)
    edge = (rho / 2.0**-level - 1.0) / TRANSITION + 0.5
    ramp: F32 = 0.5 * (1.0 + np.cos(np.pi * np.clip(edge, 0.0, 1.0)))
    return ramp


def _base(rho: F32, levels: int) -> F32:
    gauss = np.exp(-0.5 * np.square(rho / _base_sigma(levels)))
    return np.where(rho < _cutoff(levels - 1), gauss, np.float32(0.0))


def _dom(rho: F32, band: Band, levels: int) -> F32:
    if band.is_base:
        return _base(rho, levels)
    inner = _base(rho, levels) if band.level == levels - 1 else _mesa(rho, band.level)
    return _mesa(rho, band.level - 1) - inner


def _fan(theta_deg: F32, centre_deg: float) -> F32:
    away = np.abs((theta_deg - centre_deg + HALF_TURN_DEG / 2) % HALF_TURN_DEG - HALF_TURN_DEG / 2)
    window = 0.5 * (1.0 + np.cos(np.pi * away / FAN_HALF_WIDTH_DEG))
    return np.where(away < FAN_HALF_WIDTH_DEG, window, np.float32(0.0))


def _power_complementary(window: F32) -> F32:
    rooted: F32 = np.sin(np.float32(np.pi / 2.0) * window)
    return rooted.astype(np.float32)


class CortexTransform:
    """The channel filters for one image size.

    Daly's windows w, which sum to one, become sin(pi w / 2): the squares of the filters sum to one,
    and contrast half way between four channels loses at most 2.6 dB in pooling, instead of 8.6 dB.

    Images are taken as periodic: pad them first (`metric.channels`). Spectra of coarse bands are
    cropped and inverted at reduced size; sample i of a band stands at pixel i * band.reduction.

    Parameters
    ----------
    height_px, width_px : int
        Padded size; each a multiple of twice the coarsest reduction.
    pixels_per_degree : float
        Determines the bands, see `bands`.
    tilt : callable, optional
        (rho, band, base band) -> further weight of every frequency of a band.
    oversampling : float
        Of the bands, see `bands`.
    """

    def __init__(
        self,
        height_px: int,
        width_px: int,
        pixels_per_degree: float,
        *,
        tilt: Tilt | None = None,
        oversampling: float = OVERSAMPLING,
    ) -> None:
        self.height_px, self.width_px = height_px, width_px
        self.bands = bands(pixels_per_degree, oversampling)
        down = np.fft.fftfreq(height_px).astype(np.float32)[:, None]
        across = np.fft.rfftfreq(width_px).astype(np.float32)[None, :]
        rho = np.hypot(across, down)
        theta = np.degrees(np.arctan2(down, across))
        self._doms: list[F32] = []
        for band in self.bands:
            cropped = self._crop(rho, band)
            dom = _power_complementary(_dom(cropped, band, len(self.bands))) / np.float32(band.reduction**2)
            self._doms.append(dom if tilt is None else dom * tilt(cropped, band, self.bands[-1]))
        self._fans = [_power_complementary(_fan(theta, centre)) for centre in ORIENTATIONS_DEG]

    def _crop(self, spectrum: Spectrum, band: Band) -> Spectrum:
        """Rows of the band's reduced size, columns up to its cut-off."""
        height, width = self.reduced_shape(band)
        columns = math.ceil(min(width / 2, self.width_px * band.cutoff_cpp)) + 1
        if band.reduction == 1:
            return spectrum[..., :columns]
        half = height // 2
        low, high = spectrum[..., :half, :columns], spectrum[..., -half:, :columns]
        return np.concatenate((low, high), axis=-2)

    def spectra(self, images: F32) -> Complex64:
        """Spectra of images, (n, height, width) float32 -> (n, height, width/2 + 1) complex64."""
        return scipy.fft.rfft2(images)

    def ring(self, spectra: Complex64, band: Band) -> Complex64:
        """The part of the spectra in a band, cropped to the band's reduced size."""
        return self._crop(spectra, band) * self._doms[band.level - 1]

    def fan(self, ring: Complex64, band: Band, orientation: int | None) -> F32:
        """One channel of a band's `ring`, back in the image plane.

        Parameters
        ----------
        ring : (n, ...) complex64
        band : Band
        orientation : int or None
            Index into ORIENTATIONS_DEG; None for all orientations together.

        Returns
        -------
        (n, height / reduction, width / reduction) float32
            Response, in the units of the images.
        """
        if orientation is not None:
            ring = ring * self._crop(self._fans[orientation], band)
        # Columns beyond the cut-off are zero, and the transform down them is saved.
        columns = scipy.fft.ifft(ring, axis=-2, overwrite_x=orientation is not None)
        return scipy.fft.irfft(columns, n=self.reduced_shape(band)[1], axis=-1)

    def reduced_shape(self, band: Band) -> tuple[int, int]:
        """Height and width of a band's channels."""
        return self.height_px // band.reduction, self.width_px // band.reduction
