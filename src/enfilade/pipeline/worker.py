"""Who does the units of a run: opens its folder and its scene once, then does each unit by its kind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

from enfilade.arrays import release_memory
from enfilade.camera.path import Segment
from enfilade.monitor import Monitor
from enfilade.pipeline.decoupled import DecoupledFrames
from enfilade.pipeline.finish import Antialiasing, trace_reference, write_clip, write_video
from enfilade.pipeline.inbetween import make_copy, make_inbetween, make_keyframe
from enfilade.pipeline.job import Job
from enfilade.pipeline.light import LightTable
from enfilade.pipeline.refine import Verdict, refine
from enfilade.pipeline.survey import Survey, survey_path
from enfilade.pipeline.units import clip_name, clips_of, segment_name, segments_of
from enfilade.pipeline.workshop import Workshop
from enfilade.store import Run

LEAST_CHUNK = 1024


class Worker:
    """Does units of a run.

    Parameters
    ----------
    job
    run
        Opened to write in it, or joined.
    monitor
        Hears of units that say themselves how far they are.
    """

    def __init__(self, job: Job, run: Run, monitor: Monitor) -> None:
        self._job = job
        self._run = run
        self._monitor = monitor
        self._table: tuple[int, LightTable] | None = None  # of the shot that was last worked on
        self._kind = ""

    def do(self, kind: str, facts: Mapping[str, Any]) -> None:
        """Do a unit; when this returns, its line is written or reported.

        Raises
        ------
        EnfiladeError
            What the stages raise.
        ValueError
            There is no such kind.
        """
        self._run.keep_up()
        if kind != self._kind and kind in ("antialias", "clip"):
            release_memory()  # of the stages before
        self._kind = kind
        match kind:
            case "survey":
                self._survey()
            case "clip":
                span = range(facts["frame"], facts["end"])
                write_clip(self._workshop, clip_name(self._job, span), span)
            case "video":
                write_video(self._workshop, clips_of(self._job))
            case "segment":
                self._judge(facts)
            case "raw":
                self._raw(facts)
            case "keyframe":
                self._workshop.keyframe(facts["frame"])
            case "antialias":
                self._antialiasing.make(facts["frame"])
            case "decoupled":
                self._frames.make(facts["frame"])
            case "reference":
                trace_reference(self._workshop, facts["frame"])
            case _:
                self._light(kind, facts)

    @cached_property
    def _workshop(self) -> Workshop:
        return Workshop(self._job, self._job.open_renderer(), self._run, self._monitor)

    @cached_property
    def _antialiasing(self) -> Antialiasing:
        return Antialiasing(self._workshop)

    @cached_property
    def _frames(self) -> DecoupledFrames:
        return DecoupledFrames(self._workshop)

    def _survey(self) -> None:
        workshop, job = self._workshop, self._job
        if job.method == "decoupled":
            _ = workshop.lobe_renderer  # before any work: what it can't do is an error
        survey = survey_path(workshop.views, job.path, job.settings, self._monitor)
        shapes = len(workshop.renderer.describe().shapes)
        workshop.finish("survey", [], survey=survey.to_dict(), views=len(job.path.originals), shapes=shapes)

    def _judge(self, facts: Mapping[str, Any]) -> None:
        whole = None if facts["whole"] is None else self._verdict(facts["whole"])
        refine(self._workshop, Segment(*facts["segment"]), whole)

    def _raw(self, facts: Mapping[str, Any]) -> None:
        frame = facts["frame"]
        if facts.get("keyframe"):
            make_keyframe(self._workshop, frame)
        elif facts.get("copy"):
            make_copy(self._workshop, frame)
        else:
            segment, numbers = Segment(*facts["segment"]), self._job.path.numbers
            verdict = self._verdict(segment_name(numbers[segment.first], numbers[segment.last]))
            make_inbetween(self._workshop, segment, verdict, frame)

    def _verdict(self, unit: str) -> Verdict:
        return Verdict.from_dict(self._line(unit)["verdict"])

    def _light(self, kind: str, facts: Mapping[str, Any]) -> None:
        table = self._light_of(facts["shot"])
        match kind:
            case "draft":
                table.drafts.trace(facts["frame"])
            case "cells":
                table.drafts.scout(facts["frame"])
            case "pilot":
                _ = table.paths
            case "page":
                table.trace(facts["frame"])
            case "light":
                table.prepare(Segment(*facts["segment"]))
            case "shade":
                self._frames.shade(table, facts["frame"])
            case _:
                raise ValueError(f"there is no unit of kind {kind!r}")

    def _light_of(self, shot: int) -> LightTable:
        if self._table is None or self._table[0] != shot:
            self._table = None  # first, so that there is never memory for two
            segments = segments_of(self._job, Survey.from_dict(self._line("survey")["survey"]))
            self._table = shot, LightTable(self._workshop, segments[shot])
        return self._table[1]

    def _line(self, unit: str) -> dict[str, Any]:
        line = self._run.done(unit)
        if line is None:  # one that another command recorded after this worker began
            self._run.refresh()
            line = self._run.done(unit)
        if line is None:
            raise ValueError(f"unit {unit!r} is not finished")
        return line


def smaller(job: Job, share: int) -> Job:
    """The same job with fewer paths in flight: the same result but for rare paths (docs/decoupled.md)."""
    trace = job.settings.trace
    chunk = max(trace.chunk // share, min(LEAST_CHUNK, trace.chunk))
    return replace(job, settings=replace(job.settings, trace=replace(trace, chunk=chunk)))
