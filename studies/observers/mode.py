"""A mode of the metric as a validation takes it: its options by a name, and its CSF as a function."""

from __future__ import annotations

from dataclasses import dataclass

from enfilade.metric import Aqm, Fitted, MetricOptions, SequenceAqm
from enfilade.metric.castle import castle_sensitivity
from enfilade.metric.csf import spatiovelocity_sensitivity
from enfilade.metric.eye import EYE_DRIFT_DEG_S
from enfilade.viewing import Viewing

__all__ = ["MODERN", "PAPER", "Mode"]


FITTED = Fitted()


@dataclass(frozen=True)
class Mode:
    """The metric with certain options.

    Attributes
    ----------
    name : str
        For tables.
    options : MetricOptions
        What it does otherwise than the paper.
    fitted : Fitted
        Numbers that were fitted; others than the metric's own are tried in `fits`.
    """

    name: str
    options: MetricOptions
    fitted: Fitted = FITTED

    def image_judge(self, viewing: Viewing) -> Aqm:
        """The metric for single images."""
        return Aqm(viewing, options=self.options, fitted=self.fitted)

    def sequence_judge(self, viewing: Viewing) -> SequenceAqm:
        """The metric for sequences, as `enfilade compare` has it."""
        return SequenceAqm(viewing, options=self.options)

    def sensitivity(
        self, frequency_cpd: float, temporal_hz: float, luminance_cd_m2: float, area_deg2: float
    ) -> float:
        """The CSF for a grating that flickers or moves: 1 / contrast at threshold.

        Eq. 4 knows no luminance and no size; a grating that changes at w Hz is to it one that moves at
        w / rho deg/s, and never slower than the eye drifts.

        Parameters
        ----------
        frequency_cpd, temporal_hz : float
            Of the grating.
        luminance_cd_m2, area_deg2 : float
            Of the screen around it, and its size.
        """
        if self.options.csf == "castle":
            return float(castle_sensitivity(frequency_cpd, temporal_hz, luminance_cd_m2, area_deg2))
        speed = max(temporal_hz / frequency_cpd, EYE_DRIFT_DEG_S)
        return float(spatiovelocity_sensitivity(frequency_cpd, speed))


PAPER = Mode("paper", MetricOptions.paper())
MODERN = Mode("modern", MetricOptions.modern())
