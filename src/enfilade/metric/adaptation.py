"""The luminance that the eye is adapted to around each pixel."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.ndimage

from enfilade.metric.pyramid import double, halve, halved_shape

__all__ = ["DARKEST_CD_M2", "AdaptingLight", "adapting_luminance"]

Float32Array: TypeAlias = npt.NDArray[np.float32]
IndexArray: TypeAlias = npt.NDArray[np.int32]

ADAPTATION_SIGMA_DEG = 0.5  # our choice: about the fovea's rim, where gaze and adaptation rest
DARKEST_CD_M2 = 1e-3  # what is darker is seen as if it were this bright
COARSEST_SIGMA = 2.0  # samples: the blur is made at reduced size, but not more reduced than this


def adapting_luminance(luminance_cd_m2: Float32Array, pixels_per_degree: float) -> Float32Array:
    """Mean luminance around each pixel, under a Gaussian of sigma 0.5 deg.

    Contrast is what a pattern does to the luminance around it, so that an error in a dark corner
    counts by the light of the corner and not by that of the room. The mean is arithmetic and wide
    enough that a thin dark line beside a bright wall is seen by the wall's light, as glare has it.

    Parameters
    ----------
    luminance_cd_m2 : (H, W) float32
        Of the reference, 0 or more; repeated beyond its borders.
    pixels_per_degree : float
        Of the viewing conditions.

    Returns
    -------
    (H, W) float32
        cd/m2, 0.001 or more.
    """
    sigma_px = ADAPTATION_SIGMA_DEG * pixels_per_degree
    halvings = max(math.floor(math.log2(max(sigma_px / COARSEST_SIGMA, 1.0))), 0)
    coarse = luminance_cd_m2
    for _ in range(halvings):
        coarse = halve(coarse)
    coarse = scipy.ndimage.gaussian_filter(coarse, sigma_px / 2**halvings, mode="nearest", truncate=3.0)
    np.maximum(coarse, np.float32(DARKEST_CD_M2), out=coarse)
    for step in reversed(range(halvings)):
        coarse = double(coarse, halved_shape(luminance_cd_m2.shape, 2**step))
    return coarse


class AdaptingLight:
    """Adapting luminance at the size of each band, made when asked for and kept.

    Parameters
    ----------
    luminance_cd_m2 : () or (H, W) float32
        One for the whole image, or a map (`adapting_luminance`); above 0.
    """

    def __init__(self, luminance_cd_m2: Float32Array) -> None:
        self._maps: dict[int, Float32Array] = {1: luminance_cd_m2}
        self._offsets: dict[int, IndexArray] = {}

    def at(self, reduction: int) -> Float32Array:
        """The luminance at every `reduction`-th pixel, cd/m2."""
        if reduction not in self._maps:
            finer = self.at(reduction // 2)
            self._maps[reduction] = halve(finer) if finer.ndim else finer
        return self._maps[reduction]

    def offset(self, of: Callable[[Float32Array], IndexArray], reduction: int) -> IndexArray:
        """A table's offsets for the luminance at a reduced size; `of` must stay the same."""
        if reduction not in self._offsets:
            self._offsets[reduction] = of(self.at(reduction))
        return self._offsets[reduction]
