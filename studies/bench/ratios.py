"""CPU time at equal quality, by measure, against each rival."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from studies.bench.measures import SCALES

OURS = "decoupled"  # the family that is compared with the others
AQM_MARGIN_JND = 0.1  # by which ours may be worse than path tracing: no visible difference
LEVELS = 16  # of quality, evenly spaced on a logarithmic axis, over which a ratio is averaged
MIN_ERROR = 1e-9  # for logarithms: below it sequences are identical


@dataclass(frozen=True)
class Point:
    """A configuration on the chart of one measure: its cost, and its distance from the reference."""

    cpu_s: float
    error: float


@dataclass(frozen=True)
class Ratio:
    """CPU time of theirs over that of ours.

    Attributes
    ----------
    times : float
        Above 1 where ours is faster; the geometric mean over the levels of quality that both reach.
    least : float
        The smallest over those levels.
    kind : {"equal", "at least", "at most"}
        ``equal``: both were measured at these qualities. ``at least``: ours is better than theirs at every
        cost: theirs at its dearest is taken, and would need more. ``at most``: theirs is better than ours at
        every cost.
    """

    times: float
    least: float
    kind: str


def ratios(configurations: Sequence[Mapping[str, Any]], measures: Sequence[str]) -> dict[str, Any]:
    """Compare our curve with those of the rivals, by configurations as in ``bench.json``.

    Returns
    -------
    dict
        ``traced``: by rival and measure, :class:`Ratio` at the rival's own quality (for AQM 0.1 JND above its
        score). ``denoised``: ``by_measure``, over all qualities that both reach, with the ``geometric_mean``
        over the measures, its ``kind`` (None where the ratios are bounds both ways), and the ``least``.
        ``paper``: by configuration, the names of ours that are better by every measure at less cost. Empty
        where one side is missing.
    """
    ours, traced, denoised, paper = (
        [c for c in configurations if c["family"] == family]
        for family in (OURS, "traced", "denoised", "paper")
    )
    if not ours:
        return {"traced": {}, "denoised": {}, "paper": {}}
    curves = {measure: [_point(c, measure) for c in ours] for measure in measures}
    margins = {"aqm": AQM_MARGIN_JND}
    return {
        "traced": {
            rival["name"]: {
                m: asdict(ratio_at(_point(rival, m), curves[m], margin=margins.get(m, 0.0))) for m in measures
            }
            for rival in traced
        },
        "denoised": _denoised(denoised, curves),
        "paper": {
            rival["name"]: [one["name"] for one in ours if _is_better(one, rival, measures)]
            for rival in paper
        },
    }


def _denoised(rivals: Sequence[Mapping[str, Any]], curves: Mapping[str, Sequence[Point]]) -> dict[str, Any]:
    if not rivals:
        return {}
    found = {m: ratio_over([_point(rival, m) for rival in rivals], curve) for m, curve in curves.items()}
    times = [ratio.times for ratio in found.values()]
    bounds = {ratio.kind for ratio in found.values()} - {"equal"}
    return {
        "by_measure": {measure: asdict(ratio) for measure, ratio in found.items()},
        "geometric_mean": math.exp(sum(map(math.log, times)) / len(times)),
        "kind": None if len(bounds) > 1 else next(iter(bounds), "equal"),
        "least": min(times),
    }


def _is_better(one: Mapping[str, Any], rival: Mapping[str, Any], measures: Sequence[str]) -> bool:
    pairs = [(_point(one, measure), _point(rival, measure)) for measure in measures]
    return all(mine.cpu_s < its.cpu_s and mine.error < its.error for mine, its in pairs)


def _point(configuration: Mapping[str, Any], measure: str) -> Point:
    score = configuration["scores"][measure]
    error = 0.0 if score is None else SCALES[measure].error_of(score)  # None: identical
    return Point(configuration["cost"]["cpu_s"], error)


def front(points: Sequence[Point]) -> list[Point]:
    """Points that no cheaper point beats, rising in cost and falling in error."""
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
    """The ratio at the quality of one rival; ours may be worse by a margin, in units of the error."""
    cost, kind = cost_at(ours, theirs.error + margin)
    times = theirs.cpu_s / cost
    return Ratio(times, times, {"equal": "equal", "at most": "at least", "at least": "at most"}[kind])


def ratio_over(theirs: Sequence[Point], ours: Sequence[Point]) -> Ratio:
    """The ratio over all qualities that both curves reach.

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
    found = [cost_at(rival, float(e))[0] / cost_at(own, float(e))[0] for e in levels]
    return Ratio(float(np.exp(np.mean(np.log(found)))), min(found), "equal")


def _log(error: float) -> float:
    return math.log(max(error, MIN_ERROR))
