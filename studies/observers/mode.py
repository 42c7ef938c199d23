"""A mode of the metric under validation: its constructor, and its CSF as a function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from enfilade.metric import Aqm
from enfilade.metric.castlecsf import castlecsf_sensitivity
from enfilade.metric.csf import spatiovelocity_sensitivity
from enfilade.metric.eye import EYE_DRIFT_DEG_S
from enfilade.viewing import Viewing

__all__ = ["MODERN", "PAPER", "Mode"]


@dataclass(frozen=True)
class Mode:
    """A mode of the metric.

    Attributes
    ----------
    name : str
        For tables.
    aqm : callable
        Constructor of the metric for a viewing condition.
    sensitivity : callable
        The CSF for a grating that flickers or moves: (frequency_cpd, temporal_hz, luminance_cd_m2,
        area_deg2) -> 1 / contrast at threshold.
    """

    name: str
    aqm: Callable[[Viewing], Aqm]
    sensitivity: Callable[[float, float, float, float], float]


def _eq_4(frequency_cpd: float, temporal_hz: float, _luminance_cd_m2: float, _area_deg2: float) -> float:
    """Eq. 4, which depends on neither luminance nor size.

    A grating of w Hz moves at w / rho deg/s, at least at the drift of the eye.
    """
    speed = max(temporal_hz / frequency_cpd, EYE_DRIFT_DEG_S)
    return float(spatiovelocity_sensitivity(frequency_cpd, speed))


def _castlecsf(frequency_cpd: float, temporal_hz: float, luminance_cd_m2: float, area_deg2: float) -> float:
    return float(castlecsf_sensitivity(frequency_cpd, temporal_hz, luminance_cd_m2, area_deg2))


PAPER = Mode("paper", Aqm.paper, _eq_4)
MODERN = Mode("modern", Aqm.modern, _castlecsf)
