"""A walkthrough, from scene and camera path to video: what is checked before, and what is told after."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

from enfilade.errors import RunFolderError, SettingsError
from enfilade.executors.opener import check_executor
from enfilade.files import read_json
from enfilade.images.codecs import odd_size_note
from enfilade.monitor import Monitor
from enfilade.pipeline.crew import Crew, carry_out
from enfilade.pipeline.encode import encode_instead, is_of_video
from enfilade.pipeline.job import JOB_FILE, Job
from enfilade.pipeline.summary import summarize
from enfilade.pipeline.units import Blueprint
from enfilade.store import Run
from enfilade.store.identity import RUN_FILE
from enfilade.store.identity import prepare as make_fit

METHODS = ("decoupled", "paper", "reference")
LEAST_SPP = 2  # of the paper's method


def render(
    job: Job,
    folder: Path,
    monitor: Monitor,
    crew: Crew | None = None,
    *,
    is_verified: bool = False,
    is_tried: bool = False,
) -> dict[str, Any]:
    """Render a walkthrough into a run folder, or go on with one.

    Units of work that the folder already holds are not done again. Killed anywhere, the same call
    ends with the same frames, whoever does the work.

    Parameters
    ----------
    job
    folder
        The run folder; made if it is not there.
    monitor
        Hears what is going on.
    crew
        Who does the work; this process by default.
    is_verified
        Compare every file with its checksum first, and make again what is damaged. Otherwise sizes are
        looked at now, and a file's checksum when it is used.
    is_tried
        Let a process of its own load the scene before a new run begins.

    Returns
    -------
    dict
        The summary, which is also in ``summary.json``; see :func:`summary.summarize`.

    Raises
    ------
    InputError
        The scene, the settings, or a folder that holds another run.
    DeviceError
    NoSpaceError
        The disk is full. What is finished stays.
    UnfinishedError
        Some units failed again and again; the rest is done.
    """
    crew = crew or Crew()
    check_executor(crew.executor)
    check_job(job)
    if is_tried:
        _try(job, folder)
    with Run.open(folder, job.identity(), kept=lambda keys: _compared(job, folder, keys)) as run:
        for note in (*run.notes, *_video_notes(job)):
            monitor.say(note)
        _write_job(run, job)
        if is_verified:
            _verify(run, monitor)
        carry_out(job, run, crew, monitor)
        video = next(iter((run.done("video") or {})["files"]))
        summary = summarize(
            run, Blueprint(job, run).survey(), video, has_workers=crew.executor != "in-process"
        )
        run.write_json("summary.json", summary)
    return summary


# What does not depend on a section of the settings, by method; what depends on all of them stands nowhere.
KEPT: dict[str, dict[str, str]] = {
    "paper": {
        "video": "everything but the video",
        "output": "everything but the layers of the frames",
        "antialias": "the keyframes",
        "warp": "the keyframes",
        "metric": "the keyframes",
    },
    "decoupled": {"video": "everything but the video", "output": "everything but the layers of the frames"},
    "reference": {"video": "everything but the video", "output": "everything but the layers of the frames"},
}


def kept(method: str, keys: list[str]) -> str:
    """Say what of another run would have been the same, by the keys in which it differs; empty: nothing.

    Parameters
    ----------
    method
    keys
        Such as ``settings.video.codec``.
    """
    sections = {
        "video" if is_of_video(key) else key.split(".")[1] if key.startswith("settings.") else key
        for key in keys
    }
    found = {KEPT.get(method, {}).get(section, "") for section in sections}
    if len(found) != 1 or "" in found:
        return ""
    return f"Of what is there, this would be the same: {found.pop()}\n"


def _compared(job: Job, folder: Path, keys: list[str]) -> str:
    """What can be had of another run, for the message that refuses its folder."""
    return kept(job.method, keys) + encode_instead(job, folder, keys)


def prepare(job: Job, folder: Path, *, is_tried: bool = False) -> None:
    """Begin a run folder without doing any of its work: for commands elsewhere that share it.

    Parameters
    ----------
    job, folder, is_tried
        As of :func:`render`.

    Raises
    ------
    InputError
        The scene, the settings, or a folder that holds another run.
    """
    check_job(job)
    if is_tried:
        _try(job, folder)
    with Run.open(folder, job.identity(), kept=lambda keys: _compared(job, folder, keys)) as run:
        _write_job(run, job)


def _video_notes(job: Job) -> list[str]:
    """What one should know of the video before its frames are rendered."""
    video = job.settings.video
    odd = odd_size_note(video.codec, job.path.width, job.path.height)
    unseen = f"what is seen of noise is judged by the sRGB curve, clipped at 1, not by a view of {video.ocio}"
    return [note for note in (odd, unseen if video.ocio else "") if note]


def _write_job(run: Run, job: Job) -> None:
    table = job.to_json()
    try:
        is_same = read_json(run.folder / JOB_FILE) == table
    except RunFolderError:  # there is none yet, or it is damaged
        is_same = False
    if not is_same:
        run.write_json(JOB_FILE, table)


def _verify(run: Run, monitor: Monitor) -> None:
    for name in run.damaged():
        run.forget(name)
        monitor.say(f"{name} is missing or damaged: what made it is done again")


def _try(job: Job, folder: Path) -> None:
    """Let a process of its own load the scene of a run that is not begun yet, if there is a place for it."""
    if (folder / RUN_FILE).exists():
        return
    made = [place for place in (folder, *folder.parents) if not place.exists()]
    try:
        _check_place(folder)
        job.check_scene(is_tried=True)
    except BaseException:
        for place in made:  # what is refused leaves nothing
            with suppress(OSError):
                place.rmdir()
        raise


def _check_place(folder: Path) -> None:
    make_fit(folder)
    if not os.access(folder, os.W_OK | os.X_OK):
        raise RunFolderError(f"can't write in {folder}; choose another --out")


def check_job(job: Job) -> None:
    """Refuse now what would fail, or mislead, after a night of rendering; the scene is not loaded.

    Raises
    ------
    InputError
        The scene, the screen, the video or the paths that are asked for.
    """
    _ = job.viewing  # what is wrong with it raises here
    job.check_scene()
    if job.method not in METHODS:
        raise ValueError(f"there is no method {job.method!r}")
    job.check_video()
    if job.method == "paper" and job.settings.trace.spp < LEAST_SPP:
        raise SettingsError(
            f"--method paper needs --spp {LEAST_SPP} or more: the spread of a pixel's paths tells the metric "
            "what is noise and what is a difference"
        )
