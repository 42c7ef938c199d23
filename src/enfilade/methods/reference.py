"""Path tracing of every pixel of every frame: the reference for the other methods."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from enfilade.methods.analysis import Analysis
from enfilade.methods.base import FRAMES, Inputs, Method, Output, Pass, Task
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import Frame, Provenance
from enfilade.renderer import PixelFilter, Purpose
from enfilade.settings import ReferenceSettings, SamplingSettings, TraceSettings


class Reference(Method):
    """Path tracing."""

    name = "reference"
    revision = 5
    settings = (TraceSettings, SamplingSettings, ReferenceSettings)
    passes = (Pass(FRAMES, Frame),)

    def tasks(self, analysis: Analysis) -> Iterable[Task]:
        """One task a frame."""
        for shot, frames in enumerate(analysis.path.shots()):
            for frame in frames:
                yield Task(FRAMES, frame, shot)

    def run(self, task: Task, inputs: Inputs, walk: Walkthrough) -> Output:
        """Trace a frame."""
        del inputs
        shading = walk.trace(
            task.frame,
            Purpose.REFERENCE,
            spp=walk.settings[SamplingSettings].spp,
            pixel_filter=PixelFilter[walk.settings[ReferenceSettings].pixel_filter.name],
        )
        frame = Frame(shading.color, np.full(shading.variance.shape, Provenance.KEYFRAME, np.uint8))
        return Output({task.frame: frame}, {"dropped": shading.dropped})
