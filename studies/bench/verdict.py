"""What a bench says: CPU time at equal quality, by judge, against each rival."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from studies.bench.equal import Point, Ratio, ratio_at, ratio_over
from studies.bench.judging import error_of

__all__ = ["AQM_MARGIN_JND", "OURS", "verdict"]

OURS = "decoupled"  # the family whose curve is held against the others
AQM_MARGIN_JND = 0.1  # by which ours may be worse than path tracing and is still no visibly lower quality


def verdict(contestants: Sequence[Mapping[str, Any]], judges: Sequence[str]) -> dict[str, Any]:
    """Hold our curve against those of the rivals.

    Parameters
    ----------
    contestants
        As in ``bench.json``.
    judges
        Names.

    Returns
    -------
    dict
        ``traced``: by rival and judge, :class:`Ratio` at the rival's own quality (for AQM 0.1 JND above its
        score). ``denoised``: by judge, over all qualities that both reach, with the geometric mean over the
        judges, its kind (that of the ratios; None where they are bounds both ways, so that it bounds
        nothing) and the smallest. ``paper``: by contestant, which of ours are better by every judge at
        less cost. Empty where one side did not take part.
    """
    by_family: dict[str, list[Mapping[str, Any]]] = {}
    for contestant in contestants:
        by_family.setdefault(contestant["family"], []).append(contestant)
    ours = by_family.get(OURS, [])
    if not ours:
        return {"traced": {}, "denoised": {}, "paper": {}}
    curves = {judge: _points(ours, judge) for judge in judges}
    return {
        "traced": {
            rival["name"]: {
                judge: ratio_at(_point(rival, judge), curves[judge], margin=_margin(judge)).to_dict()
                for judge in judges
            }
            for rival in by_family.get("traced", [])
        },
        "denoised": _denoised(by_family.get("denoised", []), curves),
        "paper": {
            rival["name"]: [one["name"] for one in ours if _beats(one, rival, judges)]
            for rival in by_family.get("paper", [])
        },
    }


def _denoised(rivals: Sequence[Mapping[str, Any]], curves: Mapping[str, Sequence[Point]]) -> dict[str, Any]:
    if not rivals:
        return {}
    ratios: dict[str, Ratio] = {j: ratio_over(_points(rivals, j), curve) for j, curve in curves.items()}
    times = [ratio.times for ratio in ratios.values()]
    return {
        "by_judge": {judge: ratio.to_dict() for judge, ratio in ratios.items()},
        "geometric_mean": math.exp(sum(map(math.log, times)) / len(times)),
        "kind": _kind_of_mean([ratio.kind for ratio in ratios.values()]),
        "least": min(times),
    }


def _kind_of_mean(kinds: Sequence[str]) -> str | None:
    bounds = set(kinds) - {"equal"}
    if len(bounds) > 1:
        return None
    return bounds.pop() if bounds else "equal"


def _beats(one: Mapping[str, Any], rival: Mapping[str, Any], judges: Sequence[str]) -> bool:
    return all(
        _point(one, judge).cpu_s < _point(rival, judge).cpu_s
        and _point(one, judge).error < _point(rival, judge).error
        for judge in judges
    )


def _points(contestants: Sequence[Mapping[str, Any]], judge: str) -> list[Point]:
    return [_point(contestant, judge) for contestant in contestants]


def _point(contestant: Mapping[str, Any], judge: str) -> Point:
    return Point(contestant["cost"]["cpu_s"], error_of(judge, contestant["scores"][judge]))


def _margin(judge: str) -> float:
    return AQM_MARGIN_JND if judge == "aqm" else 0.0
