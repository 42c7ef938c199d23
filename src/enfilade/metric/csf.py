"""Spatiovelocity contrast sensitivity (§3.2, Eq. 4: Kelly 1979, constants of Daly 1998)."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
import numpy.typing as npt

Quantity = TypeVar("Quantity", float, npt.NDArray[np.float32], npt.NDArray[np.float64])

C0 = 1.14  # no unit: scales sensitivity to displays of 100 cd/m2 (Daly 1998)
C1 = 0.67  # no unit: scales spatial frequency (Daly 1998)
C2 = 1.7  # no unit: scales velocity (Daly 1998)

# Kelly 1979, as the paper's Eq. 4 writes it; the logarithm is to base 10.
LEVEL = 6.1
LEVEL_RISE = 7.3
KNEE_DEG_S = 3.0
DECAY_OFFSET_DEG_S = 2.0
DECAY = 45.9


def spatiovelocity_sensitivity(
    frequency_cpd: float | npt.NDArray[np.float64], velocity_deg_s: Quantity
) -> Quantity:
    """Contrast sensitivity to a grating that moves over the retina (Eq. 4).

    S = c0 (6.1 + 7.3 abs(log10(c2 v / 3))^3) c2 v (2 pi c1 rho)^2
    exp(-4 pi c1 rho (c2 v + 2) / 45.9)

    Parameters
    ----------
    frequency_cpd : float or array
        Spatial frequency rho, 0 or more.
    velocity_deg_s : float or array
        Retinal velocity v along the grating's frequency vector, above 0. The fit is not valid below the
        eye's drift of 0.15 deg/s, see `metric.eye`.

    Returns
    -------
    float or array, like `velocity_deg_s`
        1 / (threshold contrast of luminance), for displays of about 100 cd/m2.

    Notes
    -----
    Against observers it falls off too early for fast fine patterns (Laird et al. 2006 measured more),
    and it depends neither on luminance nor on size. It is kept as published.
    """
    speed = velocity_deg_s * C2
    decades = np.abs(np.log10(speed / KNEE_DEG_S))
    level = (decades * decades * decades * LEVEL_RISE + LEVEL) * speed
    rise = C0 * (2.0 * math.pi * C1 * frequency_cpd) ** 2
    decay = 4.0 * math.pi * C1 * frequency_cpd / DECAY
    sensitivity: Quantity = level * np.exp((speed + DECAY_OFFSET_DEG_S) * -decay) * rise
    return sensitivity
