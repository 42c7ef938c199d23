"""Which units are finished, which may be begun, and which wait for others."""

from __future__ import annotations

import heapq
from bisect import bisect_right
from collections.abc import Collection

from enfilade.executors.unit import Unit


class Graph:
    """Units with what they need. It grows while it is worked on."""

    def __init__(self) -> None:
        self._units: dict[str, Unit] = {}
        self._finished: set[str] = set()
        self._aside: set[str] = set()
        self._open: dict[str, int] = {}  # unit -> how many of its needs are not finished
        self._waiting: dict[str, list[str]] = {}  # unit -> who needs it
        self._ready: dict[str, list[tuple[tuple[int, ...], str]]] = {}  # group -> heap

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
        heads = {group: heap[0][0] for group, heap in self._ready.items()}
        if not heads:
            return None
        stage = min(heads.values())[:1]
        groups = sorted((group for group in heads if heads[group][:1] == stage), key=heads.__getitem__)
        chosen = _chosen({group: heads[group] for group in groups}, last, busy)
        _, name = heapq.heappop(self._ready[chosen])
        if not self._ready[chosen]:
            del self._ready[chosen]
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


def _chosen(ready: dict[str, tuple[int, ...]], last: Unit | None, busy: Collection[Unit]) -> str:
    """Which of some groups, in order, each with that of its first unit, a worker goes on with."""
    if last is not None and last.group in ready:
        return last.group
    taken = {unit.group for unit in busy}
    free = [group for group in ready if group not in taken] or list(ready)
    if not busy:
        return free[0]
    marks = sorted(unit.order for unit in (*busy, last) if unit is not None)
    stretches: dict[int, list[str]] = {}  # by how many workers stand before them
    for group in free:
        stretches.setdefault(bisect_right(marks, ready[group]), []).append(group)
    if last is not None and (following := stretches.get(bisect_right(marks, last.order))):
        return following[0]
    at, longest = max(stretches.items(), key=lambda item: len(item[1]))
    return longest[len(longest) // 2 if at else 0]  # its first half is for him who stands before it
