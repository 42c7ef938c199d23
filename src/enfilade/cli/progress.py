"""Progress on a terminal as bars, in a log as lines; always on stderr."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

import click
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from enfilade.monitor import Monitor

LINE_EVERY_S = 5.0  # at most one line of progress of a stage in this time
PACE_S = 3600.0  # over which a bar estimates its pace: a task may take many minutes


class BarMonitor:
    """A progress bar for each stage.

    Parameters
    ----------
    bars
        Rich's display, already started.
    """

    def __init__(self, bars: Progress) -> None:
        self._bars = bars
        self._tasks: dict[str, TaskID] = {}

    def progress(self, name: str, done: int, total: int) -> None:
        """Move the bar of a stage."""
        if name not in self._tasks:
            self._tasks[name] = self._bars.add_task(name, total=total, completed=done)
        self._bars.update(self._tasks[name], completed=done, total=total)

    def message(self, text: str) -> None:
        """Print a line above the bars."""
        self._bars.console.print(text, markup=False, highlight=False)


@dataclass
class _Stage:
    started_s: float
    first: int  # items done then
    shown_s: float


class LineMonitor:
    """Progress as plain lines.

    Parameters
    ----------
    write
        Writes one line.
    clock
        Seconds, rising.
    every_s
        A stage writes at most one line in this time.
    """

    def __init__(
        self,
        write: Callable[[str], object],
        clock: Callable[[], float] = time.monotonic,
        every_s: float = LINE_EVERY_S,
    ) -> None:
        self._write = write
        self._clock = clock
        self._every_s = every_s
        self._stages: dict[str, _Stage] = {}

    def progress(self, name: str, done: int, total: int) -> None:
        """Write the state of a stage when it begins, when it ends, and when its last line is old enough."""
        now = self._clock()
        if name not in self._stages:
            self._stages[name] = _Stage(now, done, now)
            if done < total:
                self._write(f"{name}: {total - done} to do")
                return
        stage = self._stages[name]
        if done >= total:
            self._write(f"{name}: {done}/{total}, took {clock_time(now - stage.started_s)}")
        elif now - stage.shown_s >= self._every_s:
            stage.shown_s, passed = now, now - stage.started_s
            times = f"{clock_time(passed)} passed"
            if done > stage.first:
                left = passed / (done - stage.first) * (total - done)
                times += f", about {clock_time(left)} left"
            self._write(f"{name}: {done}/{total}, {times}")

    def message(self, text: str) -> None:
        """Write a line."""
        self._write(text)


class MessageMonitor:
    """Messages as lines, and no progress.

    Parameters
    ----------
    write
        Writes one line.
    """

    def __init__(self, write: Callable[[str], object]) -> None:
        self._write = write

    def progress(self, name: str, done: int, total: int) -> None:
        """Show nothing."""

    def message(self, text: str) -> None:
        """Write a line."""
        self._write(text)


class OpenJdMonitor(MessageMonitor):
    """Progress for Open Job Description, on stdout, in percent of the present stage; messages as above."""

    _name = ""  # of the stage

    def progress(self, name: str, done: int, total: int) -> None:
        """Write the progress of a stage."""
        if name != self._name:
            self._name = name
            self._write(f"openjd_status: {name}")
        self._write(f"openjd_progress: {100.0 * done / max(total, 1):.1f}")


def clock_time(seconds: float) -> str:
    """Seconds as ``m:ss``, or ``h:mm:ss`` from an hour on."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


@contextmanager
def watch(*, quiet: bool) -> Iterator[Monitor]:
    """A monitor on stderr: messages alone, bars on a terminal, or lines in a log."""
    console = Console(stderr=True)
    write = partial(click.echo, err=True)
    if quiet:
        yield MessageMonitor(write)
    elif not console.is_terminal:
        yield LineMonitor(write)
    else:
        columns = (
            TextColumn("{task.description:<12}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
        )
        with Progress(*columns, console=console, speed_estimate_period=PACE_S) as bars:
            yield BarMonitor(bars)
