"""Short sequences around a frame, traced whole and reused, for what is filtered and judged in many ways.

Everything is sampled at pixels' centres, as the paper's rays are (§5.2): what antialiases is the filter.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.camera.path import Segment
from enfilade.gbuffer import image_flow
from enfilade.images import read_shading, write_shading
from enfilade.methods.paper import composite, warp_keyframe
from enfilade.monitor import Monitor
from enfilade.pipeline.job import Job
from enfilade.pipeline.survey import Survey, initial_segments
from enfilade.pipeline.views import View, Views
from enfilade.records import F32, Flow, Geometry, Keyframe, Shading, Warped
from enfilade.renderer import PixelFilter, Purpose, RandomKey, Renderer
from studies.cases.mirrored import mirrored
from studies.cases.seen import Viewer

__all__ = ["Example", "Row", "Windows", "probes_of"]

Row = dict[str, Any]  # what is measured of a frame
Example = dict[str, F32]  # its images

KEPT, VIEWS_KEPT = 64, 24  # images and views in memory: some 600 MiB at 640x480
END_FRAMES = 10  # of a path, where a temporal filter lacks half its support


@dataclass(frozen=True, eq=False)
class Windows:
    """The frames of a path, made when asked for.

    Attributes
    ----------
    job : Job
    renderer : Renderer
    survey : Survey
    folder : Path or None
        Holds one EXR file a frame and kind; they depend on the job, which the caller keeps track of. None:
        nothing is kept, what is cheap to make.
    monitor : Monitor
    views : Views
    reference_spp : int
    """

    job: Job
    renderer: Renderer
    survey: Survey
    folder: Path | None
    monitor: Monitor
    views: Views
    reference_spp: int
    _memory: OrderedDict[tuple[str, int], Shading] = field(default_factory=OrderedDict, init=False)
    _seen: OrderedDict[int, View] = field(default_factory=OrderedDict, init=False)

    def each(
        self, stage: str, probes: list[int], measured: Callable[[Windows, Viewer, int], tuple[Row, Example]]
    ) -> tuple[list[Row], list[Example]]:
        """Measure frames one by one, with progress: a row and images of each."""
        self.monitor.stage(stage, len(probes))
        viewer = Viewer(self.job.viewing, self.job.settings)
        found = []
        for frame in probes:
            found.append(measured(self, viewer, frame))
            self.monitor.advance()
        return [row for row, _ in found], [example for _, example in found]

    def around(self, frame: int, reach: int) -> range:
        """Frames of the same shot at most `reach` away."""
        shot = next(s for s in self.job.path.shots() if frame in s)
        return range(max(frame - reach, shot.start), min(frame + reach + 1, shot.stop))

    def view(self, frame: int) -> View:
        """What a frame sees, and how it moves."""
        if frame not in self._seen:
            self._seen[frame] = self.views[frame]
            if len(self._seen) > VIEWS_KEPT:
                self._seen.popitem(last=False)
        self._seen.move_to_end(frame)
        return self._seen[frame]

    def geometry(self, frame: int) -> Geometry:
        """What a frame sees."""
        return self.view(frame).geometry

    def seen(self, frame: int) -> Geometry:
        """The same, with what mirrors show in place of the mirrors."""
        return mirrored(self.renderer, self.geometry(frame))

    def flow(self, frame: int, geometry: Geometry | None = None) -> Flow:
        """Image flow, of what the frame sees or of another geometry in its place."""
        if geometry is None:
            return self.view(frame).flow
        return image_flow(geometry, *self.job.path.neighbours(frame))

    def traced(self, frame: int) -> Shading:
        """A frame with every pixel traced: I_rt of Fig. 9."""
        spp = self.job.settings.trace.spp

        return self._kept(
            "traced", frame, lambda: self._trace(frame, spp, Purpose.FILL, PixelFilter.CENTRE, 0)
        )

    def reference(self, frame: int) -> Shading:
        """A frame as it should be: through a Gaussian pixel, with random numbers of its own."""
        return self._kept(
            "reference",
            frame,
            lambda: self._trace(frame, self.reference_spp, Purpose.REFERENCE, PixelFilter.GAUSSIAN, 1),
        )

    def reused(self, frame: int) -> Shading:
        """A frame from the keyframes beside it, its holes traced: I_ibr of Fig. 9.

        The keyframes are the initial ones: no segment is split. The variance is that of the noise's density,
        as the warp carries it (docs/noise.md).
        """
        segment = self._segment(frame)
        if segment is None:
            return self.traced(frame)
        return self._kept("reused", frame, lambda: self._composed(segment, frame))

    def _composed(self, segment: Segment, frame: int) -> Shading:
        settings, camera = self.job.settings.warp, self.job.path.cameras[frame]
        before, after = (
            warp_keyframe(self._keyframe(k), camera, settings) for k in (segment.first, segment.last)
        )
        geometry, progress = self.geometry(frame), self.job.path.progress(segment, frame)
        color, is_hole = composite(before, after, geometry, progress=progress, settings=settings)
        noisy = _with_variance_as_color(before), _with_variance_as_color(after)
        density, _ = composite(*noisy, geometry, progress=progress, settings=settings)
        variance = np.ascontiguousarray(density[..., 0])
        traced = self.traced(frame)
        color[is_hole], variance[is_hole] = traced.color[is_hole], traced.variance[is_hole]
        return Shading(color, variance)

    def _keyframe(self, frame: int) -> Keyframe:
        return Keyframe(frame, self.geometry(frame), self.traced(frame))

    def _segment(self, frame: int) -> Segment | None:
        """The segment between whose keyframes a frame lies; None for a keyframe."""
        shots = initial_segments(self.job.path, self.survey, self.job.settings)
        return next((s for shot in shots for s in shot if frame in s.inbetweens), None)

    def _trace(self, frame: int, spp: int, purpose: Purpose, pixel_filter: PixelFilter, salt: int) -> Shading:
        path, trace = self.job.path, self.job.settings.trace
        made = self.renderer.trace(
            path.cameras[frame],
            np.arange(path.width * path.height, dtype=np.uint32),
            RandomKey((trace.seed + salt) % 2**32, path.numbers[frame], purpose),
            spp=spp,
            pixel_filter=pixel_filter,
        )
        size = path.height, path.width
        return Shading(made.color.reshape(*size, 3), made.variance.reshape(size), made.dropped)

    def _kept(self, kind: str, frame: int, make: Callable[[], Shading]) -> Shading:
        key = kind, frame
        if key not in self._memory:
            self._memory[key] = (
                make() if self.folder is None else self._stored(self.folder, kind, frame, make)
            )
            if len(self._memory) > KEPT:
                self._memory.popitem(last=False)
        self._memory.move_to_end(key)
        return self._memory[key]

    def _stored(self, folder: Path, kind: str, frame: int, make: Callable[[], Shading]) -> Shading:
        spp = self.reference_spp if kind == "reference" else self.job.settings.trace.spp
        name = f"{kind}-{self.job.path.width}x{self.job.path.height}-{spp}"
        file = folder / name / f"{self.job.path.numbers[frame]:04d}.exr"
        if file.is_file():
            return read_shading(file)
        made = make()
        write_shading(file, made)
        return made


def probes_of(survey: Survey, path_length: int, count: int) -> list[int]:
    """Frames at even quantiles of the mean velocity, slowest first, each once.

    The ends of the path are left out.
    """
    margin = min(END_FRAMES, path_length // 4)
    inner = range(margin, path_length - margin)
    by_speed = sorted(inner, key=lambda frame: survey.speed_deg_s[frame])
    at = [round((len(by_speed) - 1) * k / max(count - 1, 1)) for k in range(count)]
    return list(dict.fromkeys(by_speed[i] for i in at))


def _with_variance_as_color(warped: Warped) -> Warped:
    density: F32 = np.repeat(warped.variance[..., None], 3, axis=2)
    return replace(warped, color=density)
