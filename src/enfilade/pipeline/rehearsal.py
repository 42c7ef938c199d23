"""What a walkthrough by ``--method decoupled`` will take, told from a few small frames of it."""

from __future__ import annotations

import math
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from enfilade.monitor import Monitor, Silence
from enfilade.pipeline.job import Job
from enfilade.pipeline.light import paths_for
from enfilade.pipeline.walkthrough import render
from enfilade.records import CameraPath, Segment
from enfilade.store import Run, tally

__all__ = ["excerpt_of", "forecast_decoupled"]

PIXELS = 100_000  # of a rehearsed frame: a larger one is made smaller
KEYFRAMES = ("draft", "cells", "keyframe")  # units of a keyframe
FRAMES = ("raw", "frame")  # ... and of a frame; that of an initial segment is "light"


@dataclass
class _Spent:
    """Seconds."""

    wall_s: float = 0.0
    cpu_s: float = 0.0

    def add(self, other: _Spent, times: float) -> None:
        self.wall_s += times * other.wall_s
        self.cpu_s += times * other.cpu_s


def forecast_decoupled(job: Job, segments: list[Segment], monitor: Monitor) -> dict[str, Any]:
    """Render one segment from the middle of a path, and multiply what it took.

    What is made smaller counts by its pixels, which is a little too much: part of the cost of a frame does
    not depend on its size.

    Parameters
    ----------
    job
    segments
        All that the method begins with.
    monitor

    Returns
    -------
    dict
        ``rays``: per pixel and frame, by purpose. ``seconds``, ``cpu_seconds``: of the whole. ``paths``:
        of a keyframe's pixel. ``rehearsed_frames``, ``rehearsed_size``.
    """
    segment = max(segments, key=lambda s: (s.last - s.first, -abs(s.first + s.last - len(job.path))))
    # Its frames may have an odd number of lines, which not every codec takes.
    settings = replace(job.settings, video=replace(job.settings.video, codec="ffv1"))
    small = replace(job, path=excerpt_of(job.path, segment), settings=settings)
    count = len(small.path)
    monitor.stage("rehearsal", count)
    with tempfile.TemporaryDirectory(prefix="enfilade-") as place:
        folder = Path(place) / "run"
        render(small, folder, Silence())
        run = Run.existing(folder)
        lines = list(run.lines())
        figures = tally(run.identity, lines, None)
    monitor.advance(count)
    keyframes = {s.first for s in segments} | {s.last for s in segments}
    paths, more = _paths(lines, job, len(keyframes))
    spent = _multiplied(
        lines, keyframes=len(keyframes), segments=len(segments), frames=len(job.path), more=more
    )
    larger = job.path.width * job.path.height / (small.path.width * small.path.height)
    own = sum(line["unit"].startswith("draft ") for line in lines)  # keyframes of the excerpt
    denser = (len(keyframes) / len(job.path)) / (own / count)  # keyframes, by frame, than in the excerpt
    times = {"light": more * denser, "drafts": denser}
    rays = {kind: sent * times.get(kind, 1.0) for kind, sent in figures["rays"].items()}
    return {
        "rays": rays,
        "seconds": larger * spent.wall_s,
        "cpu_seconds": larger * spent.cpu_s,
        "paths": paths,
        "rehearsed_frames": count,
        "rehearsed_size": [small.path.width, small.path.height],
    }


def excerpt_of(path: CameraPath, segment: Segment) -> CameraPath:
    """A segment of a path, at a size that does not take long."""
    scale = min(math.sqrt(PIXELS / (path.width * path.height)), 1.0)
    width, height = (max(round(scale * n), 1) for n in (path.width, path.height))
    span = slice(segment.first, segment.last + 1)
    cameras = tuple(replace(camera, width=width, height=height) for camera in path.cameras[span])
    return CameraPath(cameras, path.numbers[span], path.fps, frozenset())


def _paths(lines: Iterable[Mapping[str, Any]], job: Job, keyframes: int) -> tuple[int, float]:
    """Paths of a keyframe's pixel, and how many times as many as in the excerpt, where fewer are pooled."""
    pilot = next((line for line in lines if "jnd" in line), None)
    if pilot is None:
        return job.settings.light.paths, 1.0
    paths = paths_for(pilot["jnd"], job.settings.light.quality, keyframes)
    return paths, paths / pilot["paths"]


def _multiplied(
    lines: Iterable[Mapping[str, Any]], *, keyframes: int, segments: int, frames: int, more: float
) -> _Spent:
    """What a whole path takes, by the ledger of one segment, whose keyframes have fewer paths by ``more``.

    Of units of a kind the one in the middle counts, so that kernels that were compiled for the first do not.
    """
    by_kind: dict[str, list[_Spent]] = defaultdict(list)
    count = 0
    for line in lines:
        costs = line.get("cost", {}).values()
        spent = _Spent(sum(c["wall_s"] for c in costs), sum(c["cpu_s"] for c in costs))
        kind = line["unit"].split()[0]
        by_kind[kind].append(spent)
        count += kind == "frame"
    total = _Spent()
    for kind, units in by_kind.items():
        middle = sorted(units, key=lambda spent: spent.cpu_s)[(len(units) - 1) // 2]
        if kind in FRAMES:
            total.add(middle, frames)
        elif kind in KEYFRAMES:
            total.add(middle, keyframes * (more if kind == "keyframe" else 1.0))
        elif kind == "light":
            total.add(middle, segments)
        else:  # survey and video, once and by frame; and the pilot, once
            total.add(middle, 1 if kind == "pilot" else frames / count)
    return total
