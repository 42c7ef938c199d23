"""The animation quality metric: visible differences in JND, steady and transient together (§3)."""

from __future__ import annotations

from collections.abc import Sequence

from enfilade.comparison.measures.base import Scale
from enfilade.comparison.measures.displayed import DisplayedPair
from enfilade.metric import Aqm, Pursuit, SequenceAqm, sequence_score
from enfilade.viewing import Viewing

__all__ = ["AqmMeasure"]


class AqmMeasure:
    """The modern mode of the metric; see ``docs/metric.md``.

    Parameters
    ----------
    viewing
        Viewing conditions.
    pursuit
        Eye movements.
    """

    SCALE = Scale("aqm", "AQM", "JND")
    name = SCALE.name

    def __init__(self, viewing: Viewing, *, pursuit: Pursuit = Pursuit.BOTH) -> None:
        self._viewing = viewing
        self._metric = SequenceAqm(Aqm.modern(viewing, pursuit=pursuit))

    def measure(self, pair: DisplayedPair) -> float:
        """Score of the frame, JND."""
        flow = pair.flow
        found = self._metric.compare(
            pair.test_cd_m2,
            pair.reference_cd_m2,
            velocity=None if flow is None else self._viewing.velocity_deg_s(flow.motion),
            backward_flow_px=flow.backward if flow is not None and flow.has_backward else None,
            is_cut=pair.visible_before is None,
        )
        return found.score

    def pool(self, values: Sequence[float | None]) -> float:
        """(mean over frames of score^3.5)^(1/3.5), JND."""
        return sequence_score(value for value in values if value is not None)
