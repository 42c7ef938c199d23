"""Cost of a path on this machine, a unit for times that were measured under different load."""

from __future__ import annotations

import time
from collections.abc import Sequence

from enfilade.methods.walkthrough import Walkthrough
from enfilade.renderer import PixelFilter, Purpose

PathCost = dict[str, dict[str, float]]  # by pixel filter: wall and CPU seconds of a path

FILTERS = (PixelFilter.CENTRE, PixelFilter.GAUSSIAN)
FRAMES = 2  # of a walk, traced whole
TIMED_SPP, WARM_SPP = 8, 1  # the latter first, to compile the kernels


def path_costs(walk: Walkthrough) -> PathCost:
    """Seconds of a path, ``wall`` and ``cpu``, by pixel filter, measured on a few whole frames."""
    frames, found = even_positions(len(walk.path), FRAMES), {}
    for pixel_filter in FILTERS:
        wall = cpu = 0.0
        for frame in frames:
            for spp in (WARM_SPP, TIMED_SPP):
                begin, spent = time.perf_counter(), time.process_time()
                walk.trace(frame, Purpose.REFERENCE, spp=spp, pixel_filter=pixel_filter)
                if spp == TIMED_SPP:
                    wall += time.perf_counter() - begin
                    cpu += time.process_time() - spent
        paths = len(frames) * TIMED_SPP * walk.path.width * walk.path.height
        found[pixel_filter.name.lower()] = {"wall": wall / paths, "cpu": cpu / paths}
    return found


def mean_cost(costs: Sequence[PathCost]) -> PathCost:
    """The mean of several measurements."""
    return {
        name: {kind: sum(cost[name][kind] for cost in costs) / len(costs) for kind in ("wall", "cpu")}
        for name in costs[0]
    }


def even_positions(length: int, count: int) -> list[int]:
    """Indices evenly spread over a length, at the centres of equal intervals."""
    return [round((length - 1) * (k + 0.5) / count) for k in range(count)]
