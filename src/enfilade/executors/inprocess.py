"""Units done by this very process, one after the other."""

from __future__ import annotations

import traceback

from enfilade.executors.executor import Event, Failure, Maker, Tell, Worker
from enfilade.executors.unit import Unit


class InProcess:
    """The one worker is this process.

    Parameters
    ----------
    recipe
    tell
        Takes the reports.
    """

    slots = 1

    def __init__(self, recipe: Maker, tell: Tell) -> None:
        self._recipe = recipe
        self._tell = tell
        self._worker: Worker | None = None
        self._share = 1
        self._unit: Unit | None = None

    def begin(self, slot: int, unit: Unit, *, share: int) -> None:
        """Take a unit; it is done when it is waited for."""
        del slot
        if share != self._share:
            self._worker = None
        self._unit, self._share = unit, share

    def wait(self, timeout_s: float | None) -> list[Event]:
        """Do the unit that was begun."""
        del timeout_s
        unit, self._unit = self._unit, None
        if unit is None:
            return []
        try:
            if self._worker is None:
                self._worker = self._recipe.make(self._tell, share=self._share)
            self._worker(unit.kind, unit.facts)
        except Exception as error:  # noqa: BLE001  (whatever it is, the rest goes on)
            self._worker = None
            return [Event(0, Failure.of(error, traceback.format_exc()))]
        return [Event(0)]

    def close(self) -> None:
        """Forget the worker."""
        self._worker = None
