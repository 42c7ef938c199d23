"""The passes of every run besides those of its method: analysis before, clips and video after."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.arrays import to_half
from enfilade.errors import ImageError
from enfilade.gbuffer import View, positions
from enfilade.images import encode_video, exact_fps, join_videos, read_exr, video_suffix, write_exr
from enfilade.methods.base import FRAMES, Pass, Task, TaskId
from enfilade.records import F32, Frame
from enfilade.runs.folder import RunFolder
from enfilade.runs.job import Job
from enfilade.settings import LAYERS, OutputSettings, VideoSettings, ViewingSettings

ANALYSIS, CLIPS, VIDEO = Pass("analysis"), Pass("clips", reads=(FRAMES,)), Pass("video", is_shared=False)
VIDEO_PASSES = (CLIPS.name, VIDEO.name)
ANALYZED_FRAMES = 16  # of an analysis task
CLIP_FRAMES = 240  # of a clip; x264 starts anew after 250
SKY_DEPTH = 1e10  # layer Z where nothing is hit, as in Blender


def analysis_tasks(frames: int) -> list[Task]:
    """Tasks that analyze all frames of a path."""
    return [Task(ANALYSIS.name, first) for first in range(0, frames, ANALYZED_FRAMES)]


def video_tasks(frames: int) -> list[Task]:
    """Tasks that encode all frames of a path."""
    clips = [
        Task(CLIPS.name, span.start, needs=tuple(TaskId(FRAMES, frame) for frame in span))
        for span in clip_spans(frames)
    ]
    return [*clips, Task(VIDEO.name, 0, needs=tuple(clip.id for clip in clips))]


def clip_spans(frames: int) -> list[range]:
    """Frames of each clip."""
    return [range(first, min(first + CLIP_FRAMES, frames)) for first in range(0, frames, CLIP_FRAMES)]


def write_frame(stem: Path, frame: Frame, view: View, job: Job) -> Path:
    """Write a delivered frame: linear Rec.709 in half floats, and the AOVs of ``[output] layers``.

    Floats of the AOVs are rounded to 16 significant bits. ``Z``, along the optical axis, and ``P``, in the
    world, are in scene units; ``forward`` and ``backward`` in pixels per frame, x right, y down;
    ``shape_index`` and ``provenance`` are unsigned integers.

    Raises
    ------
    RunFolderError, NoSpaceError
        The file can't be written.
    """
    geometry = view.geometry
    layers: dict[str, Callable[[], Any]] = {
        "Z": lambda: np.where(geometry.is_hit, geometry.depth, np.float32(SKY_DEPTH)),
        "P": lambda: positions(geometry),
        "N": lambda: to_half(geometry.normal),
        "albedo": lambda: to_half(geometry.albedo),
        "shape_index": lambda: geometry.shape_index,
        "forward": lambda: view.flow.forward,
        "backward": lambda: view.flow.backward,
        "provenance": lambda: frame.provenance.astype(np.uint32),
    }
    chosen = job.settings[OutputSettings].chosen
    file = stem.with_name(f"{stem.name}.exr")
    write_exr(
        file,
        {"RGB": to_half(frame.color), **{name: layers[name]() for name in LAYERS if name in chosen}},
        attributes={"framesPerSecond": exact_fps(job.path.fps)},
        is_portable=True,
    )
    return file


def write_clip(run: RunFolder, job: Job, first: int) -> Path:
    """Encode finished frames as a part of the video."""
    span = range(first, min(first + CLIP_FRAMES, len(job.path)))
    file = _clip(run, job, first)
    encode_video(
        file,
        images_of(run, (job.path.numbers[frame] for frame in span)),
        fps=job.path.fps,
        width=job.path.width,
        height=job.path.height,
        settings=job.settings[VideoSettings],
        exposure_ev=job.settings[ViewingSettings].exposure_ev,
    )
    return file


def write_video(run: RunFolder, job: Job) -> Path:
    """Join the clips."""
    settings, spans = job.settings[VideoSettings], clip_spans(len(job.path))
    clips = [_clip(run, job, span.start) for span in spans]
    for clip in clips:
        run.check(clip.relative_to(run.folder).as_posix())
    file = run.folder / f"video{video_suffix(settings.codec)}"
    counted = [(clip, len(span)) for clip, span in zip(clips, spans, strict=True)]
    join_videos(file, counted, fps=job.path.fps)
    return file


def _clip(run: RunFolder, job: Job, first: int) -> Path:
    stem = run.stem(CLIPS.name, job.path.numbers[first])
    return stem.with_name(f"{stem.name}{video_suffix(job.settings[VideoSettings].codec)}")


def images_of(run: RunFolder, numbers: Iterable[int]) -> Iterator[F32]:
    """Colours of finished frames, (H, W, 3) linear; the files are checked as they are read.

    Raises
    ------
    DamagedFileError
    ImageError
        A frame holds a NaN.
    """
    for number in numbers:
        file = run.file_of(FRAMES, number)
        color = read_exr(file)["RGB"].astype(np.float32)
        if np.isnan(color).any():
            raise ImageError(
                f"{file} holds a NaN and can't be encoded. Correct the scene: normals of length 0 and NaN in "
                "textures make such pixels"
            )
        yield color
