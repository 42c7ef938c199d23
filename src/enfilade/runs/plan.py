"""Forecast of the cost of a walkthrough, from its analysis and a dry run of a short, small excerpt."""

from __future__ import annotations

import math
import statistics
import tempfile
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from enfilade.camera.path import CameraPath
from enfilade.methods.analysis import Analysis, analyze
from enfilade.methods.walkthrough import Walkthrough
from enfilade.monitor import Monitor
from enfilade.runs.delivery import ANALYSIS, CLIPS, analysis_tasks, video_tasks
from enfilade.runs.folder import RunFolder
from enfilade.runs.job import Job
from enfilade.runs.render import render
from enfilade.settings import VideoSettings

EXCERPT_FRAMES = 9
EXCERPT_PIXELS = 40_000


@dataclass(frozen=True)
class Plan:
    """Forecast of the rendering of a walkthrough.

    Attributes
    ----------
    method : str
    frames : tuple of int
        Numbers of the frames.
    mean_speed_deg_s, slow_percent, specular_percent : tuple of float
        Of each frame.
    keyframes : tuple of int
        Numbers of the initial keyframes; empty where the method has none.
    tasks : dict of str to int
        Number of tasks by pass.
    seconds, cpu_seconds : float
        Forecast of the whole run, on this machine.
    traced_percent : dict of str to float
        Pixels traced in the excerpt, percent, by provenance.
    rays : dict of str to float
        Rays a pixel and frame in the excerpt, by kind.
    excerpt_frames : int
    excerpt_size : tuple of int
        Width and height of the dry run.
    """

    method: str
    frames: tuple[int, ...]
    mean_speed_deg_s: tuple[float, ...]
    slow_percent: tuple[float, ...]
    specular_percent: tuple[float, ...]
    keyframes: tuple[int, ...]
    tasks: dict[str, int]
    seconds: float
    cpu_seconds: float
    traced_percent: dict[str, float]
    rays: dict[str, float]
    excerpt_frames: int
    excerpt_size: tuple[int, int]

    def to_dict(self) -> dict[str, Any]:
        """The plan as plain values, fit for JSON."""
        return asdict(self)


def plan(job: Job, monitor: Monitor, *, has_preflight: bool = False) -> Plan:
    """Analyze every frame of a path, place the initial keyframes, and forecast the cost.

    Parameters
    ----------
    job
    monitor
    has_preflight
        Load the scene in a process of its own, with limits, first.

    Raises
    ------
    InputError
        The scene or a setting, as of :func:`~enfilade.runs.render.render`.
    DeviceError
    """
    job.check()
    if has_preflight:
        job.preflight()
    method, path = job.opened_method(), job.path
    settings = job.rendering_settings()
    walk = Walkthrough(path, settings, job.open_renderer())
    frames = []
    for frame in range(len(path)):
        frames.append(analyze(walk, frame))
        monitor.progress("analysis", frame + 1, len(path))
    analysis = Analysis(path, settings, tuple(frames))
    tasks = [*analysis_tasks(len(path)), *method.tasks(analysis), *video_tasks(len(path))]
    counts = Counter(task.pass_name for task in tasks)
    small = replace(job, path=excerpt_of(path), settings=job.settings.replace(VideoSettings, codec="ffv1"))
    with tempfile.TemporaryDirectory(prefix="enfilade-") as place:
        monitor.progress("dry run", 0, 1)
        summary = render(small, Path(place) / "run", _Quiet(monitor))
        lines = list(RunFolder.read(Path(place) / "run").lines())
        monitor.progress("dry run", 1, 1)
    pixels = path.width * path.height / (small.path.width * small.path.height)
    frames_each = len(path) / len(small.path)  # the excerpt has one task of these passes
    ratios = method.cost_ratios(settings, Counter(line["pass"] for line in lines), counts)
    weights = {name: count * ratios.get(name, 1.0) for name, count in counts.items()}
    wall_s, cpu_s = forecast(lines, {**weights, ANALYSIS.name: frames_each, CLIPS.name: frames_each})
    return Plan(
        method=method.name,
        frames=path.numbers,
        mean_speed_deg_s=tuple(of.speed_deg_s for of in frames),
        slow_percent=tuple(of.slow_percent for of in frames),
        specular_percent=tuple(of.specular_percent for of in frames),
        keyframes=tuple(path.numbers[k] for k in sorted(method.keyframes(analysis))),
        tasks=dict(counts),
        seconds=pixels * wall_s,
        cpu_seconds=pixels * cpu_s,
        traced_percent=summary["traced_percent"],
        rays=summary["rays"],
        excerpt_frames=len(small.path),
        excerpt_size=(small.path.width, small.path.height),
    )


def forecast(lines: Iterable[Mapping[str, Any]], counts: Mapping[str, float]) -> tuple[float, float]:
    """Wall and CPU seconds of so many tasks of each pass, from the ledger of an excerpt.

    The median task of a pass counts, so that the first one, which compiles kernels, does not. Tasks of the
    excerpt's passes cost as much at any place of the path.
    """
    spent: dict[str, list[tuple[float, float]]] = {}
    for line in lines:
        costs = line["cost"].values()
        both = sum(c["wall_s"] for c in costs), sum(c["cpu_s"] for c in costs)
        spent.setdefault(line["pass"], []).append(both)
    wall_s, cpu_s = (
        sum(counts[name] * statistics.median_low([s[k] for s in each]) for name, each in spent.items())
        for k in (0, 1)
    )
    return wall_s, cpu_s


def excerpt_of(path: CameraPath) -> CameraPath:
    """Distinct frames around the middle of the longest shot, at a size that takes little time."""
    shot = max(path.shots(), key=len)
    distinct = [frame for frame in shot if path.static_frame(frame) == frame]
    first = max((len(distinct) - EXCERPT_FRAMES) // 2, 0)
    chosen = distinct[first : first + EXCERPT_FRAMES]
    scale = min(math.sqrt(EXCERPT_PIXELS / (path.width * path.height)), 1.0)
    width, height = (max(round(scale * n), 1) for n in (path.width, path.height))
    cameras = tuple(replace(path.cameras[frame], width=width, height=height) for frame in chosen)
    return CameraPath(cameras, tuple(path.numbers[frame] for frame in chosen), path.fps)


class _Quiet:
    """A monitor that passes on messages alone."""

    def __init__(self, monitor: Monitor) -> None:
        self._monitor = monitor

    def progress(self, name: str, done: int, total: int) -> None:
        """Show nothing: the dry run is one step."""

    def message(self, text: str) -> None:
        """Forward the message."""
        self._monitor.message(text)
