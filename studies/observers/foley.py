"""Masking: a Gabor on a sine of the same frequency and orientation (Foley 1994).

Both were shown for 33 ms, too briefly for the full sensitivity that the metric has. One number makes up
for that: mask and target are shown to the metric in units of the threshold without a mask, people's and
its own. The comparison is then of the curve's shape, and no error is counted at the unmasked threshold.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.monitor import Monitor
from studies.observers.mode import Mode
from studies.observers.screen import screen
from studies.observers.tables import read_columns
from studies.observers.threshold import threshold_contrast
from studies.progress import counted

__all__ = ["UNMASKED_DB", "Masking", "gabor_and_sine", "measure"]

Float64Array: TypeAlias = npt.NDArray[np.float64]

UNMASKED_DB = -31.67  # people's threshold without a mask, 20 log10 contrast
FREQUENCY_CPD = 2.0
SIGMA_DEG = 0.5
MEAN_CD_M2 = 32.0
PIXELS_PER_DEGREE = 60.0
SIZE_PX = 240  # 4 degrees, 8 periods


@dataclass(frozen=True, eq=False)
class Masking:
    """Thresholds on masks.

    Attributes
    ----------
    mask_db : (N,) float64
        Contrast of the mask as shown to people, 20 log10.
    people_db : (N,) float64
        Contrast of the target at threshold, 20 log10.
    metric_db : (N,) float64
        The metric's, moved so that the unmasked thresholds agree.
    gain_db : float
        That move: people's unmasked threshold less the metric's.
    """

    mask_db: Float64Array
    people_db: Float64Array
    metric_db: Float64Array
    gain_db: float

    @property
    def error_db(self) -> Float64Array:
        """Of each mask; positive where the metric masks too much."""
        return self.metric_db - self.people_db

    @property
    def rms_db(self) -> float:
        """Root of the mean square of the errors."""
        return float(np.sqrt(np.mean(self.error_db**2)))


def gabor_and_sine() -> tuple[Float64Array, Float64Array]:
    """Target and mask at contrast 1, (240, 240) float64 each: in phase, bars upright."""
    steps = (np.arange(SIZE_PX) - SIZE_PX // 2) / PIXELS_PER_DEGREE
    x, y = np.meshgrid(steps, steps)
    sine = np.cos(2.0 * np.pi * FREQUENCY_CPD * x)
    return sine * np.exp(-0.5 * (x**2 + y**2) / SIGMA_DEG**2), sine


def measure(mode: Mode, monitor: Monitor) -> Masking:
    """Thresholds of the metric on Foley's masks, beside those of people.

    Parameters
    ----------
    mode : Mode
        The metric.
    monitor : Monitor
        Is told of each mask.
    """
    observer = mode.aqm(screen(SIZE_PX, PIXELS_PER_DEGREE))
    gabor, sine = gabor_and_sine()
    _, people = read_columns("foley.csv", "mask_db", "threshold_db")
    alone_db = _db(threshold_contrast(observer, gabor, MEAN_CD_M2))
    gain_db = UNMASKED_DB - alone_db
    found = []
    masks = list(zip(people["mask_db"], people["threshold_db"], strict=True))
    for mask_db, known_db in counted(masks, f"masking, {mode.name}", monitor):
        mask, guess = (10.0 ** ((db - gain_db) / 20.0) for db in (mask_db, known_db))
        contrast = threshold_contrast(observer, gabor, MEAN_CD_M2, mask=mask * sine, guess=guess)
        found.append(_db(contrast) + gain_db)
    return Masking(people["mask_db"], people["threshold_db"], np.array(found), gain_db)


def _db(contrast: float) -> float:
    return 20.0 * math.log10(contrast)
