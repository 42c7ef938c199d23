"""Which units are finished, which may be begun, and which wait for others."""

from __future__ import annotations

import heapq
from bisect import bisect_left, bisect_right, insort
from collections.abc import Collection
from itertools import count, pairwise

from enfilade.executors.unit import Unit

Order = tuple[int, ...]
Head = tuple[Order, int, str]  # order of a group's first unit, when the group came, its name


class Graph:
    """Units with what they need. It grows while it is worked on.

    Groups with units that are ready are kept in order, so that a unit of a long run is found as fast as one
    of a short run.
    """

    def __init__(self) -> None:
        self._units: dict[str, Unit] = {}
        self._finished: set[str] = set()
        self._aside: set[str] = set()
        self._open: dict[str, int] = {}  # unit -> how many of its needs are not finished
        self._waiting: dict[str, list[str]] = {}  # unit -> who needs it
        self._ready: dict[str, list[tuple[Order, str]]] = {}  # group -> heap
        self._heads: list[Head] = []  # of all these groups, in order
        self._places: dict[str, Head] = {}  # group -> its head
        self._numbers = count()

    def add(self, unit: Unit) -> None:
        """Take up a unit. What it needs may be taken up later.

        Raises
        ------
        ValueError
            There is one of that name.
        """
        if unit.name in self._units:
            raise ValueError(f"there is a unit {unit.name!r} already")
        self._units[unit.name] = unit
        missing = [name for name in dict.fromkeys(unit.needs) if name not in self._finished]
        self._open[unit.name] = len(missing)
        for name in missing:
            self._waiting.setdefault(name, []).append(unit.name)
        if not missing:
            self._offer(unit)

    def finish(self, name: str) -> None:
        """Note that a unit is finished: others may become ready."""
        pending = [name]
        while pending:
            done = pending.pop()
            if done in self._finished:
                continue
            self._finished.add(done)
            for waiting in self._waiting.pop(done, []):
                self._open[waiting] -= 1
                if self._open[waiting] == 0 and waiting not in self._finished:
                    unit = self._units[waiting]
                    if unit.is_gate:
                        pending.append(waiting)
                    else:
                        self._offer(unit)

    def set_aside(self, name: str) -> None:
        """Give a unit up, also before it is taken up; what needs it is never ready."""
        self._aside.add(name)

    def take(self, last: Unit | None = None, busy: Collection[Unit] = ()) -> Unit | None:
        """Take the unit that is to be begun next; None if none is ready.

        Parameters
        ----------
        last
            What its worker did last. Of equal stage, units of its group come first, then those of the group
            that follows, unless others work on it.
        busy
            What others have in hand. Who comes to the end of his stretch takes the middle of the longest
            that nobody works on: so each does groups that follow one another, and what is in memory serves
            for longest.
        """
        if not self._heads:
            return None
        group = self._chosen(last, busy)
        _, name = heapq.heappop(self._ready[group])
        self._place(group)
        return self._units[name]

    def put_back(self, unit: Unit) -> None:
        """Offer a unit again that was taken."""
        self._offer(unit)

    def unfinished(self) -> list[Unit]:
        """Units that are neither finished nor given up, in order."""
        gone = self._finished | self._aside
        left = [u for name, u in self._units.items() if name not in gone and not u.is_gate]
        return sorted(left, key=lambda u: u.order)

    def _offer(self, unit: Unit) -> None:
        if unit.name in self._finished or unit.name in self._aside:
            return
        if unit.is_gate:
            self.finish(unit.name)
        else:
            heapq.heappush(self._ready.setdefault(unit.group, []), (unit.order, unit.name))
            self._place(unit.group)

    def _place(self, group: str) -> None:
        """Put a group, whose units have changed, where its first one belongs among the others."""
        heap, old = self._ready[group], self._places.pop(group, None)
        if old is not None:
            del self._heads[bisect_left(self._heads, old)]
        if not heap:
            del self._ready[group]
            return
        head = (heap[0][0], next(self._numbers) if old is None else old[1], group)
        self._places[group] = head
        insort(self._heads, head)

    def _chosen(self, last: Unit | None, busy: Collection[Unit]) -> str:
        """The group, of those in the first stage, with which a worker goes on."""
        stage = self._heads[0][0][:1]
        end = bisect_right(self._heads, stage, key=_stage_of)
        groups = {unit.group for unit in (*busy, last) if unit is not None} & self._places.keys()
        places = {group: self._places[group] for group in groups if _stage_of(self._places[group]) == stage}
        if last is not None and last.group in places:
            return last.group
        if not busy:
            return self._heads[0][2]
        taken = sorted(bisect_left(self._heads, head, hi=end) for head in places.values())
        if len(taken) == end:
            taken = []  # rather the group of another than nothing
        # Stretches between the units that workers have in hand, or had last.
        marks = sorted(unit.order for unit in (*busy, last) if unit is not None)
        borders = [bisect_left(self._heads, mark, hi=end, key=_order_of) for mark in marks]
        stretches = list(pairwise([0, *borders, end]))
        lengths = [stop - start - sum(start <= at < stop for at in taken) for start, stop in stretches]
        own = 0 if last is None else bisect_right(marks, last.order)
        if last is not None and lengths[own]:
            return self._heads[_nth(stretches[own][0], 0, taken)][2]
        longest = lengths.index(max(lengths))
        middle = lengths[longest] // 2 if longest else 0  # its first half is for him who stands before it
        return self._heads[_nth(stretches[longest][0], middle, taken)][2]


def _order_of(head: Head) -> Order:
    return head[0]


def _stage_of(head: Head) -> Order:
    return head[0][:1]


def _nth(first: int, number: int, taken: list[int]) -> int:
    """The place so many after the first, leaving out some, in order."""
    at = first + number
    for other in taken:
        at += first <= other <= at
    return at
