"""Amplitude nonlinearity: the retina's response to luminance (Daly 1993; first stage of Fig. 6)."""

from __future__ import annotations

import numpy as np

from enfilade.records import F32

RESPONSE_MAX = 100.0  # no unit: the response to infinite luminance; cancels in contrasts
SEMI_SATURATION = 12.6  # (cd/m2)^0.37 (Daly 1993)
COMPRESSION = 1.0 - 0.63  # no unit (Daly 1993)


def response(luminance_cd_m2: F32) -> F32:
    """Response of the adapted retina to L >= 0 cd/m2, R = 100 L / (L + 12.6 L^0.63) (Daly 1993).

    0 at black, towards 100 for very bright light. Computed as 100 L^0.37 / (L^0.37 + 12.6), which is
    defined at 0.
    """
    compressed = luminance_cd_m2 ** np.float32(COMPRESSION)
    return np.float32(RESPONSE_MAX) * compressed / (compressed + np.float32(SEMI_SATURATION))


def contrast_gain(luminance_cd_m2: float) -> float:
    """Ratio of a small contrast of the response to that of the luminance, d ln R / d ln L, 0 to 0.37.

    g = 0.37 12.6 L^0.63 / (L + 12.6 L^0.63): 0.298 at 20 and 0.258 at 100 cd/m2. Sensitivities are
    measured for luminance contrast, so contrasts of the response are divided by g; without that the
    metric is 11 to 12 dB too insensitive.
    """
    compressed: float = luminance_cd_m2**COMPRESSION
    return COMPRESSION * SEMI_SATURATION / (compressed + SEMI_SATURATION)
