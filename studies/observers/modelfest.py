"""ModelFest: thresholds of 16 observers for small static targets (Watson and Ahumada 2005).

41 of the 43 targets have a formula; numbers 35 (noise) and 43 (a photograph) are images, and are left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.special

from enfilade.monitor import Monitor
from enfilade.records import F64
from studies.observers.mode import Mode
from studies.observers.screen import plane, screen
from studies.observers.tables import read_columns
from studies.observers.threshold import rms_db, threshold_contrast
from studies.progress import counted

PIXELS_PER_DEGREE = 120.0
SIZE_PX = 256
MEAN_CD_M2 = 30.0
WIDE_DEG = 0.5  # Gaussian sigma of most targets
ARCMIN = 1.0 / 60.0
IMAGES = (35, 43)
HIGHEST_CPD = 12.0  # of the Gabors that are evaluated without a gain: range of the metric's bands
COUNT = 43

# The tables below: number of the target, then its parameters.
GABORS = {  # frequency cpd, sigma across x, sigma across y (degrees); bars horizontal
    **{n: (f, 0.5, 0.5) for n, f in enumerate((1.12, 2.0, 2.83, 4.0, 5.66, 8.0, 11.3, 16.0, 22.6, 30.0), 1)},
    **{n: (f, s, s) for n, f, s in ((11, 2.0, 0.28), (12, 4.0, 0.14), (13, 8.0, 0.07), (14, 16.0, 0.035))},
    **{n: (f, 0.5, s) for n, f, s in ((15, 4.0, 0.28), (16, 8.0, 0.14), (17, 16.0, 0.07))},
    **{
        n: (4.0, *s)
        for n, s in ((18, (0.28, 0.14)), (19, (0.5, 0.14)), (20, (0.14, 0.28)), (21, (0.14, 0.5)))
    },
}
COMPOUNDS = {22: (2.0, 2.0 * math.sqrt(2.0)), 23: (2.0, 4.0), 24: (4.0, 4.0 * math.sqrt(2.0)), 25: (4.0, 8.0)}
BLOBS = {26: 30.0, 27: 8.43, 28: 2.106, 29: 1.05}  # sigma, minutes of arc
TILTED = {36: (45.0,), 37: (0.0,), 38: (45.0, 90.0), 39: (0.0, 90.0)}  # normals of the bars; means of them


@dataclass(frozen=True, eq=False)
class Thresholds:
    """Sensitivity of the observers and of the metric to a set of targets.

    Attributes
    ----------
    number : (N,) int64
        Number of the target.
    observers_db, metric_db : (N,) float64
        -20 log10 of the contrast at threshold.
    spread_db : (N,) float64
        Standard deviation between observers.
    """

    number: npt.NDArray[np.int64]
    observers_db: F64
    metric_db: F64
    spread_db: F64

    @property
    def gain_db(self) -> float:
        """Mean sensitivity of the observers over that of the metric: the one fitted number."""
        return float(np.mean(self.observers_db - self.metric_db))

    @property
    def error_db(self) -> F64:
        """Error of each target after the gain; positive where the metric is too sensitive."""
        return self.metric_db + self.gain_db - self.observers_db

    @property
    def rms_db(self) -> float:
        """Root of the mean square of the errors, after the gain."""
        return rms_db(self.error_db)

    @property
    def cross_validation_rms_db(self) -> float:
        """The same, each target with the gain of the other targets."""
        count = len(self.number)
        return self.rms_db * count / (count - 1)

    @property
    def gabors_rms_db(self) -> float:
        """Root of the mean square of the errors of round Gabors up to 12 cpd, without a gain."""
        is_round = [n for n, (cpd, *sigma) in GABORS.items() if sigma[0] == sigma[1] and cpd <= HIGHEST_CPD]
        return rms_db((self.metric_db - self.observers_db)[np.isin(self.number, is_round)])


def _gauss(x: F64, y: F64, sigma_x: float, sigma_y: float) -> F64:
    return np.exp(-0.5 * ((x / sigma_x) ** 2 + (y / sigma_y) ** 2))


def _wave(x: F64, y: F64, cpd: float, normal_deg: float = 90.0) -> F64:
    theta = math.radians(normal_deg)
    return np.cos(2.0 * np.pi * cpd * (x * math.cos(theta) + y * math.sin(theta)))


def _collinear(x: F64, y: F64, sign: float) -> F64:
    sigma, spacing = 0.07, 5.0 * 0.07
    total = np.zeros_like(x)
    for index in range(-2, 3):
        total += sign**index * _gauss(x - index * spacing, y, sigma, sigma)
    total *= _wave(x, y, 8.0)
    return total


def _row(y: F64, row: int) -> F64:
    """1 on one row of pixels, counted down from the centre."""
    return np.where(np.round(y * PIXELS_PER_DEGREE) == row, 1.0, 0.0)


def _disc(x: F64, y: F64) -> F64:
    return np.where(np.hypot(x, y) <= 0.125, 1.0, 0.0)


def _checks(x: F64, y: F64) -> F64:
    across, down = (_wave(x, y, 4.0 / math.sqrt(2.0), normal) for normal in (0.0, 90.0))
    return np.where(across * down >= 0.0, 1.0, -1.0)


# Profiles under the wide Gaussian window, and targets without a window.
WINDOWED: dict[int, Callable[[F64, F64], F64]] = {
    30: lambda _, y: np.where(y >= 0.0, 1.0, -1.0),
    31: lambda _, y: _row(y, 0),
    32: lambda _, y: _row(y, 0) - _row(y, 1),
    41: lambda x, y: scipy.special.j0(2.0 * np.pi * 4.0 * np.hypot(x, y)),
    42: _checks,
}
WHOLE: dict[int, Callable[[F64, F64], F64]] = {
    33: lambda x, y: _collinear(x, y, 1.0),
    34: lambda x, y: _collinear(x, y, -1.0),
    40: _disc,
}


def target(number: int) -> F64:
    """One target at contrast 1.

    Parameters
    ----------
    number : int
        1 to 43, without 35 and 43.

    Returns
    -------
    (256, 256) float64
        Relative deviation from the mean luminance, -1 to 1.
    """
    x, y = plane(SIZE_PX, PIXELS_PER_DEGREE)
    if number in GABORS:
        cpd, sigma_x, sigma_y = GABORS[number]
        return _wave(x, y, cpd) * _gauss(x, y, sigma_x, sigma_y)
    if number in COMPOUNDS:
        low, high = (_wave(x, y, cpd) for cpd in COMPOUNDS[number])
        return 0.5 * (low + high) * _gauss(x, y, WIDE_DEG, WIDE_DEG)
    if number in BLOBS:
        return _gauss(x, y, BLOBS[number] * ARCMIN, BLOBS[number] * ARCMIN)
    if number in TILTED:
        normals = TILTED[number]
        waves = sum((_wave(x, y, 4.0, normal) for normal in normals), np.zeros_like(x))
        return waves / len(normals) * _gauss(x, y, 0.14, 0.14)
    if number in WINDOWED:
        return WINDOWED[number](x, y) * _gauss(x, y, WIDE_DEG, WIDE_DEG)
    return WHOLE[number](x, y)


def measure(mode: Mode, monitor: Monitor) -> Thresholds:
    """Thresholds of the metric for the 41 targets, beside those of the observers.

    Parameters
    ----------
    mode : Mode
        The metric.
    monitor : Monitor
        Shows the progress over the targets.

    Returns
    -------
    Thresholds
        In the order of the targets' numbers.
    """
    observer = mode.aqm(screen(SIZE_PX, PIXELS_PER_DEGREE))
    _, observers = read_columns("modelfest.csv", "target", "sensitivity_db", "spread_db")
    numbers = observers["target"].astype(np.int64)
    chosen = ~np.isin(numbers, IMAGES)
    numbers, observers_db = numbers[chosen], observers["sensitivity_db"][chosen]
    sensitivities_db = []
    targets = list(zip(numbers, observers_db, strict=True))
    for number, observed_db in counted(targets, f"ModelFest, {mode.name}", monitor):
        guess = 10.0 ** (-observed_db / 20.0)
        contrast = threshold_contrast(observer, target(int(number)), MEAN_CD_M2, guess=guess)
        sensitivities_db.append(-20.0 * math.log10(contrast))
    return Thresholds(numbers, observers_db, np.array(sensitivities_db), observers["spread_db"][chosen])
