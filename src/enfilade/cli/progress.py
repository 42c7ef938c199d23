"""What a terminal shows while a run is going on: a bar for each stage, or plain lines in a log."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

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

from enfilade.monitor import Monitor, Silence

LINE_EVERY_S = 5.0  # a plain line of progress at most this often
PACE_S = 3600.0  # over which a bar takes its pace: a unit may take many minutes


class BarMonitor:
    """Progress bars on a terminal.

    Parameters
    ----------
    progress
        Rich's display, already started.
    """

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._tasks: dict[str, TaskID] = {}
        self._now: str | None = None

    def stage(self, name: str, total: int) -> None:
        """Show a bar for a stage; one that begins again goes on in its old bar."""
        if name in self._tasks:
            self._now = name
            self.extend(total)
            return
        self._tasks[name] = self._progress.add_task(name, total=total)
        self._now = name

    def advance(self, count: int = 1) -> None:
        """Move the present bar."""
        if self._now is not None:
            self._progress.advance(self._tasks[self._now], count)

    def extend(self, count: int) -> None:
        """Lengthen the present bar."""
        if self._now is not None:
            task = self._progress.tasks[self._progress.task_ids.index(self._tasks[self._now])]
            # Told of a total, Progress.update would forget the pace, and with it the time left.
            task.total = (task.total or 0) + count
            if task.completed < task.total:
                task.finished_time = task.finished_speed = None
            self._progress.update(task.id)

    def say(self, text: str) -> None:
        """Print a line above the bars."""
        self._progress.console.print(text, markup=False, highlight=False)


@dataclass
class _Count:
    total: int
    started_s: float
    shown_s: float
    done: int = 0
    shown: int = 0
    first_s: float = 0.0  # when its first units were done
    first: int = 0  # how many they were


class LineMonitor:
    """Progress as plain lines, not too many.

    Parameters
    ----------
    write
        Takes one line.
    clock
        Seconds, rising.
    every_s
        A stage in progress writes at most one line in this time.
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
        self._stages: dict[str, _Count] = {}
        self._now = ""

    def stage(self, name: str, total: int) -> None:
        """Write how the last stage ended, and that one begins; one that goes on says so later."""
        if name in self._stages:
            self._now = name
            self.extend(total)
            return
        self.close()
        self._now = name
        now = self._clock()
        self._stages[name] = _Count(total, now, now)
        self._write(f"{name}: {total} to do")

    def advance(self, count: int = 1) -> None:
        """Write how far the stage is, when the last line is old enough."""
        stage = self._stages.get(self._now)
        if stage is None:
            return
        if stage.done == 0:
            stage.first_s, stage.first = self._clock(), count
        stage.done += count
        if self._clock() - stage.shown_s >= self._every_s:
            self._show(self._now, stage)

    def close(self) -> None:
        """Write how far the stages came, where no line has said so yet."""
        for name, stage in self._stages.items():
            if stage.shown < stage.done:
                self._show(name, stage)

    def _show(self, name: str, stage: _Count) -> None:
        stage.shown_s, stage.shown = self._clock(), stage.done
        self._write(f"{name}: {stage.done}/{stage.total}, {_times(stage, stage.shown_s)}")

    def extend(self, count: int) -> None:
        """Count the added units."""
        if self._now in self._stages:
            self._stages[self._now].total += count

    def say(self, text: str) -> None:
        """Write a line."""
        self._write(text)


class OpenJdMonitor:
    """Progress as Open Job Description wants it on stdout, in percent of the present stage.

    Parameters
    ----------
    write
        Takes one line.
    """

    def __init__(self, write: Callable[[str], object]) -> None:
        self._write = write
        self._stages: dict[str, list[int]] = {}  # done, total
        self._now = ""

    def stage(self, name: str, total: int) -> None:
        """Say that a stage begins or goes on."""
        self._now = name
        if name not in self._stages:
            self._write(f"openjd_status: {name}")
        self._stages.setdefault(name, [0, 0])[1] += total

    def advance(self, count: int = 1) -> None:
        """Say how far the stage is."""
        stage = self._stages.get(self._now)
        if stage is not None:
            stage[0] += count
            self._write(f"openjd_progress: {min(100.0 * stage[0] / max(stage[1], 1), 100.0):.1f}")

    def extend(self, count: int) -> None:
        """Count the added units."""
        if self._now in self._stages:
            self._stages[self._now][1] += count

    def say(self, text: str) -> None:
        """Write a line."""
        self._write(text)


def _times(stage: _Count, now: float) -> str:
    elapsed = now - stage.started_s
    if stage.done >= stage.total:
        return f"took {clock_time(elapsed)}"
    # Where a stage is told of when its first unit is done, that one took none of its time.
    later = stage.done - stage.first
    pace = (now - stage.first_s) / later if later else elapsed / max(stage.done, 1)
    left = pace * (stage.total - stage.done)
    return f"{clock_time(elapsed)} passed, about {clock_time(left)} left"


def clock_time(seconds: float) -> str:
    """Seconds as ``m:ss``, or ``h:mm:ss`` from an hour on."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


@contextmanager
def watch(*, quiet: bool) -> Iterator[Monitor]:
    """Give a monitor that fits the place: silent, bars on a terminal, lines in a log; all on stderr."""
    if quiet:
        yield Silence()
        return
    console = Console(stderr=True)
    if not console.is_terminal:
        lines = LineMonitor(lambda line: click.echo(line, err=True))
        try:
            yield lines
        finally:
            lines.close()
        return
    with bars(console) as progress:
        yield BarMonitor(progress)


def bars(console: Console, clock: Callable[[], float] = time.monotonic) -> Progress:
    """Rich's display of bars with their times, not yet started.

    Parameters
    ----------
    console
    clock
        Seconds, rising.
    """
    columns = (
        TextColumn("{task.description:<12}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    return Progress(*columns, console=console, speed_estimate_period=PACE_S, get_time=clock)
