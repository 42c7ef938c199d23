"""Detection thresholds of the metric: the contrast at which a target becomes visible.

The response is the maximum of the map of visible differences, pooled over channels. The threshold is the
contrast at which the response is 1 JND, which is detected in 75 % of trials.
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

CLOSE_DB = 0.05  # accuracy of a threshold
MOST_STEPS = 12
MOST_DECREMENT = 0.98  # a target removes at most this share of the luminance
FAINTEST_JND = 1e-12  # keeps the logarithm finite where nothing is visible


def response_jnd(observer: Aqm, test: Float32Array, background: Float32Array) -> float:
    """Response of the metric: the maximum of the map, JND.

    Parameters
    ----------
    observer : Aqm
        The metric, for images of this size.
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
    """Contrast of a target at threshold, where the response is 1 JND.

    The root of log J over log contrast is found by the secant method, in two or three steps, since J is
    nearly proportional to contrast.

    Parameters
    ----------
    observer : Aqm
        The metric, for images of this size.
    pattern : (H, W) float64
        The target at contrast 1: relative deviation from the mean.
    mean_cd_m2 : float
        Luminance of the surround.
    mask : (H, W) float64 or 0
        The mask under the target: relative deviation from the mean.
    guess : float
        First contrast of the search.

    Returns
    -------
    float
        Above 1 for targets beyond the range of the display: luminance is not negative, so the last secant
        is extrapolated.
    """
    background = (mean_cd_m2 * (1.0 + np.broadcast_to(mask, pattern.shape))).astype(np.float32)
    floor = 1.0 + np.min(np.broadcast_to(mask, pattern.shape))
    limit = math.log(MOST_DECREMENT * floor / max(-float(pattern.min()), 1e-9))

    def log_response(at: float) -> float:
        target = (mean_cd_m2 * math.exp(at) * pattern).astype(np.float32)
        return math.log(max(response_jnd(observer, background + target, background), FAINTEST_JND))

    log_contrast = min(math.log(guess), limit)
    log_jnd, slope = log_response(log_contrast), 1.0
    for _ in range(MOST_STEPS):
        step = -log_jnd / slope
        next_log = min(log_contrast + step, limit)
        if abs(next_log - log_contrast) * 20.0 / math.log(10.0) < CLOSE_DB:
            return math.exp(log_contrast + step)
        response = log_response(next_log)
        slope = float(np.clip((response - log_jnd) / (next_log - log_contrast), 0.2, 5.0))
        log_contrast, log_jnd = next_log, response
    return math.exp(log_contrast - log_jnd / slope)
