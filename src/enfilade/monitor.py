"""Progress of a long job: the seam between the work and a screen."""

from __future__ import annotations

from typing import Protocol


class Monitor(Protocol):
    """Receives the progress of a job."""

    def progress(self, name: str, done: int, total: int) -> None:
        """Show how many of the items of a stage are done."""
        ...

    def say(self, text: str) -> None:
        """Show a message."""
        ...


class Silence:
    """A monitor that shows nothing."""

    def progress(self, name: str, done: int, total: int) -> None:
        """Show nothing."""

    def say(self, text: str) -> None:
        """Show nothing."""
