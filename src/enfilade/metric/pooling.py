"""Pooling across channels, probability of detection, shares and scores (§3.4, §6; Fig. 6)."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

__all__ = [
    "DETECTION_JND",
    "POOLING_EXPONENT",
    "detection_probability",
    "percent_visible",
    "raised",
    "root",
]

BoolArray: TypeAlias = npt.NDArray[np.bool_]
Float32Array: TypeAlias = npt.NDArray[np.float32]

POOLING_EXPONENT = 3.5  # b, no unit: slope of the psychometric function (Daly 1993)
MISS_AT_ONE_JND = 0.25  # §6: 1 JND is seen in 75 % of cases
DETECTION_JND = 1.0  # §6: where the paper counts a difference as visible


def raised(squared: Float32Array) -> Float32Array:
    """J^3.5 from J^2, as x sqrt(x) sqrt(sqrt(x)): pooling's inner power, without logarithms.

    Parameters
    ----------
    squared : (...) float32
        J^2, 0 or more.

    Returns
    -------
    (...) float32
        J^3.5.
    """
    rooted = np.sqrt(squared)
    power = squared * rooted
    power *= np.sqrt(rooted, out=rooted)
    return power


def root(pooled: Float32Array, exponent: float = POOLING_EXPONENT) -> Float32Array:
    """J = (sum of J_kl^b)^(1/b) from the sum.

    Parameters
    ----------
    pooled : (...) float32
        Sum over channels of J_kl^b, 0 or more.
    exponent : float
        b, 3.5 in the paper.

    Returns
    -------
    (...) float32
        JND.
    """
    return pooled if exponent == 1.0 else pooled ** np.float32(1.0 / exponent)


def detection_probability(jnd: Float32Array) -> Float32Array:
    """Probability that the difference is seen: P = 1 - 0.25^J, 75 % at 1 and 93.75 % at 2 JND (§6).

    Parameters
    ----------
    jnd : (...) float32
        J, pooled over all channels, 0 or more.

    Returns
    -------
    (...) float32
        Between 0 and 1; exactly 0 at 0 JND.
    """
    probability = -np.expm1(jnd * np.float32(np.log(MISS_AT_ONE_JND)))
    return np.asarray(probability, dtype=np.float32)


def percent_visible(jnd: Float32Array, valid: BoolArray) -> float:
    """Share of the judged pixels that differ by more than 1 JND, in percent (§3.4).

    Parameters
    ----------
    jnd : (H, W) float32
        The map.
    valid : (H, W) bool
        Pixels that were judged.

    Returns
    -------
    float
        0 to 100; 0 when nothing was judged.
    """
    judged = int(np.count_nonzero(valid))
    seen = int(np.count_nonzero((jnd > DETECTION_JND) & valid))
    return 100.0 * seen / judged if judged else 0.0
