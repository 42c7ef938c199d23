"""What was fitted to people, fitted again with a part of what people said left out.

A number that is fitted to a data set says little of how well the metric does on that set. So each
measurement is judged here by the candidate that suits all the others best, and one data set by the
number that another one asks for.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.metric import Aqm, ModernMetric, Transducer
from enfilade.metric.aperture import APERTURE_SIGMA_DEG
from enfilade.monitor import Monitor, Silence
from enfilade.viewing import Viewing
from studies.observers import foley, modelfest
from studies.observers.mode import MODERN, Mode
from studies.progress import counted

__all__ = ["APERTURES_DEG", "TRANSDUCERS", "Fit", "fit", "measure"]

Float64Array: TypeAlias = npt.NDArray[np.float64]

TRANSDUCERS = tuple((share, z) for share in (0.25, 0.5, 1.0) for z in (0.9, 1.1, 1.3, 1.5, 1.7))
APERTURES_DEG = (0.2, 0.3, 0.45, 0.6)


@dataclass(frozen=True)
class Fit:
    """A fitted number, or two, and how far the data that they were fitted to speak for themselves.

    Attributes
    ----------
    name : str
        What was fitted.
    data : str
        To what, or by what it is judged where the number is another data set's.
    chosen : tuple of float
        What the metric has.
    rms_db : float
        Of the whole data set, with what the metric has.
    left_out_rms_db : float
        The same where each measurement is judged by the candidate that the others ask for.
    least, most : tuple of float
        Range of the candidates that were asked for.
    """

    name: str
    data: str
    chosen: tuple[float, ...]
    rms_db: float
    left_out_rms_db: float
    least: tuple[float, ...]
    most: tuple[float, ...]

    def to_dict(self) -> dict[str, Any]:
        """As plain values, for JSON."""
        return asdict(self)


def fit(
    name: str,
    data: str,
    candidates: tuple[tuple[float, ...], ...],
    chosen: tuple[float, ...],
    errors_db: Float64Array,
    *,
    has_gain: bool = False,
) -> Fit:
    """Leave out each measurement in turn.

    Parameters
    ----------
    name, data : str
        For tables.
    candidates : tuple of M tuples
        Values that were tried.
    chosen : tuple of float
        That of them which the metric has.
    errors_db : (M, N) float64
        Error of each of N measurements with each candidate.
    has_gain : bool
        Whether the mean of the errors is taken off, which is a fitted number too.
    """
    count = errors_db.shape[1]
    left_out, asked = np.zeros(count), []
    for place in range(count):
        others = np.delete(errors_db, place, axis=1)
        gain = others.mean(axis=1) if has_gain else np.zeros(len(candidates))
        best = int(np.argmin(_rms(others - gain[:, None])))
        left_out[place] = errors_db[best, place] - gain[best]
        asked.append(candidates[best])
    own = errors_db[candidates.index(chosen)]
    return Fit(
        name,
        data,
        chosen,
        float(_rms(own - own.mean() if has_gain else own)),
        float(_rms(left_out)),
        *(tuple(float(end) for end in ends) for ends in (np.min(asked, axis=0), np.max(asked, axis=0))),
    )


def _rms(errors: Float64Array) -> Float64Array:
    return np.asarray(np.sqrt(np.mean(np.square(errors), axis=-1)))


def _between(name: str, data: str, chosen: float, own: Float64Array, others: Float64Array) -> Fit:
    """Judge a data set by the aperture that suits another one best."""
    best = int(np.argmin(others))
    asked = (APERTURES_DEG[best],)
    mine = float(own[APERTURES_DEG.index(chosen)])
    return Fit(name, data, (chosen,), mine, float(own[best]), asked, asked)


def _with(transducer: Transducer, aperture_sigma_deg: float = APERTURE_SIGMA_DEG) -> Mode:
    """The modern mode with other constants."""

    def aqm(viewing: Viewing) -> Aqm:
        return Aqm(ModernMetric(viewing, transducer=transducer, aperture_sigma_deg=aperture_sigma_deg))

    return replace(MODERN, aqm=aqm)


def measure(monitor: Monitor) -> tuple[Fit, ...]:
    """Fit all fitted constants of the modern mode anew.

    Parameters
    ----------
    monitor : Monitor
        Is told of each candidate.

    Notes
    -----
    About a minute and a half of CPU time.
    """
    masking = [
        foley.measure(_with(Transducer(z, fraction)), Silence()).error_db
        for fraction, z in counted(TRANSDUCERS, "fits of the transducer", monitor)
    ]
    thresholds, masked = [], []
    for sigma_deg in counted(APERTURES_DEG, "fits of the aperture", monitor):
        other = _with(Transducer(), sigma_deg)
        thresholds.append(-modelfest.measure(other, Silence()).error_db)
        masked.append(foley.measure(other, Silence()).error_db)
    apertures = tuple((sigma_deg,) for sigma_deg in APERTURES_DEG)
    has, chosen = Transducer(), APERTURE_SIGMA_DEG
    by_modelfest, by_foley = _rms(np.array(thresholds)), _rms(np.array(masked))
    return (
        fit(
            "transducer: neighbour_fraction, semi_saturation",
            "Foley, each mask by the others",
            TRANSDUCERS,
            (has.neighbour_fraction, has.semi_saturation),
            np.array(masking),
        ),
        fit(
            "aperture, deg",
            "ModelFest, each target by the others",
            apertures,
            (chosen,),
            np.array(thresholds),
            has_gain=True,
        ),
        _between("aperture, deg", "ModelFest by Foley's", chosen, by_modelfest, by_foley),
        _between("aperture, deg", "Foley by ModelFest's", chosen, by_foley, by_modelfest),
    )
