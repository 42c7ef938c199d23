"""What contestants do, each in a process of its own and in a run folder of its own, one frame a unit of work.

A contestant is given what it needs and nothing else: rivals trace, denoise and write colours, and are not
charged for layers, surveys or videos that only our methods make.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from enfilade.camera.path import CameraPath
from enfilade.images import exact_fps, write_exr, write_result
from enfilade.kernels.estimate import PASS
from enfilade.methods.denoise import denoise, denoiser_name
from enfilade.monitor import Monitor, Silence
from enfilade.pipeline.cost import Costs
from enfilade.pipeline.finish import delivered_layers
from enfilade.pipeline.job import Job
from enfilade.pipeline.survey import initial_segments, survey_path
from enfilade.pipeline.views import Views
from enfilade.records import F32, Provenance
from enfilade.renderer import PixelFilter, Purpose, RandomKey, Renderer
from enfilade.settings import LAYERS
from enfilade.store import Run
from studies.bench.guides import guides
from studies.bench.interpolate import interpolate

__all__ = ["EveryFrame", "Interpolated", "Own", "Task", "part_of"]

HALF_MAX = 65504.0  # largest finite half float, IEEE 754
WARM_FRAMES = 3  # of the path, rendered and thrown away before anything is counted: kernels are compiled


class Task(Protocol):
    """What a contestant does. Fit to be pickled."""

    def warm_up(self) -> None:
        """Do a little of it and throw it away: what is compiled once for a machine is not counted."""
        ...

    def run(self, folder: Path, monitor: Monitor) -> None:
        """Do it, or go on with it, in a run folder; the frames come to lie in ``frames/``."""
        ...


@dataclass(frozen=True, eq=False)
class EveryFrame:
    """Every frame path traced by itself, and denoised by itself if asked.

    Attributes
    ----------
    job : Job
        Paths, seed and longest path of its ``trace`` settings count, and its path.
    pixel_filter : PixelFilter
    denoiser : {"", "high", "balanced", "fast"}
        Quality of Open Image Denoise, with guides without noise; empty: none.
    has_layers : bool
        Whether the frames carry geometry and flow, for those who judge: of references.
    """

    job: Job
    pixel_filter: PixelFilter
    denoiser: str = ""
    has_layers: bool = False

    def warm_up(self) -> None:
        """Make a few frames; none of a reference, whose cost is nobody's concern."""
        if not self.has_layers:
            _warm(lambda job, folder: replace(self, job=job).run(folder, Silence()), self.job)

    def run(self, folder: Path, monitor: Monitor) -> None:
        """Make the frames that the folder does not hold."""
        self.job.check_scene()
        renderer = self.job.open_renderer()
        with Run.open(folder, self._identity(renderer)) as run:
            for note in run.notes:
                monitor.say(note)
            monitor.stage("frames", len(self.job.path))
            for frame in range(len(self.job.path)):
                self._make(run, renderer, frame)
                monitor.advance()

    def _make(self, run: Run, renderer: Renderer, frame: int) -> None:
        number = self.job.path.numbers[frame]
        unit, file, costs = f"frame {number}", run.file("frames", number), Costs()
        if run.done(unit):
            return
        color = self.color(renderer, frame, costs)
        with costs.of("files"):
            self._write(file, renderer, frame, color)
        run.finish(unit, files=[file], facts={"frame": number, "cost": costs.take()})

    def color(self, renderer: Renderer, frame: int, costs: Costs) -> F32:
        """Trace a frame, and denoise it if asked: (H, W, 3) float32."""
        path, settings = self.job.path, self.job.settings.trace
        camera, number = path.cameras[frame], path.numbers[frame]
        with costs.of("trace"):
            traced = renderer.trace(
                camera,
                np.arange(path.width * path.height, dtype=np.uint32),
                RandomKey(settings.seed, number, Purpose.REFERENCE),
                spp=settings.spp,
                pixel_filter=self.pixel_filter,
            )
        color = traced.color.reshape(path.height, path.width, 3)
        if not self.denoiser:
            return color
        with costs.of("guides"):
            albedo, normal = guides(renderer, camera, seed=settings.seed, frame=number, chunk=settings.chunk)
        with costs.of("denoise"):
            return denoise(color, albedo, normal, quality=self.denoiser)

    def _write(self, file: Path, renderer: Renderer, frame: int, color: F32) -> None:
        if not self.has_layers:
            _write_color(file, color)
            return
        path = self.job.path
        view = Views(renderer, path, self.job.viewing, Costs())[frame]
        source = np.full(color.shape[:2], Provenance.KEYFRAME, np.uint8)
        write_result(file, color, delivered_layers(LAYERS, view, source))

    def _identity(self, renderer: Renderer) -> dict[str, Any]:
        facts = {
            "filter": self.pixel_filter.name.lower(),
            "has_layers": self.has_layers,
            "denoiser": f"{denoiser_name()}, {self.denoiser}" if self.denoiser else None,
        }
        return _identity(self.job, renderer, facts)


