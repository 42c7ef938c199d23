"""Pooling over space: what the eye gathers around the point that it looks at."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.metric.pyramid import double, halved_shape

__all__ = ["REFERENCE_AREA_DEG2", "SPATIAL_EXPONENT", "Aperture", "patch_gain"]

Float32Array: TypeAlias = npt.NDArray[np.float32]

SPATIAL_EXPONENT = 2.0  # no unit: contrast energy
COARSEST_SIGMA = 1.0  # samples: the aperture is applied at reduced size, but not more reduced than this
REACH_SIGMAS = 3.5

REFERENCE_SIGMA_DEG = 0.5  # of the Gabor patch at which pooling leaves the CSF as it is
REFERENCE_AREA_DEG2 = math.pi * REFERENCE_SIGMA_DEG**2  # its area in castleCSF's terms


def patch_gain(sigma_deg: float) -> float:
    """By how much contrasts are multiplied so that a Gabor patch at threshold gathers to energy one.

    The CSF is measured with patches, so their area is in it already: with this gain the aperture
    agrees with the CSF at a Gabor of sigma s = 0.5 deg (castleCSF's area 0.785 deg2), and gives the
    course of the threshold with size by itself. The energy of the patch at contrast one, seen
    through the aperture of sigma a, is 1 / (2 (1 + 2 a^2 / s^2)).

    Parameters
    ----------
    sigma_deg : float
        Of the aperture, degrees.

    Returns
    -------
    float
        1.86 for 0.3 deg.
    """
    return math.sqrt(2.0 * (1.0 + 2.0 * (sigma_deg / REFERENCE_SIGMA_DEG) ** 2))


class Aperture:
    """Gathers energies under a Gaussian, on a coarse grid.

    Nothing lies beyond the borders: there the eye gathers from one side only.

    Parameters
    ----------
    shape : tuple of int
        Height and width of the image, pixels.
    pixels_per_degree : float
        Of the viewing conditions.
    sigma_deg : float
        Standard deviation, degrees (`metric.options.Fitted`).

    Attributes
    ----------
    reduction : int
        A sample of the grid stands at every `reduction`-th pixel.
    """

    def __init__(self, shape: tuple[int, int], pixels_per_degree: float, sigma_deg: float) -> None:
        sigma_px = sigma_deg * pixels_per_degree
        self.reduction = 2 ** max(math.floor(math.log2(max(sigma_px / COARSEST_SIGMA, 1.0))), 0)
        self._shape = shape
        self._sigma = sigma_px / self.reduction

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the grid."""
        return halved_shape(self._shape, self.reduction)

    def coarse(self, energy: Float32Array, reduction: int) -> Float32Array:
        """Bring a map at a band's size to the grid, (h, w) -> (h', w').

        Finer maps are averaged over squares of samples, of which the first stands on the grid;
        `gather` knows that their middle does not.

        Parameters
        ----------
        energy : (h, w) float32
            Samples at every `reduction`-th pixel.
        reduction : int
            A power of two.
        """
        while reduction > self.reduction:
            reduction //= 2
            energy = double(energy, halved_shape(self._shape, reduction))
        while reduction < self.reduction:
            energy = _pairs(_pairs(energy).T).T
            reduction *= 2
        rows, columns = self.shape
        on_grid = np.zeros(self.shape, dtype=np.float32)
        on_grid[: len(energy), : energy.shape[1]] = energy[:rows, :columns]
        return on_grid

    def gather(self, energies: Float32Array, reduction: int) -> Float32Array:
        """Gather maps on the grid, (n, h', w') float32, that had samples at every `reduction`-th pixel."""
        sigma, reach = self._sigma, math.ceil(REACH_SIGMAS * self._sigma) + 1
        # Squares of m by m samples have their middle (m - 1) / 2 samples beyond the first.
        beyond = max(0.5 * (1.0 - reduction / self.reduction), 0.0)
        variance = max(sigma**2 - (1.0 - min(reduction / self.reduction, 1.0) ** 2) / 12.0, 1e-6)
        weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) + beyond) ** 2 / variance)
        weights = (weights / weights.sum()).astype(np.float32)
        return _blurred(_blurred(energies, weights, 1), weights, 2)

    def full(self, coarse: Float32Array) -> Float32Array:
        """From the grid to every pixel, (h', w') -> (H, W), bilinearly."""
        reduction = self.reduction
        while reduction > 1:
            reduction //= 2
            coarse = double(coarse, halved_shape(self._shape, reduction))
        return coarse


def _pairs(fine: Float32Array) -> Float32Array:
    """Average pairs of rows; nothing lies beyond the last."""
    odd = fine[1::2]
    coarse: Float32Array = fine[::2] * np.float32(0.5)
    coarse[: len(odd)] += np.float32(0.5) * odd
    return coarse


def _blurred(energies: Float32Array, weights: Float32Array, axis: int) -> Float32Array:
    """Weigh each sample's neighbours, from the one `reach` before to the one as far beyond."""
    reach = len(weights) // 2
    gathered: Float32Array = energies * weights[reach]
    there, here = np.moveaxis(energies, axis, 0), np.moveaxis(gathered, axis, 0)
    weighted = np.empty_like(energies)
    shifted = np.moveaxis(weighted, axis, 0)
    for step in range(1, min(reach + 1, len(here))):
        np.multiply(there, weights[reach + step], out=shifted)
        here[:-step] += shifted[step:]
        np.multiply(there, weights[reach - step], out=shifted)
        here[step:] += shifted[:-step]
    return gathered
