"""Spatial pooling: contrast energy integrated under an aperture around the point of gaze."""

from __future__ import annotations

import math

import numpy as np
import scipy.ndimage

from enfilade.metric.pyramid import double, halved_shape
from enfilade.records import F32

# Standard deviation, degrees. Models of detection have 0.25 to 0.6 (Watson and Ahumada 2005, J. Vis. 5(9):
# 0.6); `studies/observers/fits.py` shows that ModelFest hardly tells these apart. A small one leaves a
# sharper map.
APERTURE_SIGMA_DEG = 0.3
COARSEST_SIGMA = 1.0  # samples: integration runs at reduced size, with this standard deviation at least
REACH_SIGMAS = 3.5

REFERENCE_SIGMA_DEG = 0.5  # of the Gabor patch for which pooling leaves the CSF unchanged
REFERENCE_AREA_DEG2 = math.pi * REFERENCE_SIGMA_DEG**2  # its area in castleCSF's terms


def patch_gain(sigma_deg: float) -> float:
    """Factor on contrasts with which a Gabor patch at threshold integrates to energy one; 1.86 for 0.3 deg.

    The CSF is measured with patches and includes their area: with this gain the aperture agrees with
    the CSF for a Gabor of sigma s = 0.5 deg (castleCSF's area 0.785 deg2), and determines the thresholds
    of other sizes. The energy of the patch at contrast one under the aperture of sigma a is
    1 / (2 (1 + 2 a^2 / s^2)).
    """
    return math.sqrt(2.0 * (1.0 + 2.0 * (sigma_deg / REFERENCE_SIGMA_DEG) ** 2))


class Aperture:
    """Integrates energies under a Gaussian, on a coarse grid; nothing lies beyond the borders.

    Parameters
    ----------
    image_shape : tuple of int
        Height and width of the image, pixels.
    pixels_per_degree, sigma_deg : float
        Of the viewing conditions; standard deviation of the Gaussian.

    Attributes
    ----------
    reduction : int
        A sample of the grid stands at every `reduction`-th pixel.
    shape : tuple of int
        Height and width of the grid.
    """

    def __init__(self, image_shape: tuple[int, int], pixels_per_degree: float, sigma_deg: float) -> None:
        sigma_px = sigma_deg * pixels_per_degree
        self.reduction = 2 ** max(math.floor(math.log2(max(sigma_px / COARSEST_SIGMA, 1.0))), 0)
        self.shape = halved_shape(image_shape, self.reduction)
        self._image_shape = image_shape
        self._sigma = sigma_px / self.reduction

    def coarse(self, energy: F32, reduction: int) -> F32:
        """Resample a map at every `reduction`-th pixel to the grid, (h, w) -> (h', w') float32.

        Finer maps are averaged over squares of samples, of which the first stands on the grid;
        `integrate` allows for their centre, which does not.
        """
        while reduction > self.reduction:
            reduction //= 2
            energy = double(energy, halved_shape(self._image_shape, reduction))
        energy = averaged(energy, reduction, self.reduction)
        rows, columns = self.shape
        on_grid = np.zeros(self.shape, dtype=np.float32)
        on_grid[: len(energy), : energy.shape[1]] = energy[:rows, :columns]
        return on_grid

    def integrate(self, energies: F32, reduction: int) -> F32:
        """Integrate maps on the grid, (..., h', w') float32, from samples at every `reduction`-th pixel."""
        sigma, reach = self._sigma, math.ceil(REACH_SIGMAS * self._sigma) + 1
        # Squares of m by m samples have their centre (m - 1) / 2 samples beyond the first.
        beyond = max(0.5 * (1.0 - reduction / self.reduction), 0.0)
        variance = max(sigma**2 - (1.0 - min(reduction / self.reduction, 1.0) ** 2) / 12.0, 1e-6)
        weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) + beyond) ** 2 / variance)
        weights /= weights.sum()
        for axis in (-2, -1):
            energies = scipy.ndimage.correlate1d(energies, weights, axis, mode="constant")
        return energies


def averaged(energy: F32, reduction: int, wanted: int) -> F32:
    """Average a map at every `reduction`-th pixel over squares, to every `wanted`-th, if that is coarser."""
    while reduction < wanted:
        energy = _pairs(_pairs(energy).T).T
        reduction *= 2
    return energy


def _pairs(fine: F32) -> F32:
    """Average pairs of rows; nothing lies beyond the last."""
    odd = fine[1::2]
    coarse: F32 = fine[::2] * np.float32(0.5)
    coarse[: len(odd)] += np.float32(0.5) * odd
    return coarse
