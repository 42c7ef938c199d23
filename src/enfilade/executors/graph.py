"""Which units are finished, which may be begun, and which wait for others."""

from __future__ import annotations

import heapq
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

    def take(self, group: str = "", busy: Collection[str] = ()) -> Unit | None:
        """Take the unit that is to be begun next; None if none is ready.

        Parameters
        ----------
        group
            Of what its worker did last: of equal stage, its units come first.
        busy
            Groups that others work on: of equal stage, their units come last.
        """
        heaps = {name: heap for name, heap in self._ready.items() if heap}
        if not heaps:
            return None
        chosen = min(heaps, key=lambda g: (heaps[g][0][0][:1], g != group, g in busy, heaps[g][0]))
        _, name = heapq.heappop(heaps[chosen])
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
