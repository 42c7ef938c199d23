"""The luminance to which the eye is adapted around each pixel."""

from __future__ import annotations

import math

import numpy as np
import scipy.ndimage

from enfilade.metric.pyramid import double, halve, halved_shape
from enfilade.records import F32

ADAPTATION_SIGMA_DEG = 0.5  # our choice: about the radius of the fovea
DARKEST_CD_M2 = 1e-3  # darker luminances adapt the eye as this one does
COARSEST_SIGMA = 2.0  # samples: the blur runs at reduced size, with this standard deviation at least


def adapting_luminance(luminance_cd_m2: F32, pixels_per_degree: float) -> F32:
    """Mean luminance around each pixel, under a Gaussian of sigma 0.5 deg.

    Contrast is relative to the surrounding luminance: an error in a dark corner counts by the light
    of the corner, not of the image. The mean is arithmetic and wide, so that a thin dark line beside a
    bright wall is seen at the adaptation to the wall, as glare makes it.

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
