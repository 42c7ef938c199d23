"""The contrast at which the metric says that an observer sees a target: its threshold.

The decision: an observer sees a difference when somewhere on the map, the channels pooled, it is 1 JND,
which 75 % detect. The largest value of the map is the observer's response.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.metric import Aqm

__all__ = ["response_jnd", "threshold_contrast"]

Float32Array: TypeAlias = npt.NDArray[np.float32]
Float64Array: TypeAlias = npt.NDArray[np.float64]

CLOSE_DB = 0.05  # a threshold is this near
MOST_STEPS = 12
DARKEST = 0.98  # a target takes away at most this share of the light
FAINTEST_JND = 1e-12  # keeps the logarithm finite where nothing is seen


def response_jnd(observer: Aqm, test: Float32Array, background: Float32Array) -> float:
    """The observer's response: the largest value of the map, JND.

    Parameters
    ----------
    observer : Aqm
        The metric, for this size of image.
    test, background : (H, W) float32
        cd/m2.
    """
    return float(observer.compare(test, background).jnd.max())


def threshold_contrast(
    observer: Aqm,
    pattern: Float64Array,
    mean_cd_m2: float,
    *,
    mask: Float64Array | float = 0.0,
    guess: float = 0.01,
) -> float:
    """Contrast of a target that an observer sees in 75 % of cases: where the response is 1 JND.

    The root of log J over log contrast by secants, which needs two or three steps, since J is nearly
    proportional to contrast.

    Parameters
    ----------
    observer : Aqm
        The metric, for this size of image.
    pattern : (H, W) float64
        The target at contrast 1: relative deviation from the mean.
    mean_cd_m2 : float
        Luminance of the screen around it.
    mask : (H, W) float64 or 0
        Relative deviation from the mean of what lies under the target.
    guess : float
        Where to begin.

    Returns
    -------
    float
        Above 1 for a target that can't be shown: light is not negative, so beyond what can be shown
        the last secant is followed.
    """
    background = (mean_cd_m2 * (1.0 + np.broadcast_to(mask, pattern.shape))).astype(np.float32)
    room = 1.0 + np.min(np.broadcast_to(mask, pattern.shape))
    most = math.log(DARKEST * room / max(-float(pattern.min()), 1e-9))

    def log_response(log_contrast: float) -> float:
        target = (mean_cd_m2 * math.exp(log_contrast) * pattern).astype(np.float32)
        return math.log(max(response_jnd(observer, background + target, background), FAINTEST_JND))

    at = min(math.log(guess), most)
    found, slope = log_response(at), 1.0
    for _ in range(MOST_STEPS):
        step = -found / slope
        aim = min(at + step, most)
        if abs(aim - at) * 20.0 / math.log(10.0) < CLOSE_DB:
            return math.exp(at + step)
        there = log_response(aim)
        slope = float(np.clip((there - found) / (aim - at), 0.2, 5.0))
        at, found = aim, there
    return math.exp(at - found / slope)
