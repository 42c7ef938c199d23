"""How far a command is with its units, as a monitor is told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from enfilade.executors import Unit
from enfilade.monitor import Monitor


@dataclass
class _Own:
    """What a unit that says itself how far it is has said."""

    stage: str = ""
    total: int = 0
    done: int = 0


class Progress:
    """Counts this command's units for a monitor, by stage, over all shifts.

    Units that were done before are told of and not counted: they took none of the time that has passed.

    Parameters
    ----------
    monitor
    """

    def __init__(self, monitor: Monitor) -> None:
        self.monitor = monitor
        self._before: dict[str, int] | None = {}  # None once they are told of
        self._open: set[str] = set()  # units that are counted and not finished
        self._totals: dict[str, int] = {}
        self._begun: set[str] = set()
        self._own: dict[str, _Own] = {}  # of units in hand
        self._now = ""

    def add(self, unit: Unit, *, is_done: bool) -> None:
        """Take up a unit; one of an earlier shift is counted already."""
        if not unit.stage:
            return
        if is_done:
            if unit.name in self._open:
                self.finish(unit)
            elif self._before is not None:
                self._before[unit.stage] = self._before.get(unit.stage, 0) + 1
            return
        if unit.name in self._open:
            return
        self._open.add(unit.name)
        if unit.stage in self._begun and unit.stage == self._now:
            self.monitor.extend(1)
        else:
            self._totals[unit.stage] = self._totals.get(unit.stage, 0) + 1

    def tell_before(self) -> None:
        """Say what was done before this command began; a second call does nothing."""
        counts = [
            f"{stage} {count} of {count + self._totals.get(stage, 0)}"
            for stage, count in (self._before or {}).items()
        ]
        self._before = None
        if counts:
            self.monitor.say(f"done before: {', '.join(counts)}")

    def begin(self, unit: Unit) -> None:
        """Announce the stage of a unit while nothing else is in hand: what passes from now on is its."""
        if unit.stage and unit.stage != self._now:
            self._announce(unit.stage)

    def finish(self, unit: Unit) -> None:
        """Count a unit as done."""
        self._own.pop(unit.name, None)
        if not unit.stage:
            self._now = ""
            return
        self._open.discard(unit.name)
        self._announce(unit.stage)  # each time: what workers say of their clips comes in between
        self.monitor.advance()

    def hear(self, unit: Unit, what: str, value: Sequence[Any]) -> None:
        """Pass on what a worker says while it does a unit, and keep it in mind until the unit is done.

        Parameters
        ----------
        unit
        what, value
            A call of a monitor, and what it is called with.
        """
        own = self._own.setdefault(unit.name, _Own())
        match what:
            case "stage":
                self._now = ""
                own.stage, own.total = value[0], own.total + value[1]
            case "extend":
                own.total += value[0]
            case "advance":
                own.done += value[0]
            case "say":
                pass
            case _:
                return
        getattr(self.monitor, what)(*value)

    def _announce(self, stage: str) -> None:
        self._now = stage
        self._begun.add(stage)
        self.monitor.stage(stage, self._totals.pop(stage, 0))

    def take_back(self, unit: Unit | None = None) -> None:
        """Uncount what was heard of a unit that failed, or of all that were not done: it is said again.

        Parameters
        ----------
        unit
        """
        for name in list(self._own) if unit is None else [unit.name]:
            own = self._own.pop(name, _Own())
            if own.stage:
                self._now = ""
                self.monitor.stage(own.stage, 0)
                self.monitor.advance(-own.done)
                self.monitor.extend(-own.total)
