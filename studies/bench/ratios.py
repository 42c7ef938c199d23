"""CPU time at equal quality: enfilade's configurations against the Pareto front of the baselines."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from studies.bench.configurations import BASELINES
from studies.bench.measures import QUALITIES

DRAWS = 1000  # bootstrap resamples
INTERVAL = (5.0, 95.0)  # percentiles of the resamples
REACH = 1.645  # of the interval, in standard deviations
SEED = 0


@dataclass(frozen=True)
class Point:
    """A configuration on the chart of one measure: its cost, and its distance from the reference."""

    cpu_s: float
    error: float


@dataclass(frozen=True)
class Ratio:
    """CPU time of the strongest baseline over that of a configuration, at equal quality.

    Attributes
    ----------
    times : float
        Above 1 where the configuration is faster.
    kind : {"equal", "at least", "at most"}
        ``at least``: it is better than every baseline; the best one is compared, which would need more time.
        ``at most``: it is no better than the cheapest baseline, which is compared.
    low, high : float
        Bootstrap interval of 90 % over the windows, and over the seeds of the configuration where it was
        rendered with several: of its errors and CPU times. That of the baselines' CPU times is not in it.
    is_decided : bool
        Whether the score is apart from the noise floor of the references.
    """

    times: float
    kind: str
    low: float
    high: float
    is_decided: bool


def ratios(rows: Sequence[Mapping[str, Any]], measures: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Ratios by configuration and measure; empty where there is no baseline.

    Parameters
    ----------
    rows
        Configurations as in ``bench.json``.
    measures
        Names.
    """
    baselines = [row for row in rows if row["family"] in BASELINES]
    ours = [row for row in rows if row["family"] not in BASELINES]
    if not baselines:
        return {}
    return {one["name"]: {m: asdict(ratio(one, baselines, m)) for m in measures} for one in ours}


def ratio(one: Mapping[str, Any], baselines: Sequence[Mapping[str, Any]], measure: str) -> Ratio:
    """CPU time of the baselines' front over that of a configuration, at its quality by a measure."""
    windows = len(one["values"][measure])
    cost, kind = cost_at([_point(baseline, measure) for baseline in baselines], _point(one, measure).error)
    random = np.random.default_rng(SEED)
    drawn = []
    for _ in range(DRAWS):
        chosen = random.integers(windows, size=windows).tolist()
        points = [_point(baseline, measure, chosen) for baseline in baselines]
        ours = _with_drawn_seeds(one, measure, chosen, random)
        drawn.append(cost_at(points, ours.error)[0] / ours.cpu_s)
    low, high = np.percentile(drawn, INTERVAL).tolist()
    is_decided = measure not in one["undecided"]
    return Ratio(cost / one["cost"]["cpu_s"], kind, low, high, is_decided)


def _with_drawn_seeds(
    one: Mapping[str, Any], measure: str, windows: Sequence[int], random: np.random.Generator
) -> Point:
    """A configuration in some windows, whose logarithms deviate as those of a resample of its seeds.

    The deviation is increased by sqrt(n / (n - 1)), as resamples of n values vary too little by that factor.
    """
    point, count = _point(one, measure, windows), len(one["seeds"])
    if count == 1:
        return point
    quality = QUALITIES[measure]
    logs = np.log(
        [
            (run["cpu_s"], quality.error([run["values"][measure][window] for window in windows]))
            for run in one["seeds"]
        ]
    )
    resample = logs[random.integers(count, size=count)].mean(axis=0)
    cpu, error = np.exp((resample - logs.mean(axis=0)) * math.sqrt(count / (count - 1)))
    return Point(point.cpu_s * cpu, point.error * error)


def _point(row: Mapping[str, Any], measure: str, windows: Sequence[int] | None = None) -> Point:
    values = row["values"][measure]
    chosen = values if windows is None else [values[window] for window in windows]
    return Point(row["cost"]["cpu_s"], QUALITIES[measure].error(chosen))


def front(points: Sequence[Point]) -> list[Point]:
    """Pareto front of points, rising in cost and falling in error."""
    kept: list[Point] = []
    for point in sorted(points, key=lambda p: (p.cpu_s, p.error)):
        if not kept or point.error < kept[-1].error:
            kept.append(point)
    return kept


def cost_at(points: Sequence[Point], error: float) -> tuple[float, str]:
    """CPU seconds at which a front reaches an error, interpolated on logarithmic axes.

    Parameters
    ----------
    points
        One or more.
    error
        Above 0.

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
    errors = [math.log(p.error) for p in reversed(curve)]
    costs = [math.log(p.cpu_s) for p in reversed(curve)]
    return float(math.exp(np.interp(math.log(error), errors, costs))), "equal"


def mean_ratio(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Geometric mean of ratios over scenes, with an interval over scenes and windows.

    Scenes are drawn, and of each a ratio within its own interval, whose logarithm is taken to be normal.

    Parameters
    ----------
    found
        Ratios as plain values, of one configuration and measure in each scene.

    Returns
    -------
    dict
        As :class:`Ratio`; its `kind` is None where it contains bounds in both directions, and it is decided
        if all are.
    """
    logs, lows, highs = (np.log([one[key] for one in found]) for key in ("times", "low", "high"))
    random = np.random.default_rng(SEED)
    chosen = random.integers(len(logs), size=(DRAWS, len(logs)))
    deviation = random.standard_normal(chosen.shape) / REACH
    width = np.where(deviation < 0.0, (logs - lows)[chosen], (highs - logs)[chosen])
    drawn = (logs[chosen] + deviation * width).mean(axis=1)
    low, high = np.exp(np.percentile(drawn, INTERVAL)).tolist()
    bounds = {one["kind"] for one in found} - {"equal"}
    kind = None if len(bounds) > 1 else next(iter(bounds), "equal")
    times, is_decided = float(np.exp(logs.mean())), all(one["is_decided"] for one in found)
    return {"times": times, "kind": kind, "low": low, "high": high, "is_decided": is_decided}
