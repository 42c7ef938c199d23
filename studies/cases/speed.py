"""What a path costs on this machine in this hour: the unit in which times of different hours are compared."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from enfilade.pipeline.job import Job
from enfilade.renderer import PixelFilter, Purpose, RandomKey, Renderer

__all__ = ["FILTERS", "PathCost", "mean_cost", "path_costs", "spread_over"]

PathCost = dict[str, dict[str, float]]  # by pixel filter: wall and CPU seconds

FILTERS = (PixelFilter.CENTRE, PixelFilter.GAUSSIAN)
FRAMES = 2  # of a walk that are traced whole to take the time of a path
TIMED_SPP, WARM_SPP = 8, 1  # their paths a pixel; before that, kernels are compiled


def path_costs(renderer: Renderer, job: Job) -> PathCost:
    """Trace a few frames of a job whole, and divide.

    Returns
    -------
    dict
        By the filter's name in lower case: ``wall`` and ``cpu`` seconds of a path.
    """
    path, found = job.path, {}
    pixels = np.arange(path.width * path.height, dtype=np.uint32)
    frames = spread_over(len(path), FRAMES)
    for pixel_filter in FILTERS:
        wall = cpu = 0.0
        for frame in frames:
            for spp in (WARM_SPP, TIMED_SPP):
                begin, spent = time.perf_counter(), time.process_time()
                renderer.trace(
                    path.cameras[frame],
                    pixels,
                    RandomKey(job.settings.trace.seed, path.numbers[frame], Purpose.REFERENCE),
                    spp=spp,
                    pixel_filter=pixel_filter,
                )
                if spp == TIMED_SPP:
                    wall += time.perf_counter() - begin
                    cpu += time.process_time() - spent
        paths = len(frames) * TIMED_SPP * len(pixels)
        found[pixel_filter.name.lower()] = {"wall": wall / paths, "cpu": cpu / paths}
    return found


def mean_cost(costs: Sequence[PathCost]) -> PathCost:
    """The mean of several measurements."""
    names = [pixel_filter.name.lower() for pixel_filter in FILTERS]
    return {
        name: {kind: sum(cost[name][kind] for cost in costs) / len(costs) for kind in ("wall", "cpu")}
        for name in names
    }


def spread_over(length: int, count: int) -> list[int]:
    """Places evenly spread over a length, each in the middle of its share."""
    return [round((length - 1) * (k + 0.5) / count) for k in range(count)]
