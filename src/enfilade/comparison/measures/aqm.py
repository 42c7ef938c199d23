"""Our own metric as a judge: visible differences in JND, steady and transient together (§3)."""

from __future__ import annotations

from collections.abc import Sequence

from enfilade.comparison.measures.judge import Scale
from enfilade.comparison.measures.shown import Shown
from enfilade.metric import Aqm, Pursuit, SequenceAqm, sequence_score
from enfilade.viewing import Viewing

__all__ = ["AqmJudge"]


class AqmJudge:
    """The modern mode of the metric; see ``docs/metric.md``.

    Parameters
    ----------
    viewing
        Who looks, and on what.
    pursuit
        What the eye does while the image moves.
    """

    SCALE = Scale("aqm", "AQM", "JND")

    def __init__(self, viewing: Viewing, *, pursuit: Pursuit = Pursuit.BOTH) -> None:
        self._viewing = viewing
        self._metric = SequenceAqm(Aqm.modern(viewing, pursuit=pursuit))

    def judge(self, pair: Shown) -> float:
        """Judge the next frame: JND."""
        flow = pair.flow
        found = self._metric.compare(
            pair.test_cd_m2,
            pair.reference_cd_m2,
            velocity=None if flow is None else self._viewing.velocity_deg_s(flow.motion),
            backward_flow_px=flow.backward if flow is not None and flow.has_backward else None,
            is_cut=pair.seen_before is None,
        )
        return found.score

    def pooled(self, values: Sequence[float | None]) -> float:
        """(mean over frames of score^3.5)^(1/3.5), JND."""
        return sequence_score(value for value in values if value is not None)
