"""Visual masking by threshold elevation (Fig. 6; Daly 1993, Eriksson et al. 1998)."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

__all__ = ["MASK_SLOPE", "masked_difference_squared", "threshold_elevation"]

Float32Array: TypeAlias = npt.NDArray[np.float32]

MASK_SLOPE = 0.7  # s, no unit; Daly 1993 for low frequencies and coherent masks
MASK_SHARPNESS = 4.0  # b, no unit (Daly 1993)
LEARNING = 0.7  # Q, no unit: the slope that k1 and k2 are made for (Daly 1993)
BEND = 6.0  # no unit: scale of the bend (Daly 1993)
K2 = BEND ** (1.0 / (1.0 - LEARNING))
K1 = BEND ** (1.0 - 1.0 / (1.0 - LEARNING))

DARKEST_MASKER = 1e-20  # keeps the logarithm finite; elevates no threshold


def _elevation_to_the_fourth(masker_jnd: Float32Array, mask_slope: float) -> Float32Array:
    log_masker = np.log(np.maximum(masker_jnd, np.float32(DARKEST_MASKER)))
    log_masker *= np.float32(MASK_SHARPNESS * mask_slope)
    log_masker += np.float32(MASK_SHARPNESS * (np.log(K1) + mask_slope * np.log(K2)))
    elevated: Float32Array = np.exp(log_masker)
    elevated += np.float32(1.0)
    return elevated


def threshold_elevation(masker_jnd: Float32Array, mask_slope: float = MASK_SLOPE) -> Float32Array:
    """How many times the threshold rises where the channel already carries contrast (Daly 1993).

    Te = (1 + (k1 (k2 m)^s)^b)^(1/b), b = 4, k1 = 6^(1 - 1/(1 - Q)), k2 = 6^(1/(1 - Q)), Q = 0.7.

    Parameters
    ----------
    masker_jnd : (...) float32
        Contrast of the mask in units of its own threshold, m = abs(C) S, 0 or more.
    mask_slope : float
        Slope s of the rise on logarithmic axes. Daly 1993 has 0.7 in the base band up to 1 in the
        fine ones; with masks that are not noise, 1 overestimates masking by 16 dB.

    Returns
    -------
    (...) float32
        1 or more. Facilitation by faint masks (Foley 1994) is not modelled.
    """
    return np.sqrt(np.sqrt(_elevation_to_the_fourth(masker_jnd, mask_slope)))


def masked_difference_squared(
    difference_jnd: Float32Array, masker_jnd: Float32Array, mask_slope: float = MASK_SLOPE
) -> Float32Array:
    """Squared difference of a channel in JND after masking: J^2 = (abs(C' - C'') S / Te)^2.

    Parameters
    ----------
    difference_jnd : (...) float32
        abs(C' - C'') S, in units of the unmasked threshold. Overwritten with the result.
    masker_jnd : (...) float32
        Smaller of the two images' abs(C) S (mutual masking: Te grows with the mask, so the smaller
        mask gives the smaller Te).
    mask_slope : float
        As in `threshold_elevation`.

    Returns
    -------
    (...) float32
        `difference_jnd`, overwritten. The square, because pooling needs no root of it.
    """
    elevation = _elevation_to_the_fourth(masker_jnd, mask_slope)
    np.sqrt(elevation, out=elevation)
    np.multiply(difference_jnd, difference_jnd, out=difference_jnd)
    np.divide(difference_jnd, elevation, out=difference_jnd)
    return difference_jnd
