"""Units done by this very process, one after the other."""

from __future__ import annotations

import gc
import traceback
from typing import Any

from enfilade.executors.executor import Event, Failure, Hear, Maker, Worker
from enfilade.executors.unit import Unit


class InProcess:
    """The one worker is this process.

    Parameters
    ----------
    recipe
    hear
        Takes the reports, each with the unit in hand.
    """

    slots = 1

    def __init__(self, recipe: Maker, hear: Hear) -> None:
        self._recipe = recipe
        self._hear = hear
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
        unit = self._unit
        if unit is None:
            return []
        self._tell("begin", None)
        try:
            if self._worker is None:
                gc.collect()  # a worker that failed is in circles, and has a scene
                self._worker = self._recipe.make(self._tell, share=self._share)
            self._worker(unit.kind, unit.facts)
        except Exception as error:  # noqa: BLE001  (whatever it is, the rest goes on)
            self._worker = None
            return [Event(0, Failure.of(error, traceback.format_exc()))]
        finally:
            self._unit = None
        return [Event(0)]

    def retire(self, slot: int) -> None:
        """Forget the worker."""
        del slot
        self._worker = None

    def close(self) -> None:
        """Forget the worker."""
        self._worker = None

    def _tell(self, what: str, value: Any) -> None:
        if self._unit is not None:
            self._hear(self._unit, what, value)
