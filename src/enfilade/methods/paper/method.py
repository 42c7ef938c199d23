"""The passes of the published method (§4.3, Fig. 7): keyframes, segments, in-betweens, filtered frames."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cached_property

import numpy as np

from enfilade.cache import LruCache
from enfilade.camera.path import Segment
from enfilade.errors import SettingsError
from enfilade.methods.analysis import Analysis, keyframes_of
from enfilade.methods.base import FRAMES, Inputs, Method, Output, Pass, Task, TaskId
from enfilade.methods.denoise import denoiser_name
from enfilade.methods.paper.inbetween import derive
from enfilade.methods.paper.keyframe import MIN_SPP, trace_keyframe
from enfilade.methods.paper.refine import Refinement, SegmentResult, leaf_of
from enfilade.methods.paper.spatial_filter import reconstruct
from enfilade.methods.paper.support import spatial_support_px, temporal_limits
from enfilade.methods.paper.temporal_filter import Slice, filter_along_flow
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import Frame, Halves, Keyframe, Provenance
from enfilade.settings import (
    AntialiasSettings,
    KeyframeSettings,
    MaskSettings,
    MetricSettings,
    SamplingSettings,
    Settings,
    TraceSettings,
    ViewingSettings,
    WarpSettings,
)

CACHED_KEYFRAMES = 3


class Paper(Method):
    """The published method."""

    name = "paper"
    revision = 10
    settings = (
        TraceSettings,
        SamplingSettings,
        ViewingSettings,
        KeyframeSettings,
        WarpSettings,
        MetricSettings,
        MaskSettings,
        AntialiasSettings,
    )
    passes = (
        Pass("keyframes", Halves),
        Pass("segments", Halves, reads=("keyframes",)),
        Pass("inbetweens", Frame, reads=("keyframes", "segments", "inbetweens")),
        Pass(FRAMES, Frame, reads=("inbetweens",)),
    )

    def __init__(self) -> None:
        self._context: _Context | None = None

    def check(self, settings: Settings) -> None:
        """Refuse a single path a pixel.

        Raises
        ------
        SettingsError
        """
        if settings[SamplingSettings].spp < MIN_SPP:
            raise SettingsError(
                f"--method paper needs --spp {MIN_SPP} or more: keyframes are traced in two halves, by which "
                "the metric tells differences from noise"
            )

    def libraries(self, settings: Settings) -> Mapping[str, str]:
        """The denoiser."""
        del settings
        return {"denoiser": denoiser_name()}

    def keyframes(self, analysis: Analysis) -> list[int]:
        """Initial keyframes (§4.2)."""
        return [frame for segments in analysis.segments() for frame in keyframes_of(segments)]

    def tasks(self, analysis: Analysis) -> Iterable[Task]:
        """Initial keyframes, initial segments, and all frames before and after filtering."""
        path, settings = analysis.path, analysis.settings[AntialiasSettings]
        reach = max(settings.frames, settings.slow_frames) // 2
        shots = zip(path.shots(), analysis.segments(), strict=True)
        for number, (shot, segments) in enumerate(shots):
            for frame in keyframes_of(segments):
                yield Task("keyframes", frame, number)
            for segment in segments:
                ends = TaskId("keyframes", segment.first), TaskId("keyframes", segment.last)
                yield Task("segments", segment.first, number, ends)
            sources = {f: TaskId("segments", s.first) for s in segments for f in s.inbetweens}
            for frame in shot:
                source = sources.get(frame, TaskId("keyframes", frame))
                if (static := path.static_frame(frame)) != frame:
                    source = TaskId("inbetweens", static)
                yield Task("inbetweens", frame, number, (source,))
                window = _window(shot, frame, reach)
                yield Task(FRAMES, frame, number, tuple(TaskId("inbetweens", f) for f in window))

    def run(self, task: Task, inputs: Inputs, walk: Walkthrough) -> Output:
        """Do a task."""
        if self._context is None or self._context.inputs is not inputs or self._context.walk is not walk:
            self._context = _Context(inputs, walk)
        match task.pass_name:
            case "keyframes":
                shading = trace_keyframe(walk, task.frame)
                return Output({task.frame: shading}, {"dropped": shading.dropped})
            case "segments":
                return _refined(task, self._context)
            case "inbetweens":
                return _inbetween(task, self._context)
            case _:
                return _filtered(task, self._context)


class _Context:
    """Inputs of the tasks of a walkthrough, and values that several of them use."""

    def __init__(self, inputs: Inputs, walk: Walkthrough) -> None:
        self.inputs = inputs
        self.walk = walk
        self.keyframes: LruCache[int, Keyframe] = LruCache(CACHED_KEYFRAMES)
        self.slices: dict[int, tuple[Slice, Frame]] = {}

    @cached_property
    def refinement(self) -> Refinement:
        """Splits segments."""
        return Refinement(self.walk)

    def keyframe(self, frame: int, initial: Segment) -> Keyframe:
        """A keyframe of an initial segment."""
        pass_name = "keyframes" if frame in (initial.first, initial.last) else "segments"
        return self.keyframe_of(frame, lambda: self.inputs.record(pass_name, frame))

    def keyframe_of(self, frame: int, shading: Callable[[], Halves]) -> Keyframe:
        """A keyframe with its shading."""
        return self.keyframes.get(frame, lambda: Keyframe(self.walk.view(frame).geometry, shading()))


def _refined(task: Task, context: _Context) -> Output:
    """Split an initial segment until reuse can't be seen; traces the keyframes that this inserts."""
    walk = context.walk
    segment = next(s for s in context.inputs.analysis.segments()[task.shot] if s.first == task.frame)
    inserted: dict[int, Halves] = {}

    def keyframe(frame: int) -> Keyframe:
        if frame in (segment.first, segment.last):
            return context.keyframe(frame, segment)
        if frame not in inserted:
            inserted[frame] = trace_keyframe(walk, frame)
        return context.keyframe_of(frame, lambda: inserted[frame])

    results = context.refinement.refine(segment, keyframe)
    for result in results:
        if result.is_split and result.middle is not None:
            keyframe(result.middle)  # not traced yet where its halves have no in-betweens to compare
    tables = [result.to_table(walk.path.numbers) for result in results]
    return Output(inserted, {"segments": tables, "dropped": sum(s.dropped for s in inserted.values())})


