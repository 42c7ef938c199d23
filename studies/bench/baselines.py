"""Baselines as methods: path tracing, denoised frame by frame."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from enfilade.methods.analysis import Analysis
from enfilade.methods.base import FRAMES, Inputs, Method, Output, Pass, Task, TaskId
from enfilade.methods.denoise import denoise, denoiser_name
from enfilade.methods.reference import Reference
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import F32, U8, Frame, Provenance
from enfilade.renderer import Renderer
from enfilade.settings import (
    LimitSettings,
    Section,
    Settings,
    TraceSettings,
    ViewingSettings,
    option,
)
from studies.bench.accumulation import History, accumulate
from studies.bench.guides import Guides

VARIANTS: dict[str, dict[str, str]] = {  # of denoised baselines: settings
    "": {},
    "fast": {"quality": "fast"},  # at a fifth of the cost of the best quality
    "followed": {"guides": "followed"},
    "accumulated": {"accumulation": "before"},
    "accumulated-fast": {"accumulation": "before", "quality": "fast"},
    "accumulated-after": {"accumulation": "after"},
}


@dataclass(frozen=True)
class DenoiserSettings(Section):
    """Open Image Denoise, as a baseline."""

    table = "denoiser"

    quality: str = option("high", "Quality of its networks.", choices=("high", "balanced", "fast"))
    guides: str = option(
        "first-hit", "Surface of the guides: first, or behind mirrors.", choices=("first-hit", "followed")
    )
    accumulation: str = option(
        "none",
        "Accumulation over time: before denoising or after.",
        choices=("none", "before", "after"),
    )


class Denoised(Method):
    """Path tracing of every frame, denoised; accumulated over time before or after on request."""

    name = "denoised"
    revision = 3
    settings = (*Reference.settings, DenoiserSettings, ViewingSettings)
    passes = (
        Pass("history", History, reads=("history",)),
        Pass(FRAMES, Frame, reads=("history",)),
    )

    def __init__(self) -> None:
        self._guides: tuple[Renderer, Guides] | None = None

    def libraries(self, settings: Settings) -> Mapping[str, str]:
        """The denoiser."""
        del settings
        return {"denoiser": denoiser_name()}

    def tasks(self, analysis: Analysis) -> Iterable[Task]:
        """One task a frame, and one for its history."""
        is_accumulated = analysis.settings[DenoiserSettings].accumulation != "none"
        for number, shot in enumerate(analysis.path.shots()):
            for frame in shot:
                here, before = TaskId("history", frame), TaskId("history", frame - 1)
                if is_accumulated:
                    yield Task("history", frame, number, (before,) if frame > shot.start else ())
                yield Task(FRAMES, frame, number, (here,) if is_accumulated else ())

    def run(self, task: Task, inputs: Inputs, walk: Walkthrough) -> Output:
        """Trace a frame and accumulate it, or deliver it."""
        frame, order = task.frame, walk.settings[DenoiserSettings].accumulation
        if task.pass_name == FRAMES and order != "none":
            color = inputs.record("history", frame).color
            color = self._denoised(walk, frame, color) if order == "before" else color
            return Output({frame: Frame(color, _traced_everywhere(color))})
        traced = Reference().run(task, inputs, walk)
        color = traced.records[frame].color
        if order != "before":
            color = self._denoised(walk, frame, color)
        if order == "none":
            return Output({frame: Frame(color, _traced_everywhere(color))}, traced.metadata)
        history = History(color, np.ones(color.shape[:2], np.float32))
        if task.needs:
            before = task.needs[0].frame
            history = accumulate(color, walk.view(frame), inputs.record("history", before), walk.view(before))
        return Output({frame: history}, traced.metadata)

    def _denoised(self, walk: Walkthrough, frame: int, color: F32) -> F32:
        """An image of a frame, denoised."""
        settings = walk.settings[DenoiserSettings]
        if self._guides is None or self._guides[0] is not walk.renderer:
            self._guides = walk.renderer, Guides(walk.renderer)
        albedo, normal = self._guides[1].images(
            walk.path.cameras[frame],
            seed=walk.settings[TraceSettings].seed,
            frame=walk.path.numbers[frame],
            paths_in_flight=walk.settings[LimitSettings].paths_in_flight,
            is_followed=settings.guides == "followed",
        )
        return denoise(color, albedo, normal, quality=settings.quality)


def _traced_everywhere(color: F32) -> U8:
    return np.full(color.shape[:2], Provenance.KEYFRAME, np.uint8)
