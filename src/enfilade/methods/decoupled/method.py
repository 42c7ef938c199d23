"""The passes of the decoupled method: irradiance of keyframes, shading of every frame, delivered frames."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from enfilade.camera.path import Segment
from enfilade.methods.analysis import Analysis, keyframes_of
from enfilade.methods.base import FRAMES, Inputs, Method, Output, Pass, Task, TaskId
from enfilade.methods.decoupled.hash_grid_entries import Entries
from enfilade.methods.decoupled.hash_grid_fill import fill_from_images, fill_hash_grid
from enfilade.methods.decoupled.integrator import Integrator
from enfilade.methods.decoupled.irradiance import fill_disocclusions, gather_keyframe
from enfilade.methods.decoupled.light_camera import light_reduction
from enfilade.methods.decoupled.prepass import trace_prepass
from enfilade.methods.decoupled.records import IrradianceImage, ShadedFrame
from enfilade.methods.decoupled.sample_counts import irradiance_spp, specular_spp
from enfilade.methods.decoupled.shading import shade
from enfilade.methods.decoupled.shot import ShotContext
from enfilade.methods.decoupled.temporal import TemporalAccumulation, window
from enfilade.methods.decoupled.virtual_images import VirtualImages
from enfilade.methods.denoise import denoiser_name
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import Frame
from enfilade.renderer import LobeRenderer
from enfilade.settings import (
    DecoupledSettings,
    KeyframeSettings,
    Settings,
    TraceSettings,
    ViewingSettings,
)

LIGHT = "prepass", "hash_grid", "virtual_images"  # passes before final gathers
SPACING = 8  # of keyframes, frames
SPECULAR_SHARE = 0.5  # of the cost of an excerpt's shading, for forecasts: 0 without specular lobes


def _segments(analysis: Analysis) -> list[list[Segment]]:
    """Segments between the keyframes of each shot."""
    return analysis.segments(SPACING, spreads_rest=True)


class Decoupled(Method):
    """Irradiance cached at keyframes; visibility, texture, edges and specular lobes in every frame."""

    name = "decoupled"
    revision = 61
    needs_lobes = True
    has_tone_curve = True
    settings = (TraceSettings, ViewingSettings, KeyframeSettings, DecoupledSettings)
    passes = (
        Pass("prepass", IrradianceImage),
        Pass("hash_grid", Entries, reads=("prepass",), is_barrier=True),
        Pass("virtual_images", Entries, reads=("prepass", "hash_grid"), is_barrier=True),
        Pass("irradiance", IrradianceImage, reads=LIGHT, is_barrier=True),
        Pass("disocclusion", IrradianceImage, reads=(*LIGHT, "irradiance"), is_barrier=True),
        Pass("shading", ShadedFrame, reads=(*LIGHT, "irradiance", "disocclusion"), is_barrier=True),
        Pass(FRAMES, Frame, reads=("shading",)),
    )

    def __init__(self) -> None:
        self._kernels: tuple[LobeRenderer, Integrator, VirtualImages] | None = None
        self._shot: ShotContext | None = None
        self._accumulation = TemporalAccumulation()

    def libraries(self, settings: Settings) -> Mapping[str, str]:
        """The denoiser, where it is used."""
        return {} if settings[DecoupledSettings].denoiser == "none" else {"denoiser": denoiser_name()}

    def keyframes(self, analysis: Analysis) -> list[int]:
        """Keyframes, which have irradiance images."""
        return [frame for segments in _segments(analysis) for frame in keyframes_of(segments)]

    def cost_ratios(
        self,
        settings: Settings,
        pixels: int,
        excerpt: Mapping[str, int],
        whole: Mapping[str, int],
        shots: int,
    ) -> Mapping[str, float]:
        """Cached light of large frames has fewer pixels; short shots need more paths and specular rays."""
        share = 1.0 / light_reduction(pixels) ** 2
        ratios = dict.fromkeys((*LIGHT, "irradiance", "disocclusion"), share)
        spp, in_excerpt = (
            irradiance_spp(settings[DecoupledSettings], keyframes)
            for keyframes in (whole["irradiance"] / shots, excerpt["irradiance"])
        )
        ratios |= dict.fromkeys(("irradiance", "disocclusion"), share * spp / in_excerpt)
        spp, in_excerpt = (
            specular_spp(settings[DecoupledSettings], frames)
            for frames in (whole["shading"] / shots, excerpt["shading"])
        )
        return ratios | {"shading": 1.0 + SPECULAR_SHARE * (spp / in_excerpt - 1.0)}

    def tasks(self, analysis: Analysis) -> Iterable[Task]:
        """Tasks of keyframes, segments, and all frames."""
        path = analysis.path
        shots = zip(path.shots(), _segments(analysis), strict=True)
        for number, (shot, segments) in enumerate(shots):
            keyframes = keyframes_of(segments)
            for pass_name in (*LIGHT, "irradiance"):
                for frame in keyframes:
                    yield Task(pass_name, frame, number)
            for segment in segments:
                yield Task("disocclusion", segment.first, number)
            for frame in shot:
                if path.static_frame(frame) == frame:
                    yield Task("shading", frame, number)
                needs = tuple(TaskId("shading", f) for f in window(path, shot, frame))
                yield Task(FRAMES, frame, number, needs)

    def run(self, task: Task, inputs: Inputs, walk: Walkthrough) -> Output:
        """Do a task."""
        shot, frame = self._context_of(task, inputs, walk), task.frame
        match task.pass_name:
            case "prepass":
                return trace_prepass(shot, frame)
            case "hash_grid":
                return fill_hash_grid(shot, frame)
            case "virtual_images":
                return fill_from_images(shot, frame)
            case "irradiance":
                return gather_keyframe(shot, frame)
            case "disocclusion":
                segment = next(s for s in shot.segments if s.first == frame)
                return fill_disocclusions(shot, segment)
            case "shading":
                return shade(shot, frame)
            case _:
                return self._accumulation.deliver(shot, frame)

    def _context_of(self, task: Task, inputs: Inputs, walk: Walkthrough) -> ShotContext:
        """The context of a task, which is kept until the next one begins."""
        if self._kernels is None or self._kernels[0] is not walk.renderer:
            assert isinstance(walk.renderer, LobeRenderer)  # noqa: S101  (`needs_lobes`)
            self._kernels = walk.renderer, Integrator(walk.renderer), VirtualImages(walk.renderer)
        if self._shot is None or not self._shot.is_of(task, inputs, walk):
            # Free memory before the next shot allocates.
            self._shot, self._accumulation = None, TemporalAccumulation()
            segments = _segments(inputs.analysis)[task.shot]
            self._shot = ShotContext(task.shot, segments, inputs, walk, *self._kernels[1:])
        return self._shot