def _inbetween(task: Task, context: _Context) -> Output:
    """A frame before filtering: a repeated pose, a keyframe, or a frame derived from two keyframes."""
    frame, inputs, walk = task.frame, context.inputs, context.walk

    # Copy the frame of a repeated pose.
    static = walk.path.static_frame(frame)
    if static != frame:
        color = inputs.record("inbetweens", static).color
        return Output({frame: Frame(color, np.full(color.shape[:2], Provenance.REUSED, np.uint8))})

    # Take an initial keyframe, or one that was inserted by a split.
    segments = inputs.analysis.segments()[task.shot]
    if frame in keyframes_of(segments):
        return _completed(frame, inputs.record("keyframes", frame))
    initial = next(s for s in segments if s.first < frame < s.last)
    tables = inputs.metadata("segments", initial.first)["segments"]
    results = [SegmentResult.from_table(table, walk.path.numbers) for table in tables]
    if any(result.is_split and result.middle == frame for result in results):
        return _completed(frame, inputs.record("segments", frame))

    # Derive all others from the keyframes of their segment.
    result = leaf_of(results, frame)
    first, last = (context.keyframe(k, initial) for k in (result.first, result.last))
    made, dropped = derive(walk, result, first, last, frame)
    return Output({frame: made}, {"dropped": dropped})


def _completed(frame: int, shading: Halves) -> Output:
    """A keyframe before filtering."""
    color = shading.color
    return Output({frame: Frame(color, np.full(color.shape[:2], Provenance.KEYFRAME, np.uint8))})


def _filtered(task: Task, context: _Context) -> Output:
    """A delivered frame: antialiased along the motion (§5)."""
    frame, walk = task.frame, context.walk
    settings = walk.settings[AntialiasSettings]

    # Load the frames of the support, of which most were used for the previous frame.
    reach = max(settings.frames, settings.slow_frames) // 2
    window = _window(walk.path.shots()[task.shot], frame, reach)
    kept = {f: entry for f, entry in context.slices.items() if f in window}
    slices = kept | {f: _slice(context.inputs, walk, f) for f in window if f not in kept}
    context.slices = slices

    # Filter along the motion.
    here, raw = slices[frame]
    color = filter_along_flow(
        here,
        [slices[f][0] for f in sorted(window, reverse=True) if f < frame],
        [slices[f][0] for f in window if f > frame],
        temporal_limits(walk.viewing.velocity_deg_s(here.flow.speed), here.geometry, settings),
        settings,
    )
    return Output({frame: Frame(color, raw.provenance)})


def _slice(inputs: Inputs, walk: Walkthrough, frame: int) -> tuple[Slice, Frame]:
    """A frame with the spatial part of the filter applied."""
    view, raw = walk.view(frame), inputs.record("inbetweens", frame)
    density, settings = walk.viewing.pixels_per_degree, walk.settings[AntialiasSettings]
    color = reconstruct(raw.color, spatial_support_px(view.speed_deg_s, density, settings))
    return Slice(color, view.geometry, view.flow), raw


def _window(shot: range, frame: int, reach: int) -> range:
    """Frames of a shot that the temporal filter spans."""
    return range(max(frame - reach, shot.start), min(frame + reach + 1, shot.stop))
