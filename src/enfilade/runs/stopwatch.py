"""Wall and CPU time of the parts of a task."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

Cost = dict[str, dict[str, float]]  # part -> wall_s, cpu_s


class Stopwatch:
    """Adds up the time of each part until it is taken for the ledger."""

    def __init__(self) -> None:
        self._cost: Cost = {}
        self._inner = [0.0, 0.0]  # wall and CPU time of parts inside the present one

    @contextmanager
    def timed(self, part: str) -> Iterator[None]:
        """Count the time of a block for a part, without the parts that are timed inside.

        CPU time is that of all threads of this process.
        """
        outer, self._inner = self._inner, [0.0, 0.0]
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            yield
        finally:
            wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
            spent = self._cost.setdefault(part, {"wall_s": 0.0, "cpu_s": 0.0})
            spent["wall_s"] += wall - self._inner[0]
            spent["cpu_s"] += cpu - self._inner[1]
            self._inner = [outer[0] + wall, outer[1] + cpu]

    def take(self) -> Cost:
        """The times since the last call."""
        taken, self._cost = self._cost, {}
        return {
            part: {kind: round(seconds, 6) for kind, seconds in spent.items()} for part, spent in taken.items()
        }
