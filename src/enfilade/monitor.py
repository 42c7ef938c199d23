"""Progress of a long job: the interface between the work and a screen."""

from __future__ import annotations

from typing import Protocol


class Monitor(Protocol):
    """Receives the progress of a job."""

    def progress(self, name: str, done: int, total: int) -> None:
        """Show how many of the items of a stage are done."""
        ...

    def message(self, text: str) -> None:
        """Show a message, one line or several."""
        ...


class Silence:
    """A monitor that shows nothing."""

    def progress(self, name: str, done: int, total: int) -> None:
        """Show nothing."""

    def message(self, text: str) -> None:
        """Show nothing."""


SILENCE = Silence()