@dataclass(frozen=True, eq=False)
class Interpolated:
    """Keyframes path traced, the frames between them made up by FFmpeg from the images alone.

    Attributes
    ----------
    job : Job
        Its keyframe settings say where the keyframes are: where our methods have them.
    """

    job: Job

    def warm_up(self) -> None:
        """Make a few frames."""
        _warm(lambda job, folder: replace(self, job=job).run(folder, Silence()), self.job)

    def run(self, folder: Path, monitor: Monitor) -> None:
        """Make the shots that the folder does not hold."""
        job = self.job
        job.check_scene()
        renderer = job.open_renderer()
        views = Views(renderer, job.path, job.viewing, Costs())
        shots = initial_segments(
            job.path, survey_path(views, job.path, job.settings, Silence()), job.settings
        )
        with Run.open(folder, _identity(job, renderer, {"interpolation": "minterpolate"})) as run:
            monitor.stage("frames", len(job.path))
            for shot, segments in zip(job.path.shots(), shots, strict=True):
                chosen = sorted({s.first for s in segments} | {s.last for s in segments})
                self._make(run, renderer, shot, chosen)
                monitor.advance(len(shot))

    def _make(self, run: Run, renderer: Renderer, shot: range, chosen: list[int]) -> None:
        unit, costs = f"shot {self.job.path.numbers[shot.start]}", Costs()
        if run.done(unit):
            return
        tracer = EveryFrame(self.job, PixelFilter.GAUSSIAN)
        keyframes = {frame: tracer.color(renderer, frame, costs) for frame in chosen}
        rests = {frame: self.job.path.static_frame(frame) for frame in shot}
        keyframes |= {frame: keyframes[first] for frame, first in rests.items() if first in keyframes}
        files = []
        exposure = np.float32(2.0**self.job.settings.viewing.exposure_ev)
        for frame, image in _between(keyframes, shot, exact_fps(self.job.path.fps), exposure):
            files.append(run.file("frames", self.job.path.numbers[frame]))
            _write_color(files[-1], image)
        run.finish(unit, files=files, facts={"keyframes": chosen, "cost": costs.take()})


@dataclass(frozen=True, eq=False)
class Own:
    """One of our methods, as ``enfilade render`` would run it.

    Attributes
    ----------
    job : Job
    """

    job: Job

    def warm_up(self) -> None:
        """Render a few frames."""
        _warm(lambda job, folder: Own(job).run(folder, Silence()), self.job)

    def run(self, folder: Path, monitor: Monitor) -> None:
        """Render the walkthrough."""
        from enfilade.pipeline.walkthrough import render

        render(self.job, folder, monitor)


def part_of(path: CameraPath, frames: list[int]) -> CameraPath:
    """Some frames of a path, as a path of one shot."""
    return CameraPath(
        tuple(path.cameras[f] for f in frames), tuple(path.numbers[f] for f in frames), path.fps
    )


def _warm(work: Any, job: Job) -> None:
    count = min(WARM_FRAMES, len(job.path))
    frames = sorted({round(i * (len(job.path) - 1) / max(count - 1, 1)) for i in range(count)})
    trace = replace(job.settings.trace, spp=min(job.settings.trace.spp, PASS))  # more make no other kernel
    small = replace(job, path=part_of(job.path, frames), settings=replace(job.settings, trace=trace))
    with tempfile.TemporaryDirectory(prefix="enfilade-") as folder:
        work(small, Path(folder) / "run")


def _between(
    keyframes: Mapping[int, F32], shot: range, fps: Any, exposure: np.float32
) -> Iterator[tuple[int, F32]]:
    """All frames of a shot; keyframes as they were traced. The filter sees the others as they are shown."""
    still = {frame: keyframes[max(k for k in keyframes if k <= frame)] for frame in shot}  # rests at the end
    shown = {frame: image * exposure for frame, image in keyframes.items()}
    for frame, image in interpolate(shown, fps) if len(shown) > 1 else ():
        still[frame] = keyframes.get(frame, image / exposure)
    yield from still.items()


def _write_color(file: Path, color: F32) -> None:
    write_exr(file, {"RGB": np.clip(color, -HALF_MAX, HALF_MAX).astype(np.float16)}, is_portable=True)


def _identity(job: Job, renderer: Renderer, facts: Mapping[str, Any]) -> dict[str, Any]:
    whole = job.identity(renderer)
    trace = whole["settings"]["trace"]
    kept = {key: trace[key] for key in ("spp", "seed", "max_depth")}
    return {
        "method": job.method,
        **facts,
        "scene": whole["scene"],
        "path": whole["path"],
        "trace": kept,
        "versions": whole["versions"],
    }
