"""A walkthrough, from scene and camera path to video: the order in which the stages meet."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from enfilade.arrays import release_memory
from enfilade.errors import SettingsError
from enfilade.monitor import Monitor
from enfilade.pipeline.decoupled import LightTable, make_frame
from enfilade.pipeline.finish import antialias_shot, trace_reference, write_video
from enfilade.pipeline.inbetween import make_copy, make_inbetween, make_keyframe
from enfilade.pipeline.job import Job, open_renderer
from enfilade.pipeline.refine import Verdict, refine
from enfilade.pipeline.summary import summarize
from enfilade.pipeline.survey import Survey, initial_segments, survey_path
from enfilade.pipeline.workshop import Workshop
from enfilade.records import Segment
from enfilade.store import Run
from enfilade.video import check_encodable

LEAST_SPP = 2  # of the paper's method


def render(job: Job, folder: Path, monitor: Monitor) -> dict[str, Any]:
    """Render a walkthrough into a run folder, or go on with one.

    Units of work that the folder already holds are not done again. Killed anywhere, the same call
    ends with the same frames.

    Parameters
    ----------
    job
    folder
        The run folder; made if it is not there.
    monitor
        Hears what is going on.

    Returns
    -------
    dict
        The summary, which is also in ``summary.json``; see :func:`summary.summarize`.

    Raises
    ------
    InputError
        The scene, the settings, or a folder that holds another run.
    DeviceError
    """
    _check(job)
    renderer = open_renderer(job.scene, job.settings.trace)
    with Run.open(folder, job.identity(renderer)) as run:
        for note in run.notes:
            monitor.say(note)
        workshop = Workshop(job, renderer, run, monitor)
        survey = _surveyed(workshop)
        match job.method:
            case "reference":
                _render_reference(workshop)
            case "decoupled":
                _render_decoupled(workshop, survey)
            case "paper":
                _render_paper(workshop, survey)
            case _:
                raise ValueError(f"there is no method {job.method!r}")
        video = write_video(workshop)
        summary = summarize(workshop, survey, video)
        run.write_json("summary.json", summary)
    return summary


def _check(job: Job) -> None:
    """Refuse now what would fail, or mislead, after a night of rendering."""
    check_encodable(
        job.settings.video,
        width=job.path.width,
        height=job.path.height,
        exposure_ev=job.settings.viewing.exposure_ev,
    )
    if job.method == "paper" and job.settings.trace.spp < LEAST_SPP:
        raise SettingsError(
            f"--method paper needs --spp {LEAST_SPP} or more: the spread of a pixel's paths tells the metric "
            "what is noise and what is a difference"
        )


def _surveyed(workshop: Workshop) -> Survey:
    if line := workshop.run.done("survey"):
        return Survey.from_dict(line["survey"])
    survey = survey_path(workshop.views, workshop.job.path, workshop.job.settings, workshop.monitor)
    workshop.finish("survey", [], survey=survey.to_dict())
    return survey


def _render_reference(workshop: Workshop) -> None:
    workshop.monitor.stage("trace", len(workshop.job.path))
    for frame in range(len(workshop.job.path)):
        trace_reference(workshop, frame)
        workshop.monitor.advance()


def _render_paper(workshop: Workshop, survey: Survey) -> None:
    path = workshop.job.path
    initial = initial_segments(path, survey, workshop.job.settings)
    workshop.monitor.stage("keyframes and segments", sum(len(s) for s in initial))
    refined = [[kept for s in segments for kept in refine(workshop, s)] for segments in initial]

    workshop.monitor.stage("in-betweens", len(path))
    for shot, segments in zip(path.shots(), refined, strict=True):
        _make_frames(workshop, shot, segments)

    release_memory()
    workshop.monitor.stage("antialiasing", len(path))
    for shot in path.shots():
        antialias_shot(workshop, shot)


def _render_decoupled(workshop: Workshop, survey: Survey) -> None:
    path, settings = workshop.job.path, workshop.job.settings
    spaced = replace(settings, keyframes=replace(settings.keyframes, spacing=settings.light.spacing))
    shots = initial_segments(path, survey, spaced)
    tables = [LightTable(workshop, segments) for segments in shots]
    workshop.monitor.stage("light", sum(len(table.segments) for table in tables))
    for table in tables:
        for segment in table.segments:
            table.prepare(segment)
            workshop.monitor.advance()
    for table in tables:
        for keyframe in table.keyframes:
            table.scout(keyframe)

    workshop.monitor.stage("frames", len(path))
    for shot, table in zip(path.shots(), tables, strict=True):
        for frame in shot:
            make_frame(workshop, table, frame)
            workshop.monitor.advance()


def _make_frames(workshop: Workshop, shot: range, segments: list[tuple[Segment, Verdict]]) -> None:
    keyframes = {s.first for s, _ in segments} | {s.last for s, _ in segments}
    owner = {frame: owned for owned in segments for frame in owned[0].inbetweens}
    for frame in shot:
        if frame in keyframes:
            make_keyframe(workshop, frame)
        elif workshop.job.path.original(frame) != frame:
            make_copy(workshop, frame)
        else:
            make_inbetween(workshop, *owner[frame], frame)
        workshop.monitor.advance()
