"""Contrast sensitivity of the metric to flickering, drifting and large gratings, beside that of observers.

Thresholds are those of sequences through the whole metric (`threshold`, `gratings`). The eye is at rest:
Robson's and Rovamo's observers fixated, and Laird's velocities are those over the retina. No gain is fitted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enfilade.metric import Aqm, Pursuit
from enfilade.monitor import Monitor
from enfilade.records import F64
from enfilade.viewing import Viewing
from studies.observers.gratings import STIMULI, Grating
from studies.observers.mode import Mode
from studies.observers.tables import read_columns
from studies.observers.threshold import sequence_threshold
from studies.progress import counted

LOWEST_CPD, HIGHEST_CPD = 0.5, 12.0  # range of the metric's bands


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Sensitivity of the observers and of the metric to a set of gratings.

    Attributes
    ----------
    frequency_cpd, temporal_hz, area_deg2 : (N,) float64
        Of the grating.
    observers, metric : (N,) float64
        1 / contrast at threshold.
    """

    frequency_cpd: F64
    temporal_hz: F64
    area_deg2: F64
    observers: F64
    metric: F64

    @property
    def error_db(self) -> F64:
        """Error of each grating; positive where the metric is too sensitive."""
        error: F64 = 20.0 * np.log10(self.metric / self.observers)
        return error


def gratings(study: str) -> tuple[Grating, ...]:
    """Gratings of a study at 0.5 to 12 cpd, in the order of the table.

    Parameters
    ----------
    study : str
        One of STIMULI.
    """
    names = ("frequency_cpd", "temporal_hz", "luminance_cd_m2", "area_deg2", "sensitivity")
    rows, columns = read_columns("sensitivity.csv", *names)
    return tuple(
        Grating(*(float(number) for number in numbers))
        for row, *numbers in zip(rows, *(columns[name] for name in names), strict=True)
        if row["study"] == study and LOWEST_CPD <= numbers[0] <= HIGHEST_CPD
    )


def measure(study: str, chosen: Sequence[Grating], mode: Mode, monitor: Monitor) -> Sensitivities:
    """Sensitivities of the metric to gratings of a study, beside those of the observers.

    Parameters
    ----------
    study : str
        One of STIMULI.
    chosen : sequence of Grating
        All `gratings` of the study, or some.
    mode : Mode
        The metric.
    monitor : Monitor
        Shows the progress over the gratings.
    """
    observers: dict[Viewing, Aqm] = {}
    found = []
    for grating in counted(chosen, f"{study}, {mode.name}", monitor):
        stimulus = STIMULI[study](grating)
        if stimulus.viewing not in observers:
            observers[stimulus.viewing] = mode.aqm(stimulus.viewing)
            observers[stimulus.viewing].pursuit = Pursuit.NONE
        contrast = sequence_threshold(
            observers[stimulus.viewing],
            stimulus.patterns,
            grating.luminance_cd_m2,
            step_px=stimulus.step_px,
            guess=1.0 / grating.sensitivity,
        )
        found.append(1.0 / contrast)
    names = ("frequency_cpd", "temporal_hz", "area_deg2", "sensitivity")
    cpd, hertz, area, published = (np.array([getattr(g, name) for g in chosen]) for name in names)
    return Sensitivities(cpd, hertz, area, published, np.array(found))
