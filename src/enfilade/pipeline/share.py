"""A run by several commands at once, on a folder that all of them see: each does a share of a step."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from enfilade.errors import SettingsError, UnfinishedError
from enfilade.executors import Unit
from enfilade.monitor import Monitor
from enfilade.pipeline.crew import Crew, carry_out
from enfilade.pipeline.job import Job, check_identity, read_job
from enfilade.pipeline.units import STEPS, Blueprint, Step, place_of
from enfilade.pipeline.walkthrough import render
from enfilade.store import Run


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
    """Do all that is left of a run, to the end; see :func:`~enfilade.pipeline.walkthrough.render`."""
    return render(read_job(folder), folder, monitor, crew)


def do_share(folder: Path, share: Share, monitor: Monitor, crew: Crew) -> None:
    """Do a share of a step of a run, while other commands do others.

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
        There is no such step.
    UnfinishedError
        The path is not surveyed yet, units of an earlier step are missing, or some failed again and again.
    """
    job = read_job(folder)
    step = step_named(job, share.step)
    job.check_scene()
    with Run.sharing(folder, f"{share.step}-{share.number}-of-{share.count}") as run:
        for note in run.notes:
            monitor.say(note)
        check_identity(job, run)
        _check_begun(run, job, step)

        def is_wanted(unit: Unit) -> bool:
            return unit.kind in step.kinds and _is_in(unit, share, len(job.path))

        left = carry_out(job, run, crew, monitor, is_wanted=is_wanted)
    if left:
        raise UnfinishedError(
            f"{len(left)} units of step {share.step!r} wait for what earlier steps have not finished: "
            f"{', '.join(left[:5])}",
            tuple(left),
        )


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


def _check_begun(run: Run, job: Job, step: Step) -> None:
    """Refuse a step whose units only the survey tells, where this host sees no survey."""
    known = {unit.kind for unit in Blueprint(job, run).first()}
    if known & step.kinds or run.done("survey"):
        return
    first = STEPS[job.method][0].name
    raise UnfinishedError(
        f"{run.folder}: step {step.name!r} comes after step {first!r}, which is not done, or this host does "
        f"not see it yet; run `enfilade work {run.folder} --step {first}` first, or try again",
        ("survey",),
    )


def _is_in(unit: Unit, share: Share, frames: int) -> bool:
    return place_of(unit) * share.count // frames + 1 == share.number
