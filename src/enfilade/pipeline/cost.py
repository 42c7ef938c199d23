"""What each stage costs: wall time beside CPU time."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager


class Costs:
    """Adds up the time of each stage until it is taken for the ledger."""

    def __init__(self) -> None:
        self._stages: dict[str, dict[str, float]] = {}
        self._inner = [0.0, 0.0]  # wall and CPU time of the stages inside the one that is counted

    @contextmanager
    def of(self, stage: str) -> Iterator[None]:
        """Count what happens inside for a stage, but for what is counted for another one in there.

        CPU time is that of all threads of this process.
        """
        outer, self._inner = self._inner, [0.0, 0.0]
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            yield
        finally:
            wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
            spent = self._stages.setdefault(stage, {"wall_s": 0.0, "cpu_s": 0.0})
            spent["wall_s"] += wall - self._inner[0]
            spent["cpu_s"] += cpu - self._inner[1]
            self._inner = [outer[0] + wall, outer[1] + cpu]

    def take(self) -> dict[str, dict[str, float]]:
        """What was spent since the last call, by stage: one unit of work's share."""
        taken, self._stages = self._stages, {}
        return {
            stage: {kind: round(seconds, 6) for kind, seconds in spent.items()}
            for stage, spent in taken.items()
        }
