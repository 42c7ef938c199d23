"""CPU time at equal quality: how many times less one curve needs than another."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

__all__ = ["Point", "Ratio", "cost_at", "front", "ratio_at", "ratio_over"]

LEVELS = 16  # of quality, evenly spaced on a logarithmic axis, over which a ratio is averaged
LEAST_ERROR = 1e-9  # for logarithms: below it a sequence is identical


@dataclass(frozen=True)
class Point:
    """A contestant on one judge's chart: what it cost, and how far it is from its reference."""

    cpu_s: float
    error: float


@dataclass(frozen=True)
class Ratio:
    """How many times less CPU time ours takes than theirs.

    Attributes
    ----------
    times : float
        Above 1 where ours is faster; the geometric mean over the levels of quality that both reach.
    least : float
        The smallest over those levels.
    kind : {"equal", "at least", "at most"}
        ``equal``: both were measured at these qualities. ``at least``: ours is better than theirs at every
        cost: theirs at its dearest is taken, and would need more. ``at most``: theirs is better than ours
        at every cost.
    """

    times: float
    least: float
    kind: str

    def text(self) -> str:
        """For people: ``≥ 3.1``."""
        sign = {"equal": "", "at least": "≥ ", "at most": "≤ "}[self.kind]
        return f"{sign}{self.times:.2f}" if self.times < 10.0 else f"{sign}{self.times:.1f}"

    def to_dict(self) -> dict[str, Any]:
        """As plain values, for JSON."""
        return {"times": self.times, "least": self.least, "kind": self.kind}


def front(points: Sequence[Point]) -> list[Point]:
    """Those that no cheaper point beats, rising in cost and falling in error."""
    kept: list[Point] = []
    for point in sorted(points, key=lambda p: (p.cpu_s, p.error)):
        if not kept or point.error < kept[-1].error:
            kept.append(point)
    return kept


def cost_at(points: Sequence[Point], error: float) -> tuple[float, str]:
    """CPU seconds at which a curve reaches an error, interpolated on logarithmic axes.

    Parameters
    ----------
    points
        One or more.
    error

    Returns
    -------
    float, str
        The cost is ``equal``; ``at most`` that of the cheapest, which is better already; or ``at least`` that
        of the best, which is not good enough.
    """
    curve = front(points)
    cheapest, best = curve[0], curve[-1]
    if error >= cheapest.error:
        return cheapest.cpu_s, "equal" if error == cheapest.error else "at most"
    if error < best.error:
        return best.cpu_s, "at least"
    errors = [_log(p.error) for p in reversed(curve)]
    costs = [math.log(p.cpu_s) for p in reversed(curve)]
    return float(math.exp(np.interp(_log(error), errors, costs))), "equal"


def ratio_at(theirs: Point, ours: Sequence[Point], *, margin: float = 0.0) -> Ratio:
    """How many times less ours takes to come as near to the reference as one rival, or nearly so.

    Parameters
    ----------
    theirs
        The rival.
    ours
        A curve.
    margin
        By how much ours may be worse, in units of the error.
    """
    cost, kind = cost_at(ours, theirs.error + margin)
    times = theirs.cpu_s / cost
    return Ratio(times, times, {"equal": "equal", "at most": "at least", "at least": "at most"}[kind])


def ratio_over(theirs: Sequence[Point], ours: Sequence[Point]) -> Ratio:
    """How many times less ours takes over all qualities that both curves reach.

    Where they have none in common, the ends that face each other are compared: see :class:`Ratio`.
    """
    rival, own = front(theirs), front(ours)
    worst, best = min(rival[0].error, own[0].error), max(rival[-1].error, own[-1].error)
    if best > worst:
        if own[0].error < rival[-1].error:
            times = rival[-1].cpu_s / own[0].cpu_s
            return Ratio(times, times, "at least")
        times = rival[0].cpu_s / own[-1].cpu_s
        return Ratio(times, times, "at most")
    levels = np.exp(np.linspace(_log(best), _log(worst), LEVELS)).clip(best, worst)
    ratios = [cost_at(rival, float(e))[0] / cost_at(own, float(e))[0] for e in levels]
    return Ratio(float(np.exp(np.mean(np.log(ratios)))), min(ratios), "equal")


def _log(error: float) -> float:
    return math.log(max(error, LEAST_ERROR))
