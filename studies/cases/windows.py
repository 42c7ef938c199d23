"""Short sequences around a frame, traced whole and reused from keyframes, to be filtered and compared.

All are sampled at pixels' centres, as in the paper (§5.2): antialiasing is left to the filter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.cache import LruCache
from enfilade.camera.path import Segment
from enfilade.gbuffer import View, image_flow
from enfilade.images.records import read_record, write_record
from enfilade.methods.analysis import Analysis
from enfilade.methods.paper.composite import composite
from enfilade.methods.paper.refine import warped_pair
from enfilade.methods.walkthrough import Walkthrough
from enfilade.monitor import Monitor
from enfilade.records import F32, Flow, Geometry, Keyframe, Shading, Warped
from enfilade.renderer import PixelFilter, Purpose
from enfilade.settings import SamplingSettings, TraceSettings, WarpSettings
from studies.cases.mirrored import mirrored
from studies.cases.seen import Viewer
from studies.progress import counted

__all__ = ["Example", "Row", "Windows", "other_seed", "probes_of"]

Row = dict[str, Any]  # measurements of a frame
Example = dict[str, F32]  # its images

CACHED_IMAGES, CACHED_VIEWS = 64, 24  # some 600 MiB at 640x480
END_FRAMES = 10  # of a path, where a temporal filter lacks half its support


class Windows:
    """Frames of a walkthrough, made when they are needed.

    Parameters
    ----------
    walk
    analysis
    monitor
    reference_spp
    folder
        Holds one file a frame and kind. They depend on walkthrough and spp: the caller keeps to one folder
        for each. None: frames are cached in memory only.
    """

    def __init__(
        self,
        walk: Walkthrough,
        analysis: Analysis,
        monitor: Monitor,
        *,
        reference_spp: int,
        folder: Path | None = None,
    ) -> None:
        self.walk, self.analysis, self.monitor = walk, analysis, monitor
        self.viewer = Viewer(walk.viewing, walk.settings)
        self._reference_walk = other_seed(walk)
        self._reference_spp = reference_spp
        self._folder = folder
        self._images: LruCache[tuple[str, int], Shading] = LruCache(CACHED_IMAGES)
        self._views: LruCache[int, View] = LruCache(CACHED_VIEWS)

    def each(
        self, stage: str, probes: list[int], measure: Callable[[Windows, int], tuple[Row, Example]]
    ) -> tuple[list[Row], list[Example]]:
        """Measure frames one by one, with progress: measurements and images of each."""
        found = [measure(self, frame) for frame in counted(probes, stage, self.monitor)]
        return [row for row, _ in found], [example for _, example in found]

    def around(self, frame: int, reach: int) -> range:
        """Frames of the same shot at most `reach` away."""
        shot = next(s for s in self.walk.path.shots() if frame in s)
        return range(max(frame - reach, shot.start), min(frame + reach + 1, shot.stop))

    def view(self, frame: int) -> View:
        """G-buffer and motion vectors of a frame."""
        return self._views.get(frame, lambda: self.walk.view(frame))

    def geometry(self, frame: int) -> Geometry:
        """G-buffer of a frame."""
        return self.view(frame).geometry

    def reflected(self, frame: int) -> Geometry:
        """The same, with virtual images in place of the mirrors."""
        return mirrored(self.walk.renderer, self.geometry(frame))

    def flow(self, frame: int, geometry: Geometry | None = None) -> Flow:
        """Motion vectors of a frame's surfaces, or of another geometry in their place."""
        if geometry is None:
            return self.view(frame).flow
        return image_flow(geometry, *self.walk.path.neighbours(frame))

    def traced(self, frame: int) -> Shading:
        """A frame with every pixel traced: I_rt of Fig. 9."""
        spp = self.walk.settings[SamplingSettings].spp
        return self._cached(
            "traced", frame, lambda: _trace(self.walk, frame, spp, Purpose.FILL, PixelFilter.CENTRE)
        )

    def reference(self, frame: int) -> Shading:
        """The reference of a frame: through a Gaussian pixel filter, with other random numbers."""
        walk, spp = self._reference_walk, self._reference_spp
        return self._cached(
            "reference", frame, lambda: _trace(walk, frame, spp, Purpose.REFERENCE, PixelFilter.GAUSSIAN)
        )

    def reused(self, frame: int) -> Shading:
        """A frame composited from the keyframes around it, disocclusions traced: I_ibr of Fig. 9.

        The keyframes are the initial ones: no segment is split. The variance is the density of the noise, as
        warped (docs/noise.md).
        """
        segments = (s for shot in self.analysis.segments() for s in shot)
        segment = next((s for s in segments if frame in s.inbetweens), None)
        if segment is None:
            return self.traced(frame)
        return self._cached("reused", frame, lambda: self._composited(segment, frame))

    def keyframe(self, frame: int) -> Keyframe:
        """A traced frame as a keyframe."""
        return Keyframe(frame, self.geometry(frame), self.traced(frame))

    def _composited(self, segment: Segment, frame: int) -> Shading:
        geometry, progress = self.geometry(frame), self.walk.path.progress(segment, frame)
        settings = self.walk.settings[WarpSettings]
        warped = warped_pair(self.walk, self.keyframe(segment.first), self.keyframe(segment.last), frame)
        color, is_disoccluded = composite(*warped, geometry, progress=progress, settings=settings)
        before, after = map(_with_variance_as_color, warped)
        density, _ = composite(before, after, geometry, progress=progress, settings=settings)
        variance = np.ascontiguousarray(density[..., 0])
        traced = self.traced(frame)
        color[is_disoccluded], variance[is_disoccluded] = (
            values[is_disoccluded] for values in (traced.color, traced.variance)
        )
        return Shading(color, variance)

    def _cached(self, kind: str, frame: int, make: Callable[[], Shading]) -> Shading:
        if self._folder is None:
            return self._images.get((kind, frame), make)
        stem = self._folder / kind / f"{self.walk.path.numbers[frame]:04d}"
        return self._images.get((kind, frame), lambda: stored(stem, make))


def stored(stem: Path, make: Callable[[], Shading]) -> Shading:
    """A traced image from its file, made and written where the file is missing."""
    file = stem.with_name(f"{stem.name}.exr")
    if not file.is_file():
        write_record(stem, make())
    return read_record(file, Shading)


def other_seed(walk: Walkthrough) -> Walkthrough:
    """The same walkthrough with other random numbers."""
    seed = (walk.settings[TraceSettings].seed + 1) % 2**32
    return Walkthrough(walk.path, walk.settings.replace(TraceSettings, seed=seed), walk.renderer)


def probes_of(analysis: Analysis, count: int) -> list[int]:
    """Frames at even quantiles of the mean velocity, slowest first, each once, not at the path's ends."""
    length = len(analysis.path)
    margin = min(END_FRAMES, length // 4)
    inner = range(margin, length - margin)
    by_speed = sorted(inner, key=lambda frame: analysis.frames[frame].speed_deg_s)
    at = [round((len(by_speed) - 1) * k / max(count - 1, 1)) for k in range(count)]
    return list(dict.fromkeys(by_speed[i] for i in at))


def _trace(walk: Walkthrough, frame: int, spp: int, purpose: Purpose, pixel_filter: PixelFilter) -> Shading:
    everywhere = np.ones((walk.path.height, walk.path.width), np.bool_)
    return walk.trace(frame, everywhere, purpose, spp=spp, pixel_filter=pixel_filter).spread(everywhere)


def _with_variance_as_color(warped: Warped) -> Warped:
    density: F32 = np.repeat(warped.variance[..., None], 3, axis=2)
    return replace(warped, color=density)
