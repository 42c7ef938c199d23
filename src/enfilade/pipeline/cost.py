"""What each stage costs: wall time beside CPU time."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager


class Costs:
    """Adds up the time of each stage until it is taken for the ledger."""

    def __init__(self) -> None:
        self._stages: dict[str, dict[str, float]] = {}

    @contextmanager
    def of(self, stage: str) -> Iterator[None]:
        """Count what happens inside for a stage. CPU time is that of all threads of this process."""
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            yield
        finally:
            spent = self._stages.setdefault(stage, {"wall_s": 0.0, "cpu_s": 0.0})
            spent["wall_s"] += time.perf_counter() - wall
            spent["cpu_s"] += time.process_time() - cpu

    def take(self) -> dict[str, dict[str, float]]:
        """What was spent since the last call, by stage: one unit of work's share."""
        taken, self._stages = self._stages, {}
        return {
            stage: {kind: round(seconds, 6) for kind, seconds in spent.items()}
            for stage, spent in taken.items()
        }


def add_costs(lines: list[dict[str, dict[str, float]]]) -> dict[str, dict[str, float]]:
    """Sum the costs of many units, by stage."""
    total: dict[str, dict[str, float]] = {}
    for line in lines:
        for stage, spent in line.items():
            into = total.setdefault(stage, {"wall_s": 0.0, "cpu_s": 0.0})
            for kind, seconds in spent.items():
                into[kind] += seconds
    return total
