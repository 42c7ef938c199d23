"""From raw frames to the result: antialiasing along the flow, files, and the video (§5)."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.gbuffer import positions
from enfilade.images import encode_video, exact_fps, join_videos, read_exr, video_suffix, write_result
from enfilade.methods.paper import Slice, filter_along_flow, reconstruct, temporal_limits
from enfilade.pipeline.inbetween import read_raw
from enfilade.pipeline.views import View
from enfilade.pipeline.workshop import Workshop
from enfilade.records import F32, U8, Frame, Source
from enfilade.renderer import PixelFilter, Purpose

BEYOND = 1e10  # depth of the sky


def result_unit(workshop: Workshop, frame: int) -> str:
    """Name of a delivered frame in the ledger."""
    return f"frame {workshop.number(frame)}"


class Antialiasing:
    """Filters frames along the flow and writes them.

    Memory is bounded by the frames that the filter spans, whatever the length of the shot.

    Parameters
    ----------
    workshop
    """

    def __init__(self, workshop: Workshop) -> None:
        self._workshop = workshop
        self._window: dict[int, _Raw] = {}

    def make(self, frame: int) -> None:
        """Filter a frame, whose neighbours are in the run folder."""
        workshop, settings = self._workshop, self._workshop.job.settings.antialias
        if workshop.run.done(result_unit(workshop, frame)):
            return
        reach = max(settings.frames, settings.slow_frames) // 2
        shot = next(shot for shot in workshop.job.path.shots() if frame in shot)
        span = range(max(frame - reach, shot.start), min(frame + reach + 1, shot.stop))
        kept = {f: raw for f, raw in self._window.items() if f in span}
        self._window = kept | {f: _raw(workshop, f) for f in span if f not in kept}
        color = _filtered(workshop, frame, self._window)
        here = self._window[frame]
        made = Frame(color, here.source)
        write_frame_result(workshop, frame, workshop.views[frame], made)


def trace_reference(workshop: Workshop, frame: int) -> None:
    """Trace and antialias a whole frame by itself: what the savings are measured against (ART)."""
    if workshop.run.done(result_unit(workshop, frame)):
        return
    view = workshop.views[frame]
    pixel_filter = PixelFilter[workshop.job.settings.trace.pixel_filter.name]
    everything = np.ones(view.geometry.item.shape, bool)
    shading = workshop.trace(frame, everything, Purpose.REFERENCE, pixel_filter)
    source = np.full(everything.shape, Source.KEYFRAME, np.uint8)
    made = Frame(shading.color.reshape(*everything.shape, 3), source)
    write_frame_result(workshop, frame, view, made, shading.dropped)


def write_clip(workshop: Workshop, name: str, span: range) -> None:
    """Encode finished frames, a part of the video."""
    job, file = workshop.job, _clip(workshop, span)
    workshop.monitor.stage("video", len(span))
    with workshop.costs.of("video"):
        encode_video(
            file,
            _finished(workshop, span),
            fps=job.path.fps,
            width=job.path.width,
            height=job.path.height,
            settings=job.settings.video,
            exposure_ev=job.settings.viewing.exposure_ev,
        )
    workshop.finish(name, [file])


def write_video(workshop: Workshop, spans: Sequence[range]) -> None:
    """Put the clips together."""
    job = workshop.job
    workshop.monitor.stage("video", 0)
    clips = [_clip(workshop, span) for span in spans]
    with workshop.costs.of("video"):
        for clip in clips:
            workshop.run.check(clip)
        file = workshop.run.folder / f"video{video_suffix(job.settings.video.codec)}"
        counted = [(clip, len(span)) for clip, span in zip(clips, spans, strict=True)]
        join_videos(file, counted, fps=job.path.fps)
    workshop.finish("video", [file])


def _clip(workshop: Workshop, span: range) -> Path:
    suffix = video_suffix(workshop.job.settings.video.codec)
    return workshop.run.file("clips", workshop.number(span.start)).with_suffix(suffix)


@dataclass(frozen=True, eq=False)
class _Raw:
    """A frame before the temporal filter, and why its pixels have their values."""

    slice: Slice
    source: U8


def _raw(workshop: Workshop, frame: int) -> _Raw:
    view = workshop.views[frame]
    with workshop.costs.of("files"):
        raw = read_raw(workshop, frame)
    support = workshop.spatial_support_px(view)
    with workshop.costs.of("antialias"):
        color = reconstruct(raw.color, support)
    return _Raw(Slice(color, view.geometry, view.flow), raw.source)


def _filtered(workshop: Workshop, frame: int, window: dict[int, _Raw]) -> F32:
    settings = workshop.job.settings.antialias
    here = window[frame].slice
    speed_deg_s = workshop.job.viewing.velocity_deg_s(here.flow.speed)
    with workshop.costs.of("antialias"):
        return filter_along_flow(
            here,
            [window[f].slice for f in sorted(window, reverse=True) if f < frame],
            [window[f].slice for f in sorted(window) if f > frame],
            temporal_limits(speed_deg_s, here.geometry, settings),
            settings,
        )


def write_frame_result(workshop: Workshop, frame: int, view: View, made: Frame, dropped: int = 0) -> None:
    """Write a delivered frame with the layers asked for, and record it.

    Parameters
    ----------
    workshop
    frame
    view
        Of the frame.
    made
    dropped
        Samples left out of it that no other line of the ledger tells of.
    """
    chosen = workshop.job.settings.output.chosen
    file = workshop.run.file("frames", workshop.number(frame))
    with workshop.costs.of("files"):
        write_result(
            file,
            made.color,
            delivered_layers(chosen, view, made.source),
            attributes={"framesPerSecond": exact_fps(workshop.job.path.fps)},
        )
    workshop.finish(
        result_unit(workshop, frame),
        [file],
        frame=workshop.number(frame),
        sources=made.counts,
        dropped=dropped,
    )


def delivered_layers(chosen: Container[str], view: View, source: U8) -> dict[str, Any]:
    """Layers of a delivered frame, those of ``settings.LAYERS`` that are chosen.

    ``Z``, along the optical axis, and ``P``, in the world, are in scene units; where nothing is hit, ``Z`` is
    :data:`BEYOND`, as Blender has it. ``forward`` and ``backward`` are in pixels per frame, x right, y down;
    ``item`` (0 where nothing is hit) and ``source`` (``records.Source``) are unsigned integers.
    """
    geometry = view.geometry
    layers: dict[str, Callable[[], Any]] = {
        "Z": lambda: np.where(geometry.is_hit, geometry.depth, np.float32(BEYOND)),
        "P": lambda: positions(geometry),
        "N": lambda: geometry.normal,
        "albedo": lambda: geometry.albedo,
        "item": lambda: geometry.item,
        "forward": lambda: view.flow.forward,
        "backward": lambda: view.flow.backward,
        "source": lambda: source.astype(np.uint32),
    }
    return {name: layer() for name, layer in layers.items() if name in chosen}


def _finished(workshop: Workshop, span: range) -> Iterator[F32]:
    for frame in span:
        file = workshop.run.file("frames", workshop.number(frame))
        workshop.run.check(file)
        yield read_exr(file)["RGB"].astype(np.float32)
        workshop.monitor.stage("video", 0)
        workshop.monitor.advance()
