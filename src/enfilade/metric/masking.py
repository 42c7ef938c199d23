"""Visual masking by threshold elevation (Fig. 6; Daly 1993, Eriksson et al. 1998)."""

from __future__ import annotations

import numpy as np

from enfilade.errors import InputError
from enfilade.records import F32

MASK_SLOPE = 0.7  # s, no unit; Daly 1993 for low frequencies and coherent masks
MASK_SHARPNESS = 4.0  # b, no unit (Daly 1993)
LEARNING = 0.7  # Q, no unit: the slope for which k1 and k2 are chosen (Daly 1993)
BEND = 6.0  # no unit: scale of the bend (Daly 1993)
K2 = BEND ** (1.0 / (1.0 - LEARNING))
K1 = BEND ** (1.0 - 1.0 / (1.0 - LEARNING))

DARKEST_MASKER = 1e-20  # keeps the logarithm finite; elevates no threshold


def check_mask_slope(mask_slope: float) -> None:
    """Raise InputError unless a slope of masking is from 0 to 1."""
    if not 0.0 <= mask_slope <= 1.0:
        raise InputError(f"metric: mask_slope is {mask_slope!r}; give a number from 0 to 1")


def threshold_elevation(masker_jnd: F32, mask_slope: float = MASK_SLOPE) -> F32:
    """Factor by which a mask in the same channel raises the threshold (Daly 1993).

    Te = (1 + (k1 (k2 m)^s)^b)^(1/b), b = 4, k1 = 6^(1 - 1/(1 - Q)), k2 = 6^(1/(1 - Q)), Q = 0.7.

    Parameters
    ----------
    masker_jnd : (...) float32
        Contrast of the mask in units of its own threshold, m = abs(C) S, 0 or more.
    mask_slope : float
        Slope s of the rise on logarithmic axes, 0 to 1. Daly 1993 has 0.7 in the base band up to 1 in
        the fine ones; with masks that are not noise, 1 overestimates masking by 16 dB.

    Returns
    -------
    (...) float32
        1 or more. Facilitation by faint masks (Foley 1994) is not modelled.
    """
    log_masker = np.log(np.maximum(masker_jnd, np.float32(DARKEST_MASKER)))
    log_masker *= np.float32(MASK_SHARPNESS * mask_slope)
    log_masker += np.float32(MASK_SHARPNESS * (np.log(K1) + mask_slope * np.log(K2)))
    elevation = np.exp(log_masker, out=log_masker)
    elevation += np.float32(1.0)
    return np.sqrt(np.sqrt(elevation, out=elevation), out=elevation)
