"""CPU time at equal quality, by measure, against each baseline."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from studies.bench.measures import SCALES

DECOUPLED = "decoupled"  # the family that is compared with all others
AQM_MARGIN_JND = 0.1  # by which decoupled may be worse than path tracing: not a visible difference
LEVELS = 16  # of quality, evenly spaced on a logarithmic axis, over which a ratio is averaged
MIN_ERROR = 1e-9  # for logarithms: below it sequences are identical


@dataclass(frozen=True)
class Point:
    """A configuration on the chart of one measure: its cost, and its distance from the reference."""

    cpu_s: float
    error: float


@dataclass(frozen=True)
class Ratio:
    """CPU time of a baseline over that of decoupled.

    Attributes
    ----------
    times : float
        Above 1 where decoupled is faster: geometric mean over the levels of quality that both reach.
    least : float
        The smallest ratio over those levels.
    kind : {"equal", "at least", "at most"}
        ``equal``: both reach these qualities. ``at least``: decoupled is better at every cost; the most
        expensive configuration of the baseline is compared, which would need more time. ``at most``: the
        baseline is better at every cost.
    """

    times: float
    least: float
    kind: str


def ratios(configurations: Sequence[Mapping[str, Any]], measures: Sequence[str]) -> dict[str, Any]:
    """Compare decoupled with the baselines, by configurations as in ``bench.json``.

    Returns
    -------
    dict
        ``traced``: by baseline and measure, :class:`Ratio` at the baseline's quality (for AQM 0.1 JND above
        its score). ``denoised``: ``by_measure``, over all qualities that both reach, with the
        ``geometric_mean`` over the measures, its ``kind`` (None where the ratios are bounds in both
        directions), and the ``least``. ``paper``: by configuration, the names of decoupled configurations
        that are better by every measure at less cost. Empty where one side is missing.
    """
    decoupled, traced, denoised, paper = (
        [c for c in configurations if c["family"] == family]
        for family in (DECOUPLED, "traced", "denoised", "paper")
    )
    if not decoupled:
        return {"traced": {}, "denoised": {}, "paper": {}}
    curves = {measure: [_point(c, measure) for c in decoupled] for measure in measures}
    margins = {"aqm": AQM_MARGIN_JND}
    return {
        "traced": {
            baseline["name"]: {
                m: asdict(ratio_at(_point(baseline, m), curves[m], margin=margins.get(m, 0.0)))
                for m in measures
            }
            for baseline in traced
        },
        "denoised": _denoised(denoised, curves),
        "paper": {
            baseline["name"]: [one["name"] for one in decoupled if _is_better(one, baseline, measures)]
            for baseline in paper
        },
    }


def _denoised(
    baselines: Sequence[Mapping[str, Any]], curves: Mapping[str, Sequence[Point]]
) -> dict[str, Any]:
    if not baselines:
        return {}
    found = {
        m: ratio_over([_point(baseline, m) for baseline in baselines], curve) for m, curve in curves.items()
    }
    times = [ratio.times for ratio in found.values()]
    bounds = {ratio.kind for ratio in found.values()} - {"equal"}
    return {
        "by_measure": {measure: asdict(ratio) for measure, ratio in found.items()},
        "geometric_mean": math.exp(sum(map(math.log, times)) / len(times)),
        "kind": None if len(bounds) > 1 else next(iter(bounds), "equal"),
        "least": min(times),
    }


def _is_better(one: Mapping[str, Any], baseline: Mapping[str, Any], measures: Sequence[str]) -> bool:
    pairs = [(_point(one, measure), _point(baseline, measure)) for measure in measures]
    return all(point.cpu_s < other.cpu_s and point.error < other.error for point, other in pairs)


def _point(configuration: Mapping[str, Any], measure: str) -> Point:
    score = configuration["scores"][measure]
    error = 0.0 if score is None else SCALES[measure].error_of(score)  # None: identical
    return Point(configuration["cost"]["cpu_s"], error)


def front(points: Sequence[Point]) -> list[Point]:
    """Pareto front of points, rising in cost and falling in error."""
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
        The cost, and ``equal``; or the cost of the cheapest point, which is better, and ``at most``; or the
        cost of the best point, which is worse, and ``at least``.
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


def ratio_at(baseline: Point, decoupled: Sequence[Point], *, margin: float = 0.0) -> Ratio:
    """Ratio at the quality of one baseline; decoupled may be worse by a margin, in units of the error."""
    cost, kind = cost_at(decoupled, baseline.error + margin)
    times = baseline.cpu_s / cost
    return Ratio(times, times, {"equal": "equal", "at most": "at least", "at least": "at most"}[kind])


def ratio_over(baseline: Sequence[Point], decoupled: Sequence[Point]) -> Ratio:
    """Ratio over all qualities that both curves reach.

    Without a common quality, the nearest ends of the curves are compared: see :class:`Ratio`.
    """
    baseline_front, decoupled_front = front(baseline), front(decoupled)
    worst, best = (
        min(baseline_front[0].error, decoupled_front[0].error),
        max(baseline_front[-1].error, decoupled_front[-1].error),
    )
    if best > worst:
        if decoupled_front[0].error < baseline_front[-1].error:
            times = baseline_front[-1].cpu_s / decoupled_front[0].cpu_s
            return Ratio(times, times, "at least")
        times = baseline_front[0].cpu_s / decoupled_front[-1].cpu_s
        return Ratio(times, times, "at most")
    levels = np.exp(np.linspace(_log(best), _log(worst), LEVELS)).clip(best, worst)
    found = [cost_at(baseline_front, float(e))[0] / cost_at(decoupled_front, float(e))[0] for e in levels]
    return Ratio(float(np.exp(np.mean(np.log(found)))), min(found), "equal")


def _log(error: float) -> float:
    return math.log(max(error, MIN_ERROR))
