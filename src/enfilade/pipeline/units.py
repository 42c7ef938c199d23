"""The units of work of a run, and what each needs: resolved from the survey, extended by splits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from enfilade.camera.path import Segment
from enfilade.executors import Unit
from enfilade.pipeline.job import Job
from enfilade.pipeline.kept import around
from enfilade.pipeline.survey import Survey, initial_segments
from enfilade.store import Run


@dataclass(frozen=True)
class Step:
    """Units that can be done at the same time, by commands that share a run.

    Attributes
    ----------
    name : str
    kinds : set of str
        Of the units.
    is_shared : bool
        Whether there are so many that several commands may share them.
    """

    name: str
    kinds: set[str]
    is_shared: bool = False


BLOCK = 16  # frames that one worker does in a row where it can: they share what is in memory
REACH = 3  # frames to each side over which what lobes scatter is averaged, by `decoupled`
CLIP = 240  # frames that are encoded in one go; x264 begins anew after 250
# Stages, in the order in which their units are begun.
SURVEY, DRAFTS, CELLS, PILOT, KEYFRAMES, LIGHT, INBETWEENS, FRAMES, CLIPS, VIDEO = range(10)

CLIPS_STEP = "clips"
# Steps of a run by method, one after the other.
STEPS: dict[str, list[Step]] = {
    "reference": [
        Step("plan", {"survey"}),
        Step("frames", {"reference"}, is_shared=True),
        Step(CLIPS_STEP, {"clip"}, is_shared=True),
    ],
    "paper": [
        Step("plan", {"survey"}),
        Step("keyframes", {"keyframe"}, is_shared=True),
        Step("segments", {"keyframe", "segment", "raw"}, is_shared=True),
        Step("frames", {"antialias"}, is_shared=True),
        Step(CLIPS_STEP, {"clip"}, is_shared=True),
    ],
    "decoupled": [
        Step("plan", {"survey"}),
        Step("drafts", {"draft"}, is_shared=True),
        Step("cells", {"cells"}, is_shared=True),
        Step("pilot", {"pilot"}),
        Step("keyframes", {"page"}, is_shared=True),
        Step("light", {"light"}, is_shared=True),
        Step("shading", {"shade"}, is_shared=True),
        Step("frames", {"decoupled"}, is_shared=True),
        Step(CLIPS_STEP, {"clip"}, is_shared=True),
    ],
}


class Blueprint:
    """Names and needs of the units of a run.

    Parameters
    ----------
    job
    run
        Its ledger says what is finished, and what came of it.
    """

    def __init__(self, job: Job, run: Run) -> None:
        self._job = job
        self._run = run
        self._numbers = job.path.numbers

    def first(self) -> list[Unit]:
        """Units that can be begun before anything is known."""
        survey = Unit("survey", "survey", order=(SURVEY,))
        if self._job.method != "reference":
            return [survey]
        frames = [self._frame(f, "reference", stage="trace", needs=()) for f in range(len(self._job.path))]
        return [survey, *frames, *self._video()]

    def follow(self, unit: Unit) -> Iterator[Unit]:
        """Units that come of one that is finished."""
        match self._job.method, unit.kind:
            case "paper", "survey":
                yield from self._paper()
            case "paper", "segment":
                yield from self._after_segment(unit)
            case "decoupled", "survey":
                yield from self._decoupled()

    def is_done(self, unit: Unit) -> bool:
        """Whether the ledger has a unit, and its files stand, also those that it made on the way."""
        line = self._run.done(unit.name)
        if line is None:
            return False
        return all(self._run.done(f"keyframe {number}") for number in line.get("fills", ()))

    def survey(self) -> Survey:
        """The survey of the path.

        Raises
        ------
        KeyError
            It is not finished.
        """
        line = self._run.done("survey")
        if line is None:
            raise KeyError("the path is not surveyed")
        return Survey.from_dict(line["survey"])

    def shots(self) -> list[list[Segment]]:
        """Initial segments of each shot."""
        return segments_of(self._job, self.survey())

    def _paper(self) -> Iterator[Unit]:
        path = self._job.path
        for shot, segments in zip(path.shots(), self.shots(), strict=True):
            keyframes = {s.first for s in segments} | {s.last for s in segments}
            for frame in sorted(keyframes):
                yield from self._keyframe(frame, frame)
            for segment in segments:
                yield self._segment(segment, segment.first)
            for frame in shot:
                original = path.static_frame(frame)
                if original != frame:
                    owners = [s.first for s in segments if s.first < original < s.last]
                    facts = {"copy": True, "root": next(iter(owners), original)}
                    yield self._raw(frame, facts, f"raw {self._numbers[original]}")
        reach = max(self._job.settings.antialias.frames, self._job.settings.antialias.slow_frames) // 2
        for shot in path.shots():
            for frame in shot:
                window = range(max(frame - reach, shot.start), min(frame + reach + 1, shot.stop))
                needs = tuple(f"raw {self._numbers[f]}" for f in window)
                yield self._frame(frame, "antialias", stage="antialiasing", needs=needs)
        yield from self._video()

    def _keyframe(self, frame: int, root: int) -> Iterator[Unit]:
        name = f"keyframe {self._numbers[frame]}"
        order, group = (KEYFRAMES, frame, 0), f"keyframe {frame // BLOCK}"
        stage = "keyframes and segments"
        yield Unit(name, "keyframe", {"frame": frame, "root": root}, ("survey",), order, group, stage)
        yield self._raw(frame, {"keyframe": True, "root": root}, name)

    def _segment(self, segment: Segment, root: int, whole: str | None = None) -> Unit:
        ends = self._numbers[segment.first], self._numbers[segment.last]
        return Unit(
            segment_name(*ends),
            "segment",
            {"segment": [segment.first, segment.last, segment.depth], "whole": whole, "root": root},
            tuple(f"keyframe {number}" for number in ends),
            (KEYFRAMES, segment.last, 1, segment.depth),
            f"keyframe {segment.last // BLOCK}",
            "keyframes and segments",
        )

    def _after_segment(self, unit: Unit) -> Iterator[Unit]:
        segment, root, name = Segment(*unit.facts["segment"]), unit.facts["root"], unit.name
        line = self._run.done(name)
        verdict: dict[str, Any] = line["verdict"] if line else {}
        if verdict["is_split"] and verdict["middle"] is not None:
            yield from self._keyframe(verdict["middle"], root)
            for half in segment.split(verdict["middle"]):
                yield self._segment(half, root, name)
            return
        facts = {"segment": [segment.first, segment.last, segment.depth], "root": root}
        for frame in segment.inbetweens:
            if self._job.path.static_frame(frame) == frame:
                yield self._raw(frame, facts, name)

    def _raw(self, frame: int, facts: dict[str, Any], need: str) -> Unit:
        order, group = (INBETWEENS, frame), f"raw {frame // BLOCK}"
        name, facts = f"raw {self._numbers[frame]}", {"frame": frame, **facts}
        return Unit(name, "raw", facts, (need,), order, group, "in-betweens")

    def _decoupled(self) -> Iterator[Unit]:
        for index, (shot, segments) in enumerate(zip(self._job.path.shots(), self.shots(), strict=True)):
            yield from self._lit_shot(index, shot, segments)
        yield from self._video()

    def _lit_shot(self, index: int, shot: range, segments: list[Segment]) -> Iterator[Unit]:
        """What makes the frames of a shot, in rounds: each needs all of the one before."""
        keyframes = sorted({s.first for s in segments} | {s.last for s in segments})
        pilot = [keyframes[len(keyframes) // 2]] if self._job.settings.light.paths == 0 else []
        rounds = [
            [self._light_at(f, index, "draft", DRAFTS) for f in keyframes],
            [self._light_at(f, index, "cells", CELLS) for f in keyframes],
            [self._light_at(f, index, "pilot", PILOT) for f in pilot],
            [self._light_at(f, index, "keyframe", KEYFRAMES) for f in keyframes],
            [self._light_between(s, index) for s in segments],
        ]
        gate = "survey"
        for number, units in enumerate(rounds):
            for unit in units:
                yield replace(unit, needs=(gate,))
            if units:
                gate = f"round {index}.{number}"
                yield Unit(gate, "gate", needs=tuple(unit.name for unit in units), is_gate=True)
        for frame in shot:
            facts = {"frame": frame, "shot": index}
            raw = f"raw {self._numbers[frame]}"
            order, group = (FRAMES, frame, 0), f"frame {frame // BLOCK}"
            if self._job.path.static_frame(frame) == frame:
                yield Unit(raw, "shade", facts, (gate,), order, group, "shading")
            window = around(self._job.path, shot, frame, REACH)
            needs = tuple(f"raw {self._numbers[f]}" for f in window)
            unit = self._frame(frame, "decoupled", stage="frames", needs=needs, facts={"shot": index})
            last = max(window[-1], frame)  # whoever shades it has the others in memory
            yield replace(unit, order=(FRAMES, last, 1), group=f"frame {last // BLOCK}")

    def _light_at(self, frame: int, shot: int, kind: str, stage: int) -> Unit:
        facts, group = {"frame": frame, "shot": shot}, f"{kind} {frame // BLOCK}"
        name = f"{kind} {self._numbers[frame]}"
        return Unit(name, kind if kind != "keyframe" else "page", facts, (), (stage, frame), group, "light")

    def _light_between(self, segment: Segment, shot: int) -> Unit:
        facts = {"segment": [segment.first, segment.last, segment.depth], "shot": shot}
        name = f"light {self._numbers[segment.first]}-{self._numbers[segment.last]}"
        order, group = (LIGHT, segment.first), f"light {segment.first // BLOCK}"
        return Unit(name, "light", facts, (), order, group, "light")

    def _frame(
        self,
        frame: int,
        kind: str,
        *,
        stage: str,
        needs: tuple[str, ...],
        facts: dict[str, Any] | None = None,
    ) -> Unit:
        name, facts = f"frame {self._numbers[frame]}", {"frame": frame, **(facts or {})}
        return Unit(name, kind, facts, needs, (FRAMES, frame), f"frame {frame // BLOCK}", stage)

    def _video(self) -> Iterator[Unit]:
        spans = clips_of(self._job)
        for span in spans:
            needs = tuple(f"frame {self._numbers[f]}" for f in span)
            facts = {"frame": span.start, "end": span.stop}
            yield Unit(clip_name(self._job, span), "clip", facts, needs, (CLIPS, span.start))
        yield Unit(
            "video", "video", needs=tuple(clip_name(self._job, span) for span in spans), order=(VIDEO,)
        )


def segments_of(job: Job, survey: Survey) -> list[list[Segment]]:
    """Initial segments of each shot, as the method places keyframes."""
    settings = job.settings
    if job.method == "decoupled":
        spaced = replace(settings.keyframes, spacing=settings.light.spacing)
        settings = replace(settings, keyframes=spaced)
    return initial_segments(job.path, survey, settings)


def clips_of(job: Job) -> list[range]:
    """Frames of each clip of the video."""
    count = len(job.path)
    return [range(first, min(first + CLIP, count)) for first in range(0, count, CLIP)]


def clip_name(job: Job, span: range) -> str:
    """Name of a clip in the ledger."""
    return f"clip {job.path.numbers[span[0]]}-{job.path.numbers[span[-1]]}"


def segment_name(first: int, last: int) -> str:
    """Name of a segment's refinement in the ledger."""
    return f"segment {first}-{last}"


def place_of(unit: Unit) -> int:
    """The frame by which a unit is shared out: all that comes of one initial segment goes together."""
    facts = unit.facts
    if "root" in facts:
        return int(facts["root"])
    return int(facts["segment"][0] if "segment" in facts else facts.get("frame", 0))
