"""Contrast sensitivity for static, flickering and moving gratings, against the metric's CSF.

Robson 1966 (gratings that change at 0.5 to 32 Hz), Laird et al. 2006 (moving at 10 to 30 Hz), Gabors of
ModelFest (Watson and Ahumada 2005). No gain is fitted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from studies.observers.mode import Mode
from studies.observers.tables import read_columns

__all__ = ["STUDIES", "Sensitivities", "measure"]

Float64Array: TypeAlias = npt.NDArray[np.float64]

STUDIES = ("robson1966", "laird2006", "modelfest")
LOWEST_CPD, HIGHEST_CPD = 0.5, 12.0  # range of the metric's bands


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Sensitivity of the observers and of the metric in one study.

    Attributes
    ----------
    frequency_cpd, temporal_hz : (N,) float64
        Of the grating.
    luminance_cd_m2, area_deg2 : (N,) float64
        Of the stimulus.
    observers, metric : (N,) float64
        1 / contrast at threshold.
    """

    frequency_cpd: Float64Array
    temporal_hz: Float64Array
    luminance_cd_m2: Float64Array
    area_deg2: Float64Array
    observers: Float64Array
    metric: Float64Array

    @property
    def error_db(self) -> Float64Array:
        """Error of each grating; positive where the metric is too sensitive."""
        error: Float64Array = 20.0 * np.log10(self.metric / self.observers)
        return error

    @property
    def rms_db(self) -> float:
        """Root of the mean square of the errors, without a gain."""
        return float(np.sqrt(np.mean(self.error_db**2)))


def measure(study: str, mode: Mode) -> Sensitivities:
    """Sensitivities of the metric at 0.5 to 12 cpd, beside those of the observers.

    Parameters
    ----------
    study : str
        One of STUDIES.
    mode : Mode
        The metric.
    """
    names = ("frequency_cpd", "temporal_hz", "luminance_cd_m2", "area_deg2", "sensitivity")
    rows, columns = read_columns("sensitivity.csv", *names)
    frequency = columns["frequency_cpd"]
    is_chosen = (frequency >= LOWEST_CPD) & (frequency <= HIGHEST_CPD)
    is_chosen &= np.array([row["study"] == study for row in rows])
    cpd, hz, luminance, area, observers = (columns[name][is_chosen] for name in names)
    stimuli = zip(cpd, hz, luminance, area, strict=True)
    metric = np.array([mode.sensitivity(*stimulus) for stimulus in stimuli])
    return Sensitivities(cpd, hz, luminance, area, observers, metric)
