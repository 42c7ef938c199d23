"""Masking: a Gabor on a sine of the same frequency and orientation (Foley 1994).

The stimuli lasted 33 ms, too short for the full sensitivity that the metric assumes. One gain corrects for
this: contrasts are relative to the unmasked threshold, of the observers and of the metric. The comparison
therefore tests the shape of the masking curve; the unmasked threshold has no error by definition.
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

UNMASKED_DB = -31.67  # unmasked threshold of the observers, 20 log10 contrast
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
        Contrast of the mask in the experiment, 20 log10.
    observers_db : (N,) float64
        Contrast of the target at threshold, 20 log10.
    metric_db : (N,) float64
        That of the metric, after the gain.
    gain_db : float
        Unmasked threshold of the observers less that of the metric.
    """

    mask_db: Float64Array
    observers_db: Float64Array
    metric_db: Float64Array
    gain_db: float

    @property
    def error_db(self) -> Float64Array:
        """Error of each mask; positive where the metric masks too much."""
        return self.metric_db - self.observers_db

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
    """Thresholds of the metric on Foley's masks, beside those of the observers.

    Parameters
    ----------
    mode : Mode
        The metric.
    monitor : Monitor
        Shows the progress over the masks.
    """
    observer = mode.aqm(screen(SIZE_PX, PIXELS_PER_DEGREE))
    gabor, sine = gabor_and_sine()
    _, observers = read_columns("foley.csv", "mask_db", "threshold_db")
    unmasked_db = _db(threshold_contrast(observer, gabor, MEAN_CD_M2))
    gain_db = UNMASKED_DB - unmasked_db
    thresholds_db = []
    masks = list(zip(observers["mask_db"], observers["threshold_db"], strict=True))
    for mask_db, observed_db in counted(masks, f"masking, {mode.name}", monitor):
        mask, guess = (10.0 ** ((db - gain_db) / 20.0) for db in (mask_db, observed_db))
        contrast = threshold_contrast(observer, gabor, MEAN_CD_M2, mask=mask * sine, guess=guess)
        thresholds_db.append(_db(contrast) + gain_db)
    return Masking(observers["mask_db"], observers["threshold_db"], np.array(thresholds_db), gain_db)


def _db(contrast: float) -> float:
    return 20.0 * math.log10(contrast)
