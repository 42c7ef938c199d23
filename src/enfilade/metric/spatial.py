"""Pooling over space: what the eye gathers around the point that it looks at."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.ndimage

from enfilade.metric.pyramid import double, halve, halved_shape

__all__ = ["REFERENCE_AREA_DEG2", "SPATIAL_EXPONENT", "gathered", "patch_gain"]

Float32Array: TypeAlias = npt.NDArray[np.float32]

# Watson and Ahumada 2005, J. Vis. 5(9), find an aperture of about half a degree and 2.4 for
# ModelFest; our aperture is a little narrower, for a map that shows where the error is.
APERTURE_SIGMA_DEG = 0.45
SPATIAL_EXPONENT = 2.4  # no unit, of contrast
COARSEST_SIGMA = 2.0  # samples: the aperture is applied at reduced size, but not more than this

REFERENCE_SIGMA_DEG = 0.5  # of the Gabor patch at which pooling leaves the CSF as it is
REFERENCE_AREA_DEG2 = math.pi * REFERENCE_SIGMA_DEG**2  # its area in castleCSF's terms
RADII, PHASES = 128, 32  # samples of the patch
MOST_GAIN, HALVINGS = 64.0, 48


def gathered(powered: Float32Array, pixels_per_degree: float, exponent: float) -> Float32Array:
    """Map of what is seen by an eye that looks at each pixel: (G * J^e)^(1/e).

    G is a Gaussian of sum one and sigma 0.45 deg, the fall of sensitivity and attention away from
    the gaze. Nothing lies beyond the borders.

    Parameters
    ----------
    powered : (H, W) float32
        J^e at each pixel, 0 or more, 0 where not judged.
    pixels_per_degree : float
        Of the viewing conditions.
    exponent : float
        e, above 0.

    Returns
    -------
    (H, W) float32
        JND, never above the largest J.
    """
    sigma_px = APERTURE_SIGMA_DEG * pixels_per_degree
    halvings = max(math.floor(math.log2(max(sigma_px / COARSEST_SIGMA, 1.0))), 0)
    coarse = powered
    for _ in range(halvings):
        coarse = halve(coarse)
    coarse = scipy.ndimage.gaussian_filter(coarse, sigma_px / 2**halvings, mode="constant", truncate=3.5)
    if exponent != 1.0:
        coarse = coarse ** np.float32(1.0 / exponent)
    for step in reversed(range(halvings)):
        coarse = double(coarse, halved_shape(powered.shape, 2**step))
    return coarse


def patch_gain(response: Callable[[Float32Array], Float32Array], exponent: float) -> float:
    """By how much contrasts are multiplied so that a Gabor patch at threshold pools to 1 JND.

    The CSF is measured with patches, so their area is already in it: with this gain the pooling
    agrees with the CSF at a Gabor of sigma 0.5 deg (castleCSF's area 0.785 deg2), and gives the
    course of the threshold with size by itself.

    Parameters
    ----------
    response : callable
        J of one channel to contrasts in units of the threshold, without a mask.
    exponent : float
        e of `gathered`.

    Returns
    -------
    float
        1 or more.
    """
    # The patch in the aperture, by radius (weights of a ring under G) and phase of the grating.
    radius_deg = (np.arange(RADII) + 0.5) * (4.0 * APERTURE_SIGMA_DEG / RADII)
    weight = radius_deg * np.exp(-0.5 * (radius_deg / APERTURE_SIGMA_DEG) ** 2)
    weight /= weight.sum()
    window = np.exp(-0.5 * (radius_deg / REFERENCE_SIGMA_DEG) ** 2)
    wave = np.cos(np.pi * (np.arange(PHASES) + 0.5) / PHASES)
    patch = (window[:, None] * wave).astype(np.float32)

    def pooled(gain: float) -> float:
        jnd = response(patch * np.float32(gain)).astype(np.float64)
        return float(weight @ np.mean(np.abs(jnd) ** exponent, axis=1))

    low, high = 1.0, MOST_GAIN
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if pooled(middle) > 1.0 else (middle, high)
    return high
