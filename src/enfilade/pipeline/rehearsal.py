"""What a walkthrough by ``--method decoupled`` will take, told from a few small frames of it."""

from __future__ import annotations

import math
import tempfile
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from enfilade.camera.path import CameraPath, Segment
from enfilade.monitor import Monitor
from enfilade.pipeline.job import Job
from enfilade.pipeline.light import paths_for
from enfilade.pipeline.walkthrough import render
from enfilade.store import Run, tally

__all__ = ["excerpt_of", "forecast_decoupled"]

PIXELS = 100_000  # of a rehearsed frame: a larger one is made smaller
KEYFRAMES = ("draft", "cells", "keyframe")  # units of a keyframe
FILL = "fill"  # the page of a frame that fills holes: in the ledger a "keyframe", too


@dataclass
class _Spent:
    """Seconds."""

    wall_s: float = 0.0
    cpu_s: float = 0.0

    def add(self, other: _Spent, times: float) -> None:
        self.wall_s += times * other.wall_s
        self.cpu_s += times * other.cpu_s


def forecast_decoupled(job: Job, shots: list[list[Segment]], monitor: Monitor) -> dict[str, Any]:
    """Render one segment from the middle of a path, and multiply what it took.

    What is made smaller counts by its pixels, which is a little too much: part of the cost of a frame does
    not depend on its size.

    Parameters
    ----------
    job
    shots
        The segments with which the method begins, of each shot.
    monitor

    Returns
    -------
    dict
        ``rays``: per pixel and frame, by purpose. ``seconds``, ``cpu_seconds``: of the whole. ``paths``:
        of a keyframe's pixel, the mean over all keyframes. ``rehearsed_frames``, ``rehearsed_size``.
    """
    segments = [segment for shot in shots for segment in shot]
    segment = max(segments, key=lambda s: (_views(job.path, s), -abs(s.first + s.last - len(job.path))))
    small = _smaller(job, segment)
    count = len(small.path)
    identity, lines = _rehearsed(small, _OneStage(monitor))

    pilot = next((line for line in lines if "jnd" in line), None)
    keyframes = [len({s.first for s in shot} | {s.last for s in shot}) for shot in shots]
    paths = float(job.settings.light.paths) if pilot is None else _paths(pilot["jnd"], job, keyframes)
    more = 1.0 if pilot is None else paths / pilot["paths"]
    frames, all_keyframes = len(job.path), sum(keyframes)
    times = {
        "raw": len(job.path.distinct_frames),
        "frame": frames,
        **dict.fromkeys(KEYFRAMES, all_keyframes),
        "keyframe": all_keyframes * more,
        FILL: len(segments) * len(_fills(lines)) * more,  # as many in each as in this one
        "light": len(segments),
        "pilot": len(shots),
    }
    spent = _multiplied(lines, times, frames / count)
    larger = job.path.width * job.path.height / (small.path.width * small.path.height)

    rays = tally(identity, [line for line in lines if line is not pilot], None)["rays"]
    own = sum(line["unit"].startswith("draft ") for line in lines)  # keyframes of the excerpt
    denser = (all_keyframes / frames) / (own / count)  # keyframes, by frame, than in the excerpt
    rays |= {"light": rays["light"] * more * denser, "drafts": rays["drafts"] * denser}
    for kind, sent in (pilot or {}).get("rays", {}).items():
        rays[kind] += len(shots) * sent / (frames * small.path.width * small.path.height)
    return {
        "rays": rays,
        "seconds": larger * spent.wall_s,
        "cpu_seconds": larger * spent.cpu_s,
        "paths": round(paths),
        "rehearsed_frames": count,
        "rehearsed_size": [small.path.width, small.path.height],
    }


class _OneStage:
    """A monitor that takes all stages of a rehearsal for one: it is a single step of the plan."""

    def __init__(self, monitor: Monitor) -> None:
        self._monitor = monitor

    def stage(self, name: str, total: int) -> None:
        """Begin the one stage, or add to it."""
        del name
        self._monitor.stage("rehearsal", total)

    def advance(self, count: int = 1) -> None:
        """Pass it on."""
        self._monitor.advance(count)

    def extend(self, count: int) -> None:
        """Pass it on."""
        self._monitor.extend(count)

    def say(self, text: str) -> None:
        """Pass it on."""
        self._monitor.say(text)


def _smaller(job: Job, segment: Segment) -> Job:
    """A segment of a walkthrough. Its frames may have an odd number of lines, which not every codec takes."""
    settings = replace(job.settings, video=replace(job.settings.video, codec="ffv1"))
    return replace(job, path=excerpt_of(job.path, segment), settings=settings)


def _rehearsed(job: Job, monitor: Monitor) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Identity and ledger of a run that is rendered and thrown away."""
    with tempfile.TemporaryDirectory(prefix="enfilade-") as place:
        folder = Path(place) / "run"
        render(job, folder, monitor)
        run = Run.existing(folder)
        return run.identity, list(run.lines())


def excerpt_of(path: CameraPath, segment: Segment) -> CameraPath:
    """A segment of a path without its rests, at a size that does not take long."""
    scale = min(math.sqrt(PIXELS / (path.width * path.height)), 1.0)
    width, height = (max(round(scale * n), 1) for n in (path.width, path.height))
    span = [
        f for f in range(segment.first, segment.last + 1) if path.static_frame(f) == f or f == segment.first
    ]
    cameras = tuple(replace(path.cameras[f], width=width, height=height) for f in span)
    return CameraPath(cameras, tuple(path.numbers[f] for f in span), path.fps, frozenset())


def _views(path: CameraPath, segment: Segment) -> int:
    return path.distance(segment.last) - path.distance(segment.first)


def _paths(jnd: float, job: Job, keyframes: list[int]) -> float:
    """Paths of a keyframe's pixel, the mean over all: the more a shot has to pool, the fewer each needs."""
    paths = [paths_for(jnd, job.settings.light.quality, count) for count in keyframes]
    return sum(n * count for n, count in zip(paths, keyframes, strict=True)) / sum(keyframes)


def _fills(lines: Sequence[Mapping[str, Any]]) -> set[str]:
    """Units that filled holes between keyframes."""
    return {f"keyframe {number}" for line in lines for number in line.get("fills", ())}


def _multiplied(lines: Sequence[Mapping[str, Any]], times: Mapping[str, float], other_times: float) -> _Spent:
    """What a whole path takes, by the ledger of one segment, and how often the path has a unit of each kind.

    Of units of a kind the one in the middle counts, so that kernels that were compiled for the first do not.
    """
    by_kind: dict[str, list[_Spent]] = defaultdict(list)
    fills = _fills(lines)
    for line in lines:
        costs = line.get("cost", {}).values()
        spent = _Spent(sum(c["wall_s"] for c in costs), sum(c["cpu_s"] for c in costs))
        by_kind[FILL if line["unit"] in fills else line["unit"].split()[0]].append(spent)
    total = _Spent()
    for kind, units in by_kind.items():
        middle = sorted(units, key=lambda spent: spent.cpu_s)[(len(units) - 1) // 2]
        total.add(middle, times.get(kind, other_times))  # the others, survey and video, are of all frames
    return total
