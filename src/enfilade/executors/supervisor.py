"""Hand out units until none is left: tries again what failed, and sets aside what fails again and again."""

from __future__ import annotations

import heapq
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from enfilade.executors.executor import Event, Executor, Failure, FailureKind
from enfilade.executors.graph import Graph
from enfilade.executors.unit import Unit

ATTEMPTS = 4  # of a unit
FIRST_DELAY_S = 0.25  # before the second attempt; twice that before each next one
SMALLER = 4  # times less memory for each attempt after one that had too little
IDLE_S = 0.05  # looked again for what may be begun


@dataclass(eq=False)
class Ending:
    """How it ended.

    Attributes
    ----------
    aside : list of (Unit, list of Failure)
        What failed again and again, each with all its failures.
    stopped : Failure or None
        What ended it early: a full disk, an error of ours, a damaged file.
    """

    aside: list[tuple[Unit, list[Failure]]] = field(default_factory=list)
    stopped: Failure | None = None


def supervise(
    graph: Graph,
    executor: Executor,
    *,
    follow: Callable[[Unit], Iterable[Unit]],
    is_done: Callable[[Unit], bool],
    failed: Callable[[Unit, list[Failure]], None],
) -> Ending:
    """Hand out the units of a graph until none is left that can be done.

    Parameters
    ----------
    graph
        Grows by what `follow` gives.
    executor
    follow
        Called with each unit that was finished; gives those that come of it.
    is_done
        Whether a unit's line is in the ledger. One that says it is finished and isn't has failed.
    failed
        Told of each failure of a unit, with all that it has had. After :data:`ATTEMPTS` it is set aside.

    Returns
    -------
    Ending
    """
    loop = _Loop(graph, executor, follow, is_done, failed)
    loop.run()
    return loop.ending


class _Loop:
    def __init__(
        self,
        graph: Graph,
        executor: Executor,
        follow: Callable[[Unit], Iterable[Unit]],
        is_done: Callable[[Unit], bool],
        failed: Callable[[Unit, list[Failure]], None],
    ) -> None:
        self.ending = Ending()
        self._graph = graph
        self._executor = executor
        self._follow = follow
        self._is_done = is_done
        self._failed = failed
        self._in_hand: dict[int, Unit] = {}
        self._last: dict[int, str] = {}  # group of what a worker did last
        self._failures: dict[str, list[Failure]] = {}
        self._delayed: list[tuple[float, str, Unit]] = []

    def run(self) -> None:
        while True:
            self._hand_out()
            if not self._in_hand and (self.ending.stopped or not self._delayed):
                return
            if not self._in_hand:
                time.sleep(IDLE_S)
            for event in self._executor.wait(self._patience()):
                self._end(event)

    def _hand_out(self) -> None:
        now = time.monotonic()
        while self._delayed and self._delayed[0][0] <= now:
            self._graph.put_back(heapq.heappop(self._delayed)[2])
        for slot in range(self._executor.slots):
            if slot in self._in_hand or self.ending.stopped:
                continue
            busy = {unit.group for unit in self._in_hand.values()}
            unit = self._graph.take(self._last.get(slot, ""), busy)
            if unit is None:
                return
            self._in_hand[slot] = unit
            self._last[slot] = unit.group
            self._executor.begin(slot, unit, share=self._share(unit))

    def _patience(self) -> float | None:
        return max(self._delayed[0][0] - time.monotonic(), IDLE_S) if self._delayed else None

    def _share(self, unit: Unit) -> int:
        kinds = [failure.kind for failure in self._failures.get(unit.name, [])]
        # The kernel kills who takes too much memory; but a worker that is killed once may have been unlucky.
        scarce = kinds.count(FailureKind.MEMORY) + max(kinds.count(FailureKind.DIED) - 1, 0)
        return int(SMALLER**scarce)

    def _end(self, event: Event) -> None:
        unit = self._in_hand.pop(event.slot)
        failure = event.failure
        if failure is None and not self._is_done(unit):
            failure = Failure(FailureKind.ERROR, "it ended without a line in the ledger")
        if failure is None:
            self._graph.finish(unit.name)
            for following in self._follow(unit):
                self._graph.add(following)
        else:
            self._fail(unit, failure)

    def _fail(self, unit: Unit, failure: Failure) -> None:
        if failure.kind in (FailureKind.SPACE, FailureKind.REFUSED, FailureKind.DAMAGED):
            self.ending.stopped = self.ending.stopped or failure
            return
        failures = self._failures.setdefault(unit.name, [])
        failures.append(failure)
        self._failed(unit, failures)
        if len(failures) >= ATTEMPTS:
            self._graph.set_aside(unit.name)
            self.ending.aside.append((unit, failures))
        else:
            delay = FIRST_DELAY_S * 2 ** (len(failures) - 1)
            heapq.heappush(self._delayed, (time.monotonic() + delay, unit.name, unit))
