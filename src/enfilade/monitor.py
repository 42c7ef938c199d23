"""What a long job says of its progress while it runs: the seam between the pipeline and a screen."""

from __future__ import annotations

from typing import Protocol


class Monitor(Protocol):
    """Someone who watches a run."""

    def stage(self, name: str, total: int) -> None:
        """Say that a stage begins, and how many frames (or other units) are to be done in it."""
        ...

    def advance(self, count: int = 1) -> None:
        """Say that units of the present stage are done; less than 0: that so many were lost."""
        ...

    def extend(self, count: int) -> None:
        """Say that the present stage has grown by that many units (a segment was split), or shrunk."""
        ...

    def say(self, text: str) -> None:
        """Tell something worth knowing: what was continued, dropped, or decided otherwise."""
        ...


class Silence:
    """A monitor that shows nothing."""

    def stage(self, name: str, total: int) -> None:
        """Show nothing."""

    def advance(self, count: int = 1) -> None:
        """Show nothing."""

    def extend(self, count: int) -> None:
        """Show nothing."""

    def say(self, text: str) -> None:
        """Show nothing."""
