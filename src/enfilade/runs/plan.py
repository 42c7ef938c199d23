"""Forecast of the cost of a walkthrough, from dry runs of a short excerpt in two sizes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import fmean
from typing import Any

from enfilade.camera.path import CameraPath
from enfilade.files import scratch_folder
from enfilade.methods.analysis import Analysis, analyze
from enfilade.methods.base import Method, Task
from enfilade.methods.walkthrough import Walkthrough
from enfilade.monitor import Monitor
from enfilade.renderer import Renderer
from enfilade.runs.delivery import ANALYSIS, CLIPS, analysis_tasks, video_tasks
from enfilade.runs.folder import RunFolder
from enfilade.runs.graph import TaskGraph
from enfilade.runs.job import Job, write_job
from enfilade.runs.scheduler import passes_of
from enfilade.runs.statistics import statistics
from enfilade.runs.worker import Worker, analysis_of
from enfilade.settings import VideoSettings

EXCERPT_FRAMES = 4
SMALL_PIXELS = 768  # of a frame whose cost is that of its tasks, whatever their size
LARGE_PIXELS = 16_000
ANALYZED_PIXELS = 5_000


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
    analyzed_size : tuple of int
        Width and height of the frames of the analysis. Where it is not that of the path, velocities, slow and
        specular pixels, and keyframes are estimates.
    tasks : dict of str to int
        Number of tasks by pass.
    seconds, cpu_seconds : float
        Forecast of all tasks, in one process on this machine. Loading the scene and compiling its kernels is
        not included.
    traced_percent : dict of str to float
        Pixels traced in the excerpt, percent, by provenance.
    rays : dict of str to float
        Forecast of the rays a pixel and frame, by kind.
    excerpt_frames : int
    excerpt_size : tuple of int
        Width and height of the larger dry run.
    """

    method: str
    frames: tuple[int, ...]
    mean_speed_deg_s: tuple[float, ...]
    slow_percent: tuple[float, ...]
    specular_percent: tuple[float, ...]
    keyframes: tuple[int, ...]
    analyzed_size: tuple[int, int]
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


@dataclass(frozen=True)
class DryRun:
    """A finished excerpt.

    Attributes
    ----------
    pixels : int
        Of a frame.
    lines : sequence of dict
        Its ledger.
    summary : dict
        See :func:`enfilade.runs.statistics.statistics`.
    """

    pixels: int
    lines: Sequence[Mapping[str, Any]]
    summary: Mapping[str, Any]

    def costs(self) -> dict[str, tuple[float, float]]:
        """Mean wall and CPU seconds of the tasks of each pass.

        The first one, which compiles kernels and fills caches, does not count where there are others.
        """
        spent: dict[str, list[tuple[float, float]]] = {}
        for line in self.lines:
            parts = line["cost"].values()
            both = sum(part["wall_s"] for part in parts), sum(part["cpu_s"] for part in parts)
            spent.setdefault(line["pass"], []).append(both)
        later = {name: each[1:] or each for name, each in spent.items()}
        return {name: (fmean(s[0] for s in each), fmean(s[1] for s in each)) for name, each in later.items()}


