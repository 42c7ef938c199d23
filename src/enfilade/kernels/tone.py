"""Linear radiance to display luminance: sRGB transfer (IEC 61966-2-1) and the display.

The metric compares images as the viewer sees them: after the view transform of the video (exposure, sRGB
encoding, clipping at white) and the display, which undoes the encoding. The method `paper` assumes this
transform also for videos with a view of an OpenColorIO configuration, which may compress highlights and
shadows differently; comparisons apply that view (:mod:`enfilade.comparison.views`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from enfilade.errors import InputError
from enfilade.records import F32

REC709_LUMINANCE = (0.2126, 0.7152, 0.0722)  # ITU-R BT.709-6, item 3.2; R, G, B

SRGB_LINEAR_LIMIT = 0.0031308  # IEC 61966-2-1; linear below this linear value
SRGB_ENCODED_LIMIT = 0.04045  # IEC 61966-2-1; the same point, encoded
SRGB_SLOPE = 12.92  # IEC 61966-2-1
SRGB_OFFSET = 0.055  # IEC 61966-2-1
SRGB_GAMMA = 2.4  # IEC 61966-2-1


def srgb_encode(linear: F32) -> F32:
    """Encode linear values for an sRGB video or image (OETF), without clipping.

    Parameters
    ----------
    linear : (...) float32
        Linear values, 1 = white. Negative values lie on the linear segment.

    Returns
    -------
    (...) float32
        Encoded values, 1 = white.

    Notes
    -----
    Source: IEC 61966-2-1.
    """
    power = np.maximum(linear, SRGB_LINEAR_LIMIT) ** np.float32(1.0 / SRGB_GAMMA)
    curved = (1.0 + SRGB_OFFSET) * power - SRGB_OFFSET
    encoded: F32 = np.where(linear <= SRGB_LINEAR_LIMIT, SRGB_SLOPE * linear, curved)
    return encoded


def srgb_decode(encoded: F32) -> F32:
    """Linear light of encoded values on an sRGB display (EOTF), without clipping.

    Parameters
    ----------
    encoded : (...) float32
        Encoded values, 1 = white. Negative values lie on the linear segment.

    Returns
    -------
    (...) float32
        Linear values, 1 = white.

    Notes
    -----
    Source: IEC 61966-2-1.
    """
    shifted = (np.maximum(encoded, SRGB_ENCODED_LIMIT) + SRGB_OFFSET) / (1.0 + SRGB_OFFSET)
    curved = shifted ** np.float32(SRGB_GAMMA)
    linear: F32 = np.where(encoded <= SRGB_ENCODED_LIMIT, encoded / SRGB_SLOPE, curved)
    return linear


def compressed(exposed: Any, white: Any) -> Any:
    """Luminances (...) by the extended curve of Reinhard et al. 2002 (Eq. 4); those of `white` become 1."""
    return exposed * (1.0 + exposed / white**2) / (1.0 + exposed)


def luminance(linear_rgb: F32) -> F32:
    """Relative luminance of linear Rec.709 colours (ITU-R BT.709-6).

    Parameters
    ----------
    linear_rgb : (..., 3) float32
        Linear R, G, B.

    Returns
    -------
    (...) float32
        0.2126 R + 0.7152 G + 0.0722 B.

    Raises
    ------
    InputError
        The last axis is not three long.
    """
    if linear_rgb.ndim == 0 or linear_rgb.shape[-1] != len(REC709_LUMINANCE):
        msg = f"luminance: expected linear RGB of shape (..., 3), got {linear_rgb.shape}"
        raise InputError(msg)
    weights = np.asarray(REC709_LUMINANCE, dtype=np.float32)
    return np.asarray(linear_rgb @ weights, dtype=np.float32)


def display_luminance(linear_rgb: F32, *, exposure_ev: float, peak_cd_m2: float, black_cd_m2: float) -> F32:
    """Luminance of a linear image on the display.

    Exposure, sRGB encoding, clipping to the encodable range, decoding by the display, peak and black.
    Encoding and decoding cancel, so that only the clipping remains; rounding to 8 bits is left out.

    Parameters
    ----------
    linear_rgb : (..., 3) float32
        Scene-linear Rec.709 radiance, 1 = white at exposure 0.
    exposure_ev : float
        Exposure in stops: +1 doubles.
    peak_cd_m2, black_cd_m2 : float
        Luminance of white and of black on the display, cd/m2.

    Returns
    -------
    (...) float32
        cd/m2, between black and peak. NaN stays NaN; the metric refuses it.

    Raises
    ------
    InputError
        The last axis is not three long.
    """
    shown = np.clip(linear_rgb * np.float32(2.0**exposure_ev), 0.0, 1.0)
    return luminance(shown) * np.float32(peak_cd_m2 - black_cd_m2) + np.float32(black_cd_m2)
