"""Detection thresholds of the metric: the contrast at which a target becomes visible.

The response is the largest value of the map of visible differences, pooled over channels, in any frame. The
threshold is the contrast at which the response is 1 JND, which is detected in 75 % of trials.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from enfilade.metric import Aqm, SequenceAqm
from enfilade.records import F32, F64

CLOSE_DB = 0.05  # accuracy of a threshold
MOST_STEPS = 12
MOST_DECREMENT = 0.98  # a target removes at most this share of the luminance
FAINTEST_JND = 1e-12  # keeps the logarithm finite where nothing is visible


def rms_db(errors_db: F64) -> float:
    """Root of the mean square of errors, dB."""
    return float(np.sqrt(np.mean(errors_db**2)))


def response_jnd(observer: Aqm, test: F32, background: F32) -> float:
    """Response of the metric to an image: the maximum of the map, JND.

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
    pattern: F64,
    mean_cd_m2: float,
    *,
    mask: F64 | float = 0.0,
    guess: float = 0.01,
) -> float:
    """Contrast of a target in an image at threshold.

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
    floor = 1.0 + float(np.min(np.broadcast_to(mask, pattern.shape)))

    def response(contrast: float) -> float:
        target = (mean_cd_m2 * contrast * pattern).astype(np.float32)
        return response_jnd(observer, background + target, background)

    return _contrast_at_1_jnd(response, MOST_DECREMENT * floor / _depth([pattern]), guess)


def sequence_threshold(
    observer: Aqm,
    patterns: Sequence[F64],
    mean_cd_m2: float,
    *,
    step_px: float = 0.0,
    guess: float = 0.01,
) -> float:
    """Contrast of a target in a sequence at threshold, on a uniform background.

    Parameters
    ----------
    observer : Aqm
        The metric, for images of this size and the display's frame rate.
    patterns : sequence of (H, W) float64
        The target in each frame at contrast 1: relative deviation from the mean.
    mean_cd_m2 : float
        Luminance of the background.
    step_px : float
        Motion of the target to the right, pixels per frame.
    guess : float
        First contrast of the search.

    Returns
    -------
    float
        As `threshold_contrast`.
    """
    background = np.full(patterns[0].shape, mean_cd_m2, dtype=np.float32)
    flow_px = None
    if step_px:
        flow_px = np.zeros((*background.shape, 2), dtype=np.float32)
        flow_px[..., 0] = -step_px

    def response(contrast: float) -> float:
        sequence, largest_jnd = SequenceAqm(observer), 0.0
        for pattern in patterns:
            test = (mean_cd_m2 * (1.0 + contrast * pattern)).astype(np.float32)
            comparison = sequence.compare(test, background, backward_flow_px=flow_px)
            largest_jnd = max(largest_jnd, float(comparison.jnd.max()))
        return largest_jnd

    return _contrast_at_1_jnd(response, MOST_DECREMENT / _depth(patterns), guess)


def _depth(patterns: Sequence[F64]) -> float:
    """Largest decrement of a target at contrast 1."""
    return max(-min(float(pattern.min()) for pattern in patterns), 1e-9)


def _contrast_at_1_jnd(response: Callable[[float], float], most: float, guess: float) -> float:
    """Root of log J over log contrast by the secant method.

    Two or three steps suffice, since J is nearly a power of contrast. Contrasts of evaluation are at most
    `most`.
    """

    def log_response(at: float) -> float:
        return math.log(max(response(math.exp(at)), FAINTEST_JND))

    limit = math.log(most)
    log_contrast = min(math.log(guess), limit)
    log_jnd, slope = log_response(log_contrast), 1.0
    for _ in range(MOST_STEPS):
        step = -log_jnd / slope
        next_log = min(log_contrast + step, limit)
        if abs(next_log - log_contrast) * 20.0 / math.log(10.0) < CLOSE_DB:
            return math.exp(log_contrast + step)
        log_jnd_there = log_response(next_log)
        slope = float(np.clip((log_jnd_there - log_jnd) / (next_log - log_contrast), 0.2, 5.0))
        log_contrast, log_jnd = next_log, log_jnd_there
    return math.exp(log_contrast - log_jnd / slope)
