"""Amplitude nonlinearity: the retina's response to luminance (Daly 1993; first stage of Fig. 6)."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

__all__ = ["contrast_shrinkage", "response"]

Float32Array: TypeAlias = npt.NDArray[np.float32]

RESPONSE_MAX = 100.0  # no unit: what an infinite luminance would give; cancels in contrasts
SEMI_SATURATION = 12.6  # (cd/m2)^0.37 (Daly 1993)
SEMI_SATURATION_EXPONENT = 0.63  # no unit (Daly 1993)
COMPRESSION = 1.0 - SEMI_SATURATION_EXPONENT


def response(luminance_cd_m2: Float32Array) -> Float32Array:
    """Response of the adapted retina: R = Lmax L / (L + 12.6 L^0.63), Lmax = 100 (Daly 1993).

    Parameters
    ----------
    luminance_cd_m2 : (...) float32
        Luminance L, cd/m2, 0 or more.

    Returns
    -------
    (...) float32
        0 at black, towards 100 for very bright light. Written as L^0.37 / (L^0.37 + 12.6), which
        is defined at 0.
    """
    compressed = luminance_cd_m2 ** np.float32(COMPRESSION)
    return np.float32(RESPONSE_MAX) * compressed / (compressed + np.float32(SEMI_SATURATION))


def contrast_shrinkage(luminance_cd_m2: float) -> float:
    """How much smaller a small contrast is in the response than in luminance: d ln R / d ln L.

    g = 0.37 12.6 L^0.63 / (L + 12.6 L^0.63): 0.298 at 20 and 0.258 at 100 cd/m2. Sensitivities are
    measured as luminance contrast, so contrasts of the response are divided by g; without that the
    metric is 11 to 12 dB too insensitive.

    Parameters
    ----------
    luminance_cd_m2 : float
        Luminance L that the eye is adapted to, cd/m2, 0 or more.

    Returns
    -------
    float
        Between 0 and 0.37.
    """
    compressed: float = luminance_cd_m2**COMPRESSION
    return COMPRESSION * SEMI_SATURATION / (compressed + SEMI_SATURATION)
