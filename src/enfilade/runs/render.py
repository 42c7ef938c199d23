"""Rendering a scene along a camera path to frames, video and summary: begin, continue or shard a run."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from enfilade.errors import SettingsError, UnfinishedError
from enfilade.files import write_json
from enfilade.images.codecs import odd_size_note
from enfilade.images.view import white_of
from enfilade.methods.base import Task
from enfilade.monitor import SILENCE, Monitor
from enfilade.runs.delivery import ANALYSIS
from enfilade.runs.executor import Workers
from enfilade.runs.folder import RunFolder
from enfilade.runs.identity import check_place
from enfilade.runs.job import Job, read_job, write_job
from enfilade.runs.ledger import LEDGER_FILE
from enfilade.runs.scheduler import is_done, passes_of, shortened, work
from enfilade.runs.statistics import statistics
from enfilade.settings import LimitSettings, VideoSettings, ViewingSettings

SUMMARY_FILE = "summary.json"
MAX_WHITE_RATIO = 1.5  # of the white of a view and that of the settings


def render(
    job: Job,
    folder: Path,
    monitor: Monitor,
    workers: Workers | None = None,
    *,
    is_verified: bool = False,
    has_preflight: bool = False,
) -> dict[str, Any]:
    """Render a walkthrough into a run folder, or go on with one.

    Finished tasks are not done again. Killed at any moment, the same call ends with the same frames, whatever
    the workers.

    Parameters
    ----------
    job
    folder
        The run folder; made if it is not there.
    monitor
    workers
        By default this process.
    is_verified
        Compare every file with its checksum first, and make damaged ones again. Otherwise sizes are compared
        now, and a checksum when its file is used.
    has_preflight
        Load the scene in a process of its own, with limits, before a new run begins.

    Returns
    -------
    dict
        The summary, which is also in ``summary.json``; see :func:`~enfilade.runs.statistics.statistics`.

    Raises
    ------
    InputError
        The scene, the settings, or a folder that holds another run.
    DeviceError
    NoSpaceError
        The disk is full. All finished tasks stay.
    UnfinishedError
        Some tasks failed again and again; the rest is done.
    """
    workers = workers or Workers()
    workers.check(job.settings[LimitSettings])
    with _created(job, folder, has_preflight=has_preflight) as run:
        for note in (*run.notes, *_video_notes(job)):
            monitor.message(note)
        for name in run.damaged() if is_verified else ():
            run.forget(name)
            monitor.message(f"{name} is missing or damaged: its task is done again, if it is still needed")
        work(job, run, workers, monitor)
        run.sweep()  # of workers that were killed
        summary = statistics(run)
        write_json(folder / SUMMARY_FILE, summary)
    return summary


def prepare(job: Job, folder: Path, monitor: Monitor = SILENCE, *, has_preflight: bool = False) -> None:
    """Begin a run folder without doing any of its tasks, for commands that share it.

    Parameters
    ----------
    job, folder, has_preflight
        As of :func:`render`.
    monitor
        Shown what is to be known of the run.

    Raises
    ------
    InputError
        The scene, the settings, or a folder that holds another run.
    """
    with _created(job, folder, has_preflight=has_preflight) as run:
        for note in (*run.notes, *_video_notes(job)):
            monitor.message(note)


@dataclass(frozen=True)
class Shard:
    """One of several parts of a pass.

    Attributes
    ----------
    pass_name : str
    number : int
        From 1.
    count : int
    """

    pass_name: str
    number: int = 1
    count: int = 1

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.count:
            raise SettingsError(f"there is no shard {self.number} of {self.count}; they count from 1")


def render_shard(folder: Path, shard: Shard, monitor: Monitor, workers: Workers | None = None) -> None:
    """Do a shard of a pass of a run, while other commands do others.

    Parameters
    ----------
    folder
        A run that was begun.
    shard
    monitor
    workers

    Raises
    ------
    RunFolderError
        It holds no run, or one command has it to itself.
    SettingsError
        There is no such pass.
    UnfinishedError
        An earlier pass is not finished, or some tasks failed again and again.
    """
    job, workers = read_job(folder), workers or Workers()
    workers.check(job.settings[LimitSettings])
    names = [of.name for of in passes_of(job)]
    if shard.pass_name not in names:
        raise SettingsError(
            f"--method {job.method} has no pass {shard.pass_name!r}; it has {', '.join(names)}"
        )
    with RunFolder.share(folder) as run:
        for note in run.notes:
            monitor.message(note)
        work(job, run, workers, monitor, chosen=lambda tasks: _of_shard(job, run, tasks, shard))


def _of_shard(job: Job, run: RunFolder, tasks: Sequence[Task], shard: Shard) -> list[Task]:
    """Tasks of a shard, and those of earlier passes whose files are lost."""
    if shard.pass_name != ANALYSIS.name and all(task.pass_name == ANALYSIS.name for task in tasks):
        raise _too_early(run, ANALYSIS.name)
    order = {of.name: index for index, of in enumerate(passes_of(job))}
    earlier = [task for task in tasks if order[task.pass_name] < order[shard.pass_name]]
    numbers = job.path.numbers
    missing = [task for task in earlier if run.recorded(task.pass_name, numbers[task.frame]) is None]
    if missing:
        names = shortened([f"{task.pass_name} {numbers[task.frame]}" for task in missing])
        raise _too_early(run, missing[0].pass_name, f" ({names})")
    lost = [task for task in earlier if not is_done(job, run, task)]
    count = len(job.path)
    mine = [
        task
        for task in tasks
        if task.pass_name == shard.pass_name and _place(task) * shard.count // count + 1 == shard.number
    ]
    return [*lost, *mine]


def _place(task: Task) -> int:
    """The frame by which a task belongs to a shard: its own, or that of a task of its pass that it needs."""
    return min([task.frame, *(need.frame for need in task.needs if need.pass_name == task.pass_name)])


def _too_early(run: RunFolder, pass_name: str, which: str = "") -> UnfinishedError:
    return UnfinishedError(
        f"{run.folder}: pass {pass_name!r} is not finished{which}; first run `enfilade work "
        f"{shlex.quote(str(run.folder))} --pass {pass_name}`"
    )


def _created(job: Job, folder: Path, *, has_preflight: bool) -> RunFolder:
    """The run folder of a job, begun or continued; a refused job leaves no file."""
    job.check()
    made = [place for place in (folder, *folder.parents) if not place.exists()]
    try:
        check_place(folder)
        is_new = not (folder / LEDGER_FILE).exists()
        notes = job.preflight() if has_preflight and is_new else []
        run = RunFolder.create(folder, job.identity())
        run.notes.extend(notes)
    except BaseException:
        for place in made:
            with suppress(OSError):
                place.rmdir()
        raise
    try:
        write_job(folder, job)
    except BaseException:
        run.close()
        raise
    return run


def _video_notes(job: Job) -> list[str]:
    video = job.settings[VideoSettings]
    notes = [odd_size_note(video.codec, job.path.width, job.path.height)]
    if job.opened_method().has_tone_curve:
        sampled, shown = job.settings[ViewingSettings].white, white_of(video)
        if max(shown / sampled, sampled / shown) > MAX_WHITE_RATIO:
            notes.append(
                f"contrasts are sampled for a view that shows luminances up to {sampled:g}, not for that of "
                f"the video; --set viewing.white={shown:g} is nearer to it"
            )
    elif video.ocio:
        notes.append(f"the method assumes the sRGB curve, clipped at 1, not the view of {video.ocio}")
    return [note for note in notes if note]
