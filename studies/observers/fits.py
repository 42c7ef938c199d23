"""Cross-validation of the fitted constants.

The error on the data to which a constant was fitted is optimistic. Each measurement is therefore evaluated
with the candidate that fits all other measurements best (leave-one-out), and each data set with the candidate
that fits another data set best.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from enfilade.metric import Aqm, ModernMetric, Transducer
from enfilade.metric.aperture import APERTURE_SIGMA_DEG
from enfilade.monitor import Monitor, Silence
from enfilade.records import F64
from enfilade.viewing import Viewing
from studies.observers import foley, modelfest
from studies.observers.mode import MODERN, Mode
from studies.observers.threshold import rms_db
from studies.progress import counted

TRANSDUCERS = tuple((share, z) for share in (0.25, 0.5, 1.0) for z in (0.9, 1.1, 1.3, 1.5, 1.7))
APERTURES_DEG = (0.2, 0.3, 0.45, 0.6)


@dataclass(frozen=True)
class Fit:
    """Cross-validation of one fitted constant, or of two that were fitted together.

    Attributes
    ----------
    name : str
        The constants.
    data : str
        The data set that is evaluated, and the one that selects the candidate.
    chosen : tuple of float
        Values of the metric.
    rms_db : float
        Error of the whole data set with the metric's values.
    cross_validation_rms_db : float
        Error of the data set with candidates that were selected without it, or without the measurement.
    least, most : tuple of float
        Range of the selected candidates.
    """

    name: str
    data: str
    chosen: tuple[float, ...]
    rms_db: float
    cross_validation_rms_db: float
    least: tuple[float, ...]
    most: tuple[float, ...]


def fit(
    name: str,
    data: str,
    candidates: tuple[tuple[float, ...], ...],
    chosen: tuple[float, ...],
    errors_db: F64,
    *,
    has_gain: bool = False,
) -> Fit:
    """Cross-validate a constant by leaving out each measurement in turn.

    Parameters
    ----------
    name, data : str
        For tables.
    candidates : tuple of M tuples
        Candidate values.
    chosen : tuple of float
        The candidate that the metric uses.
    errors_db : (M, N) float64
        Error of each of N measurements with each candidate.
    has_gain : bool
        Whether the mean error is subtracted, which is a fitted constant, too.
    """
    count = errors_db.shape[1]
    left_out_db, selected = np.zeros(count), []
    for index in range(count):
        others = np.delete(errors_db, index, axis=1)
        gain = others.mean(axis=1) if has_gain else np.zeros(len(candidates))
        best = int(np.argmin([rms_db(errors) for errors in others - gain[:, None]]))
        left_out_db[index] = errors_db[best, index] - gain[best]
        selected.append(candidates[best])
    errors = errors_db[candidates.index(chosen)]
    return Fit(
        name,
        data,
        chosen,
        rms_db(errors - errors.mean() if has_gain else errors),
        rms_db(left_out_db),
        *(tuple(float(end) for end in ends) for ends in (np.min(selected, axis=0), np.max(selected, axis=0))),
    )


def _fit_across(
    name: str, data: str, chosen: float, errors_db: Sequence[float], others_db: Sequence[float]
) -> Fit:
    """Evaluate a data set with the aperture that fits another data set best."""
    best = int(np.argmin(others_db))
    selected = (APERTURES_DEG[best],)
    chosen_db = errors_db[APERTURES_DEG.index(chosen)]
    return Fit(name, data, (chosen,), chosen_db, errors_db[best], selected, selected)


def _modern_with(transducer: Transducer, aperture_sigma_deg: float = APERTURE_SIGMA_DEG) -> Mode:
    """The modern mode with other constants."""

    def aqm(viewing: Viewing) -> Aqm:
        return Aqm(ModernMetric(viewing, transducer=transducer, aperture_sigma_deg=aperture_sigma_deg))

    return replace(MODERN, aqm=aqm)


def measure(monitor: Monitor) -> tuple[Fit, ...]:
    """Cross-validate all fitted constants of the modern mode.

    Parameters
    ----------
    monitor : Monitor
        Shows the progress over the candidates.

    Notes
    -----
    About a minute and a half of CPU time.
    """
    masking = [
        foley.measure(_modern_with(Transducer(z, fraction)), Silence()).error_db
        for fraction, z in counted(TRANSDUCERS, "fits of the transducer", monitor)
    ]
    thresholds, masked = [], []
    for sigma_deg in counted(APERTURES_DEG, "fits of the aperture", monitor):
        mode = _modern_with(Transducer(), sigma_deg)
        thresholds.append(-modelfest.measure(mode, Silence()).error_db)
        masked.append(foley.measure(mode, Silence()).error_db)
    apertures = tuple((sigma_deg,) for sigma_deg in APERTURES_DEG)
    transducer, aperture_deg = Transducer(), APERTURE_SIGMA_DEG
    by_modelfest, by_foley = ([rms_db(errors) for errors in found] for found in (thresholds, masked))
    return (
        fit(
            "transducer: neighbour_fraction, semi_saturation",
            "Foley, leave-one-out",
            TRANSDUCERS,
            (transducer.neighbour_fraction, transducer.semi_saturation),
            np.array(masking),
        ),
        fit(
            "aperture, deg",
            "ModelFest, leave-one-out",
            apertures,
            (aperture_deg,),
            np.array(thresholds),
            has_gain=True,
        ),
        _fit_across("aperture, deg", "ModelFest, fitted on Foley", aperture_deg, by_modelfest, by_foley),
        _fit_across("aperture, deg", "Foley, fitted on ModelFest", aperture_deg, by_foley, by_modelfest),
    )