def plan(job: Job, monitor: Monitor, *, has_preflight: bool = False) -> Plan:
    """Analyze every frame of a path at a small size, place the initial keyframes, and forecast the cost.

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
    notes = job.preflight() if has_preflight else None
    method, path, renderer = job.opened_method(), job.path, job.open_renderer()
    for note in renderer.describe().notes if notes is None else notes:
        monitor.message(note)
    analysis = _analyzed(job, renderer, monitor)
    if analysis.warning:
        monitor.message(analysis.warning)
    viewing = replace(job, path=analysis.path).viewing
    small, large = _dry_runs(job, method, renderer, monitor)
    tasks = [*analysis_tasks(len(path)), *method.tasks(analysis), *video_tasks(len(path))]
    counts = Counter(task.pass_name for task in tasks)
    excerpt = Counter(line["pass"] for line in large.lines)
    pixels, shots = path.width * path.height, len(path.shots())
    ratios = method.cost_ratios(analysis.settings, pixels, excerpt, counts, shots)
    frames_each = len(path) / large.summary["frames"]  # the excerpt has one task of these passes
    weights = {**counts, ANALYSIS.name: frames_each, CLIPS.name: frames_each}
    wall_s, cpu_s = forecast(small, large, pixels, weights, ratios)
    return Plan(
        method=method.name,
        frames=path.numbers,
        mean_speed_deg_s=tuple(viewing.velocity_deg_s(of.speed_px) for of in analysis.frames),
        slow_percent=tuple(of.slow_percent for of in analysis.frames),
        specular_percent=tuple(of.specular_percent for of in analysis.frames),
        keyframes=tuple(path.numbers[k] for k in sorted(method.keyframes(analysis))),
        analyzed_size=(analysis.path.width, analysis.path.height),
        tasks=dict(counts),
        seconds=wall_s,
        cpu_seconds=cpu_s,
        traced_percent=large.summary["traced_percent"],
        rays=forecast_rays(large, len(path), counts, ratios),
        excerpt_frames=large.summary["frames"],
        excerpt_size=tuple(large.summary["size"]),
    )


def forecast(
    small: DryRun,
    large: DryRun,
    pixels: int,
    weights: Mapping[str, float],
    ratios: Mapping[str, float],
) -> tuple[float, float]:
    """Wall and CPU seconds of a run, from an excerpt in two sizes.

    A task has a fixed cost, and a cost that is proportional to the pixels of a frame.

    Parameters
    ----------
    small, large
    pixels
        Of a frame of the run.
    weights
        Number of tasks of each pass.
    ratios
        See :meth:`enfilade.methods.base.Method.cost_ratios`; of the part that is proportional to the pixels.
    """
    more = (pixels - small.pixels) / max(large.pixels - small.pixels, 1)
    fixed, whole = small.costs(), large.costs()
    wall_s, cpu_s = (
        sum(
            weights[name] * _extrapolated(fixed[name][k], whole[name][k], ratios.get(name, 1.0) * more)
            for name in whole
        )
        for k in (0, 1)
    )
    return wall_s, cpu_s


def forecast_rays(
    run: DryRun, frames: int, counts: Mapping[str, int], ratios: Mapping[str, float]
) -> dict[str, float]:
    """Rays a pixel and frame of a run of so many frames and tasks, by kind; see :func:`forecast`."""
    done = Counter(line["pass"] for line in run.lines)
    rays: dict[str, float] = {}
    for line in run.lines:
        name = line["pass"]
        weight = ratios.get(name, 1.0) * counts[name] / (done[name] * frames * run.pixels)
        for kind, count in line.get("rays", {}).items():
            rays[kind] = rays.get(kind, 0.0) + weight * count
    return rays


def _extrapolated(small: float, large: float, ratio: float) -> float:
    # The only task of a pass costs more at the small size, where it compiles kernels.
    fixed = min(small, large)
    return fixed + ratio * (large - fixed)


def excerpt_of(path: CameraPath) -> CameraPath:
    """Distinct frames around the middle of the longest shot."""
    shot = max(path.shots(), key=len)
    distinct = [frame for frame in shot if path.static_frame(frame) == frame]
    first = max((len(distinct) - EXCERPT_FRAMES) // 2, 0)
    chosen = distinct[first : first + EXCERPT_FRAMES]
    return CameraPath(
        tuple(path.cameras[frame] for frame in chosen),
        tuple(path.numbers[frame] for frame in chosen),
        path.fps,
    )


def scaled(path: CameraPath, pixels: int) -> CameraPath:
    """The same path with frames of at most about so many pixels."""
    scale = min(math.sqrt(pixels / (path.width * path.height)), 1.0)
    width, height = (max(round(scale * n), 1) for n in (path.width, path.height))
    cameras = tuple(replace(camera, width=width, height=height) for camera in path.cameras)
    return replace(path, cameras=cameras)


def _analyzed(job: Job, renderer: Renderer, monitor: Monitor) -> Analysis:
    """The analysis of all frames, at a small size."""
    path, settings = scaled(job.path, ANALYZED_PIXELS), job.rendering_settings()
    walk = Walkthrough(path, settings, renderer)
    frames = []
    for frame in range(len(path)):
        frames.append(analyze(walk, frame))
        monitor.progress("analysis", frame + 1, len(path))
    return Analysis(path, settings, tuple(frames))


def _dry_runs(job: Job, method: Method, renderer: Renderer, monitor: Monitor) -> tuple[DryRun, DryRun]:
    """The excerpt in two sizes."""
    runs = []
    sizes = (SMALL_PIXELS, LARGE_PIXELS)
    for number, pixels in enumerate(sizes):
        monitor.progress("dry run", number, len(sizes))
        path = scaled(excerpt_of(job.path), pixels)
        settings = job.settings.replace(VideoSettings, codec="ffv1")  # which takes all sizes
        runs.append(_dry_run(replace(job, path=path, settings=settings), method, renderer))
    monitor.progress("dry run", len(sizes), len(sizes))
    return runs[0], runs[1]


def _dry_run(job: Job, method: Method, renderer: Renderer) -> DryRun:
    """Do all tasks of a job in this process."""
    with (
        scratch_folder("enfilade-dry-run") as folder,
        RunFolder.create(folder, job.identity()) as run,
    ):
        write_job(run.folder, job)
        worker = Worker(job, run, method=method, renderer=renderer)
        frames = len(job.path)
        _do(job, run, worker, analysis_tasks(frames))
        _do(job, run, worker, [*method.tasks(analysis_of(job, run)), *video_tasks(frames)])
        return DryRun(job.path.width * job.path.height, list(run.lines()), statistics(run))


def _do(job: Job, run: RunFolder, worker: Worker, tasks: Iterable[Task]) -> None:
    graph = TaskGraph(passes_of(job), tasks)
    while (task := graph.take()) is not None:
        run.finish(worker.do(task))
        graph.finish(task)
