"""A run by several commands at once, on a folder that all of them see: each does a share of a step."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from enfilade.errors import SettingsError, UnfinishedError
from enfilade.executors import Unit
from enfilade.monitor import Monitor
from enfilade.pipeline.crew import Crew, carry_out, shortened
from enfilade.pipeline.job import Job, check_identity, read_job
from enfilade.pipeline.units import STEPS, Blueprint, Step, place_of
from enfilade.pipeline.walkthrough import render
from enfilade.store import Run
from enfilade.store.lock import Lock
from enfilade.store.parts import PARTS

# An NFSv4 server keeps the locks of a host that has gone for 90 s; what other hosts wrote is seen after 60 s.
PATIENCE_S = 120.0
FIRST_PAUSE_S = 2.0  # before the second look; twice that before each next one
LONGEST_PAUSE_S = 15.0


@dataclass(frozen=True)
class Share:
    """One of so many parts of a step.

    Attributes
    ----------
    step : str
        See :data:`~enfilade.pipeline.units.STEPS`.
    number : int
        From 1.
    count : int
    """

    step: str
    number: int = 1
    count: int = 1

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.count:
            raise SettingsError(f"there is no chunk {self.number} of {self.count}; they count from 1")


def go_on(folder: Path, monitor: Monitor, crew: Crew) -> dict[str, Any]:
    """Do all that is left of a run, to the end; see :func:`~enfilade.pipeline.walkthrough.render`.

    Where commands have shared the run, it is waited for those that hold it still, up to two minutes.

    Raises
    ------
    UnfinishedError
        Also where one holds it longer.
    """
    job = read_job(folder)
    if _is_shared(folder):
        Lock(folder, wait=_Patience(monitor, PATIENCE_S).wait).release()
    return render(job, folder, monitor, crew)


def do_share(folder: Path, share: Share, monitor: Monitor, crew: Crew) -> None:
    """Do a share of a step of a run, while other commands do others.

    Where commands have shared the run before, this one waits up to two minutes for its share, which a host
    that is gone may hold, and up to two for what earlier steps have done, which this host may not see yet.

    Parameters
    ----------
    folder
        A run that was begun.
    share
    monitor
    crew

    Raises
    ------
    RunFolderError
        It holds no run, one command has it to itself, or this host would render otherwise.
    SettingsError
        There is no such step, or this host can't encode the video.
    UnfinishedError
        The path is not surveyed yet, units of an earlier step are missing, another command holds the share,
        or some units failed again and again.
    """
    job = read_job(folder)
    step = step_named(job, share.step)
    job.check_scene()
    job.check_video()
    is_shared = _is_shared(folder)
    wait = _Patience(monitor, PATIENCE_S).wait if is_shared else None
    late = _Patience(monitor, PATIENCE_S if is_shared else 0.0)
    with Run.sharing(folder, f"{share.step}-{share.number}-of-{share.count}", wait=wait) as run:
        for note in run.notes:
            monitor.say(note)
        check_identity(job, run)
        while not _is_begun(run, job, step):
            first = STEPS[job.method][0].name
            late.wait(
                f"{folder}: step {step.name!r} comes after step {first!r}, which is not done, or this host "
                f"does not see it yet; run `enfilade work {folder} --step {first}` first, or try again",
                ("survey",),
            )
            run.refresh()

        def is_wanted(unit: Unit) -> bool:
            return unit.kind in step.kinds and _is_in(unit, share, len(job.path))

        while left := carry_out(job, run, crew, monitor, is_wanted=is_wanted):
            late.wait(
                f"{len(left)} units of step {share.step!r} wait for what earlier steps have not finished, or "
                f"this host does not see yet: {shortened(left)}",
                tuple(left),
            )
            run.refresh()


def step_named(job: Job, name: str) -> Step:
    """A step of a job.

    Raises
    ------
    SettingsError
        There is none of that name.
    """
    steps = {step.name: step for step in STEPS[job.method]}
    if name not in steps:
        raise SettingsError(f"--method {job.method} has no step {name!r}; it has {', '.join(steps)}")
    return steps[name]


class _Patience:
    """Looks again, for some time, for what another host holds or has done.

    Parameters
    ----------
    monitor
        Is told once what is waited for.
    limit_s
        From the first wait on, or from when fewer units were left; 0: not at all.
    """

    def __init__(self, monitor: Monitor, limit_s: float) -> None:
        self._monitor = monitor
        self._limit_s = limit_s
        self._pause_s = FIRST_PAUSE_S
        self._begun_s: float | None = None
        self._units: tuple[str, ...] = ()
        self._is_last = False

    def wait(self, what: str, units: tuple[str, ...] = ()) -> None:
        """Wait some seconds, or raise an error that says what for, where it took too long.

        Work may have been done since the last wait: there is another look before the error, and where some
        of the units were finished, the time begins anew.
        """
        now = time.monotonic()
        if self._begun_s is None and self._limit_s:
            self._monitor.say(f"waiting up to {self._limit_s:.0f} s: {what}")
        if self._begun_s is None or units != self._units:
            self._begun_s, self._pause_s, self._is_last = now, FIRST_PAUSE_S, False
        self._units = units
        left_s = self._begun_s + self._limit_s - now
        if left_s <= 0 and not self._is_last:
            self._is_last = True
            return
        if left_s <= 0:
            waited = f" (after {self._limit_s:.0f} s)" if self._limit_s else ""
            raise UnfinishedError(f"{what}{waited}", units)
        time.sleep(min(self._pause_s, left_s))
        self._pause_s = min(2 * self._pause_s, LONGEST_PAUSE_S)


def _is_shared(folder: Path) -> bool:
    """Whether commands have shared the run."""
    return (folder / PARTS).is_dir()


def _is_begun(run: Run, job: Job, step: Step) -> bool:
    """Whether the units of a step can be told, which only the survey does for some."""
    known = {unit.kind for unit in Blueprint(job, run).first()}
    return bool(known & step.kinds) or run.done("survey") is not None


def _is_in(unit: Unit, share: Share, frames: int) -> bool:
    return place_of(unit) * share.count // frames + 1 == share.number
