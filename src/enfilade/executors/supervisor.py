"""Hand out units until none is left: tries again what failed, and sets aside what fails again and again."""

from __future__ import annotations

import heapq
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

from enfilade.errors import EnfiladeError
from enfilade.executors.executor import Event, Executor, Failure, FailureKind
from enfilade.executors.graph import Graph
from enfilade.executors.trouble import MACHINE, SMALLER, Trouble
from enfilade.executors.unit import Unit
from enfilade.executors.watch import span

ATTEMPTS = 4  # of a unit
FIRST_DELAY_S = 0.25  # before the second attempt
LONGER = 2  # times longer before each next one
LONGER_OF_MACHINE = 16  # ... where the machine may have failed: 0.25, 4 and 64 s
SMALLEST = int(SMALLER ** (ATTEMPTS - 1))  # one part in so many of the memory: with less none is begun
IDLE_S = 0.05  # looked again for what may be begun
PAUSE_S = 1.0  # ... at most, while all wait


@dataclass(eq=False)
class Ending:
    """How it ended.

    Attributes
    ----------
    aside : list of (Unit, list of Failure)
        What failed again and again, each with all its failures.
    stopped : Failure or None
        What ended it early: a full disk, an error of ours, a damaged file, a machine on which nothing
        succeeds any more (see :class:`~enfilade.executors.trouble.Trouble`).
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
        Told of each failure of a unit, with those that count so far; with :data:`ATTEMPTS` or more it is set
        aside. A failure that does not count, since the machine is in trouble, says so.

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
        self._last: dict[int, Unit] = {}  # what a worker did last
        self._alive: set[int] = set()  # workers that have begun, and keep their scene
        self._given: dict[int, int] = {}  # share of the memory that a worker was last given
        self._shares: dict[str, int] = {}  # ... and of units that had too little, the next
        self._failures: dict[str, list[Failure]] = {}
        self._counts: dict[str, int] = {}  # of them, those that count
        self._delayed: list[tuple[float, str, Unit]] = []
        self._held: deque[Unit] = deque()  # what failed while the machine was in trouble
        self._trouble = Trouble(executor.slots)
        self._trial: int | None = None  # worker of the unit that tries whether the trouble is over
        self._has_success = False

    def run(self) -> None:
        while True:
            self._hand_out()
            if not self._in_hand:
                if self.ending.stopped or not (self._delayed or self._held or self._trouble.is_on):
                    return
                time.sleep(min(max(self._trouble.left_s, IDLE_S), PAUSE_S))
            for event in self._executor.wait(self._patience()):
                self._end(event)

    def _hand_out(self) -> None:
        now = time.monotonic()
        while self._delayed and self._delayed[0][0] <= now:
            self._graph.put_back(heapq.heappop(self._delayed)[2])
        most = self._trouble.slots
        if self._trouble.is_on:
            is_trial = self._trial is None and not self._trouble.left_s
            most = len(self._in_hand) + is_trial
        else:
            while self._held:
                self._graph.put_back(self._held.popleft())
        for slot in self._free():
            if self.ending.stopped or len(self._in_hand) >= most or not self._begin(slot):
                break
        self._let_go()

    def _free(self) -> list[int]:
        """Workers with nothing in hand; where fewer are asked for, first those that have their scene."""
        free = [slot for slot in range(self._executor.slots) if slot not in self._in_hand]
        if self._trouble.slots < self._executor.slots:
            free.sort(key=lambda slot: slot not in self._alive)
        return free

    def _let_go(self) -> None:
        """Where fewer are asked for, those that are too many and wait keep no scene."""
        idle = sorted(self._alive.difference(self._in_hand))
        few = max(self._trouble.slots - len(self._in_hand), 0)
        for slot in idle[few:]:
            self._retire(slot)

    def _retire(self, slot: int) -> None:
        self._alive.discard(slot)
        self._executor.retire(slot)

    def _begin(self, slot: int) -> bool:
        unit = self._graph.take(self._last.get(slot), self._in_hand.values())
        if unit is None and self._trouble.is_on and self._held:
            unit = self._held.popleft()  # last: what has failed least is tried first
        if unit is None:
            return False
        self._in_hand[slot] = unit
        self._last[slot] = unit
        self._trial = slot if self._trouble.is_on else None
        self._alive.add(slot)
        self._given[slot] = max(self._trouble.share, self._shares.get(unit.name, 1))
        try:
            self._executor.begin(slot, unit, share=self._given[slot])
        except (EnfiladeError, OSError) as error:  # no worker can be begun
            self._end(Event(slot, Failure.of(error)))
            return False
        return True

    def _patience(self) -> float | None:
        waits = [self._delayed[0][0] - time.monotonic()] if self._delayed else []
        if self._trouble.is_on and self._trial is None:
            waits.append(self._trouble.left_s)
        return max(min(waits), IDLE_S) if waits else None

    def _end(self, event: Event) -> None:
        unit = self._in_hand.pop(event.slot)
        is_trial, failure = event.slot == self._trial, event.failure
        if is_trial:
            self._trial = None
        if failure is None and not self._is_done(unit):
            failure = Failure(FailureKind.ERROR, "it ended without a line in the ledger")
        if failure is None:
            self._has_success = True
            has_starved = FailureKind.MEMORY in self._kinds(unit)
            self._trouble.succeed(self._given[event.slot] if has_starved else 1)
            self._graph.finish(unit.name)
            for following in self._follow(unit):
                self._graph.add(following)
        else:
            self._fail(unit, event.slot, failure, is_trial=is_trial)
            self._retire(event.slot)  # it may have left a device or a library unfit

    def _kinds(self, unit: Unit) -> list[FailureKind]:
        return [past.kind for past in self._failures.get(unit.name, ())]

    def _fail(self, unit: Unit, slot: int, failure: Failure, *, is_trial: bool) -> None:
        self._failures.setdefault(unit.name, []).append(failure)
        kinds = self._kinds(unit)
        is_scarce = failure.kind is FailureKind.MEMORY
        if is_scarce:
            self._shares[unit.name] = min(SMALLER * self._given[slot], SMALLEST)
        elif kinds.count(FailureKind.DIED) >= ATTEMPTS - 1:  # the last one: nothing has said why they die
            self._shares[unit.name] = SMALLEST
        if self._is_final(failure):
            self.ending.stopped = self.ending.stopped or failure
        elif is_scarce and not self._trouble.is_on and kinds.count(failure.kind) < 3:
            self._trouble.ask_less(unit.name, failure.kind)
            self._count(unit, failure)  # first it shall do with less
        elif self._trouble.fail(unit.name, failure.kind, is_trial=is_trial):
            self._count(unit, failure)
        else:
            self._hold(unit, failure)

    def _is_final(self, failure: Failure) -> bool:
        if failure.kind is FailureKind.DEVICE and not self._has_success:
            before = [past.kind for failures in self._failures.values() for past in failures]
            return before.count(FailureKind.DEVICE) > 1  # two say so, and nobody has seen it work
        return failure.kind in (FailureKind.SPACE, FailureKind.REFUSED, FailureKind.DAMAGED)

    def _count(self, unit: Unit, failure: Failure) -> None:
        failures = self._failures[unit.name]
        count = self._counts[unit.name] = self._counts.get(unit.name, 0) + 1
        if count >= ATTEMPTS:
            self._set_aside(unit)
            return
        self._failed(unit, failures[-count:])
        longer = LONGER_OF_MACHINE if failure.kind in MACHINE else LONGER
        delay = FIRST_DELAY_S * longer ** (count - 1)
        heapq.heappush(self._delayed, (time.monotonic() + delay, unit.name, unit))

    def _set_aside(self, unit: Unit) -> None:
        failures = self._failures[unit.name]
        self._failed(unit, failures)
        self._graph.set_aside(unit.name)
        self.ending.aside.append((unit, failures))

    def _hold(self, unit: Unit, failure: Failure) -> None:
        """Keep a unit until the trouble is over, or give up where it has been for too long."""
        self._held.append(unit)
        if self._trouble.is_hopeless and not self._in_hand:
            self._give_up(failure)
            return
        pause = f" for {span(self._trouble.left_s)}" if self._trouble.left_s else ""
        text = f"{failure.text}; {self._trouble.describe()}: all wait{pause}, and this failure does not count"
        past = self._failures[unit.name][:-1][2 - ATTEMPTS :]
        self._failed(unit, [*past, replace(failure, text=text)])

    def _give_up(self, failure: Failure) -> None:
        said = self._trouble.describe()
        tried = [unit for unit in self._held if len(self._failures[unit.name]) >= ATTEMPTS]
        for unit in tried:
            self._set_aside(unit)
        has_more = bool(self._delayed) or self._graph.take() is not None
        if has_more or len(tried) < len(self._held):
            text = (
                f"nothing succeeds any more: {said}, the last one since {failure.text}. What is finished "
                "stays: see to the machine, then run the same command again"
            )
            self.ending.stopped = Failure(failure.kind, text, failure.log, EnfiladeError(text))
        self._held.clear()
        self._trouble = Trouble(self._executor.slots)
