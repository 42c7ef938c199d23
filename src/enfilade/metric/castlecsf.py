"""Contrast sensitivity by frequency, motion, luminance and size: castleCSF, its achromatic part.

Ashraf, Mantiuk, Chapiro and Wuerger 2024, "castleCSF - a contrast sensitivity function of color,
area, spatiotemporal frequency, luminance and eccentricity", Journal of Vision 24(4):5. Formulas and
constants are those of the authors' code (https://github.com/gfxdisp/castleCSF, MIT licence), for
luminance contrast at the fovea.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from enfilade.records import F64

SUSTAINED_EXPONENT = 1.3314  # no unit: fall of the sustained channel with temporal frequency
SUSTAINED_SCALE = 10.5795  # Hz^1.3314
TRANSIENT_EXPONENT = 0.1898  # no unit: width of the transient channel
TRANSIENT_SCALE = 0.0844836  # Hz^0.3796
TRANSIENT_PEAK_RISE_HZ = 2.41482  # a decade of luminance
TRANSIENT_PEAK_HZ = 4.7036  # at 1 cd/m2
LEAST_CD_M2 = 1e-4  # darker luminances are clipped to this


@dataclass(frozen=True)
class _Spatial:
    """Constants of one channel's fall with spatial frequency and size; see `_spatial`."""

    bandwidth: float
    truncation: float
    area_deg2: float
    corner_cpd: float


SUSTAINED = _Spatial(0.000213047, 0.100207, 157.103, 0.702338)
TRANSIENT = _Spatial(2.6761, 0.000241177, 3.81611, 3.01389)


def _spatial(of: _Spatial, peak: F64, peak_cpd: F64 | float, rho: F64, area: F64) -> F64:
    """Sensitivity of one channel, a log-parabola in frequency with area summation.

    S = peak lp rho sqrt(Ac / (1 + Ac / A)), Ac = A0 / (1 + (rho / f0)^2),
    lp = 10^(-(log10 rho - log10 peak_cpd)^2 / 2^bandwidth), not below 1 - truncation under peak_cpd.
    """
    parabola = 10.0 ** (-((np.log10(rho) - np.log10(peak_cpd)) ** 2) / 2.0**of.bandwidth)
    is_plateau = (rho < peak_cpd) & (parabola < 1.0 - of.truncation)
    parabola = np.where(is_plateau, 1.0 - of.truncation, parabola)
    critical = of.area_deg2 / (1.0 + (rho / of.corner_cpd) ** 2)
    result: F64 = peak * parabola * rho * np.sqrt(critical / (1.0 + critical / area))
    return result


def _arrays(*quantities: npt.ArrayLike) -> tuple[F64, ...]:
    return tuple(np.asarray(quantity, dtype=np.float64) for quantity in quantities)


def castlecsf_sensitivity(
    frequency_cpd: npt.ArrayLike,
    temporal_hz: npt.ArrayLike,
    luminance_cd_m2: npt.ArrayLike,
    area_deg2: npt.ArrayLike,
) -> F64:
    """Contrast sensitivity to a patch of grating that moves or flickers (castleCSF, achromatic).

    The sum of `transient_sensitivity` and a sustained channel with the temporal response
    exp(-w^1.3314 / 10.5795).

    Parameters
    ----------
    frequency_cpd : array_like
        Spatial frequency rho, above 0.
    temporal_hz : array_like
        Temporal frequency w on the screen for an eye at rest, 0 or more: v rho for a pattern that
        moves at v degrees per second. The eye's own drift is part of the measurements.
    luminance_cd_m2 : array_like
        Adapting luminance L; measured from 0.0002 to 10 000 cd/m2.
    area_deg2 : array_like
        Area A of the patch, square degrees; of a Gabor pi sigma^2.

    Returns
    -------
    array of float64
        1 / (threshold contrast of luminance), broadcast over the arguments.
    """
    rho, hertz, luminance, area = _arrays(frequency_cpd, temporal_hz, luminance_cd_m2, area_deg2)
    luminance = np.maximum(luminance, LEAST_CD_M2)
    peak = 56.4947 * (1.0 + 7.54726 / luminance) ** -0.144532
    peak *= -np.expm1(-9.66862e9 * np.log1p(5.58341e-7 / luminance))  # 1 - (1 + k2 / L)^-k3
    peak_cpd = 1.78119 * (1.0 + 91.5718 / luminance) ** -0.256682
    response = np.exp(-(hertz**SUSTAINED_EXPONENT) / SUSTAINED_SCALE)
    sustained = response * _spatial(SUSTAINED, peak, peak_cpd, rho, area)
    return sustained + transient_sensitivity(rho, hertz, luminance, area)


def transient_sensitivity(
    frequency_cpd: npt.ArrayLike,
    temporal_hz: npt.ArrayLike,
    luminance_cd_m2: npt.ArrayLike,
    area_deg2: npt.ArrayLike,
) -> F64:
    """Sensitivity of the transient channel; arguments and result as in `castlecsf_sensitivity`.

    The temporal response is exp(-(w^0.1898 - w0^0.1898)^2 / 0.0844836), w0 = 2.41482 log10 L +
    4.7036 Hz: 9.5 Hz at 100 cd/m2, close to nothing at 0 Hz.
    """
    rho, hertz, luminance, area = _arrays(frequency_cpd, temporal_hz, luminance_cd_m2, area_deg2)
    luminance = np.maximum(luminance, LEAST_CD_M2)
    peak = 2748.09 * luminance**0.193434
    peak_hz = np.maximum(TRANSIENT_PEAK_RISE_HZ * np.log10(luminance) + TRANSIENT_PEAK_HZ, 0.0)
    distance = hertz**TRANSIENT_EXPONENT - peak_hz**TRANSIENT_EXPONENT
    response = np.exp(-(distance**2) / TRANSIENT_SCALE)
    return response * _spatial(TRANSIENT, peak, 0.000316696, rho, area)
