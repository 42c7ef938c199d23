"""Masking: a Gabor on a sine of the same frequency, at 0, 45 or 90 degrees to it (Foley 1994).

The stimuli lasted 33 ms, too short for the full sensitivity that the metric assumes. One gain corrects for
this: contrasts are relative to the unmasked threshold, of the observers and of the metric. The comparison
therefore tests the shape of the masking curves; the unmasked threshold has no error by definition.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enfilade.monitor import Monitor
from enfilade.records import F64
from studies.observers.mode import Mode
from studies.observers.screen import plane, screen
from studies.observers.tables import read_columns
from studies.observers.threshold import rms_db, threshold_contrast
from studies.progress import counted

ANGLES_DEG = (0, 45, 90)  # between the bars of mask and target
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

    mask_db: F64
    observers_db: F64
    metric_db: F64
    gain_db: float

    @property
    def error_db(self) -> F64:
        """Error of each mask; positive where the metric masks too much."""
        return self.metric_db - self.observers_db

    @property
    def rms_db(self) -> float:
        """Root of the mean square of the errors."""
        return rms_db(self.error_db)


def sine(angle_deg: float = 0.0) -> F64:
    """Mask at contrast 1, (240, 240) float64: in phase with the target, upright bars turned by an angle."""
    x, y = plane(SIZE_PX, PIXELS_PER_DEGREE)
    theta = math.radians(angle_deg)
    return np.cos(2.0 * np.pi * FREQUENCY_CPD * (x * math.cos(theta) + y * math.sin(theta)))


def gabor() -> F64:
    """Target at contrast 1, (240, 240) float64: upright bars."""
    x, y = plane(SIZE_PX, PIXELS_PER_DEGREE)
    return sine() * np.exp(-0.5 * (x**2 + y**2) / SIGMA_DEG**2)


def measure(mode: Mode, monitor: Monitor, *, angle_deg: int = 0) -> Masking:
    """Thresholds of the metric on Foley's masks, beside those of the observers.

    Parameters
    ----------
    mode : Mode
        The metric.
    monitor : Monitor
        Shows the progress over the masks.
    angle_deg : int
        One of ANGLES_DEG.
    """
    observer = mode.aqm(screen(SIZE_PX, PIXELS_PER_DEGREE))
    target, grating = gabor(), sine(angle_deg)
    _, table = read_columns("foley.csv", "mask_angle_deg", "mask_db", "threshold_db")
    is_chosen = table["mask_angle_deg"] == angle_deg
    masks_db, observers_db = table["mask_db"][is_chosen], table["threshold_db"][is_chosen]
    gain_db = UNMASKED_DB - _db(threshold_contrast(observer, target, MEAN_CD_M2))
    thresholds_db = []
    masks = list(zip(masks_db, observers_db, strict=True))
    for mask_db, observed_db in counted(masks, f"masking, {angle_deg} deg, {mode.name}", monitor):
        contrast, guess = (10.0 ** ((db - gain_db) / 20.0) for db in (mask_db, observed_db))
        found = threshold_contrast(observer, target, MEAN_CD_M2, mask=contrast * grating, guess=guess)
        thresholds_db.append(_db(found) + gain_db)
    return Masking(masks_db, observers_db, np.array(thresholds_db), gain_db)


def _db(contrast: float) -> float:
    return 20.0 * math.log10(contrast)
