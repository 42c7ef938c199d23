"""Progress of loops and of several runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

from enfilade.monitor import Monitor

T = TypeVar("T")


def counted(items: Sequence[T], name: str, monitor: Monitor) -> Iterator[T]:
    """Iterate over the items of a stage and report each when it is done."""
    for done, item in enumerate(items, 1):
        yield item
        monitor.progress(name, done, len(items))


@dataclass(frozen=True)
class Prefixed:
    """A monitor that prefixes the names of stages, which several runs have in common."""

    monitor: Monitor
    prefix: str

    def progress(self, name: str, done: int, total: int) -> None:
        """Show the number of finished items of a stage."""
        self.monitor.progress(f"{self.prefix}: {name}", done, total)

    def message(self, text: str) -> None:
        """Show a message."""
        self.monitor.message(f"{self.prefix}: {text}")
