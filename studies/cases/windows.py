"""Short sequences around a frame, traced whole and reused from keyframes, to be filtered and compared.

All are sampled at pixels' centres, as in the paper (§5.2): antialiasing is left to the filter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from enfilade.cache import LruCache
from enfilade.camera.path import Segment
from enfilade.gbuffer import View, image_flow
from enfilade.images.records import read_record, write_record
from enfilade.methods.analysis import Analysis
from enfilade.methods.paper.composite import composite
from enfilade.methods.paper.refine import warped_pair
from enfilade.methods.paper.spatial_filter import reconstruct
from enfilade.methods.paper.support import spatial_support_px, temporal_limits
from enfilade.methods.paper.temporal_filter import Slice, filter_along_flow
from enfilade.methods.walkthrough import Walkthrough
from enfilade.monitor import Monitor
from enfilade.records import F32, Geometry, Keyframe, Shading, Warped
from enfilade.renderer import PixelFilter, Purpose
from enfilade.settings import AntialiasSettings, SamplingSettings, TraceSettings, WarpSettings
from studies.cases.mirrored import mirrored
from studies.cases.seen import Viewer

CACHED_IMAGES, CACHED_VIEWS = 64, 24  # some 600 MiB at 640x480
END_FRAMES = 10  # of a path, where a temporal filter lacks half its support


class Windows:
    """Frames of a walkthrough, made when they are needed.

    Parameters
    ----------
    walk
    analysis
    monitor
    probes
        Number of frames whose surroundings are used.
    reference_spp
    folder
        Holds one file a frame and kind. The caller keeps to one folder for each walkthrough and spp. None:
        frames are cached in memory only.
    """

    def __init__(
        self,
        walk: Walkthrough,
        analysis: Analysis,
        monitor: Monitor,
        *,
        probes: int,
        reference_spp: int,
        folder: Path | None = None,
    ) -> None:
        self.walk, self.analysis, self.monitor = walk, analysis, monitor
        self.probes = probes_of(analysis, probes)
        self.viewer = Viewer(walk.viewing, walk.settings)
        self._reference_walk = other_seed(walk)
        self._reference_spp = reference_spp
        self._folder = folder
        self._images: LruCache[tuple[str, int], Shading] = LruCache(CACHED_IMAGES)
        self._views: LruCache[int, View] = LruCache(CACHED_VIEWS)

    def around(self, frame: int, settings: AntialiasSettings) -> range:
        """Frames of the same shot that the filter may use."""
        reach = max(settings.frames, settings.slow_frames) // 2
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
        warped (:mod:`enfilade.metric.noise`).
        """
        segments = (s for shot in self.analysis.segments() for s in shot)
        segment = next((s for s in segments if frame in s.inbetweens), None)
        if segment is None:
            return self.traced(frame)
        return self._cached("reused", frame, lambda: self._composited(segment, frame))

    def keyframe(self, frame: int) -> Keyframe:
        """A traced frame as a keyframe."""
        return Keyframe(frame, self.geometry(frame), self.traced(frame))

    def antialiased(
        self,
        frame: int,
        settings: AntialiasSettings,
        color_of: Callable[[int], F32] | None = None,
        geometry_of: Callable[[int], Geometry] | None = None,
    ) -> F32:
        """Filter a frame with its neighbours (§5), (H, W, 3) float32.

        Parameters
        ----------
        frame
        settings
        color_of
            Colours of each frame before the filter; by default those of the traced frames.
        geometry_of
            Geometry of each frame whose motion is followed, in place of the visible surfaces'. Where it is
            not specular, the filter has its full length.
        """
        viewing, path = self.walk.viewing, self.walk.path
        span = self.around(frame, settings)
        slices: dict[int, Slice] = {}
        for at in span:
            color = self.traced(at).color if color_of is None else color_of(at)
            view = self.view(at)
            support = spatial_support_px(view.speed_deg_s, viewing.pixels_per_degree, settings)
            geometry = view.geometry if geometry_of is None else geometry_of(at)
            flow = view.flow if geometry_of is None else image_flow(geometry, *path.neighbours(at))
            slices[at] = Slice(reconstruct(color, support), geometry, flow)
        here = slices[frame]
        return filter_along_flow(
            here,
            [slices[at] for at in reversed(range(span.start, frame))],
            [slices[at] for at in range(frame + 1, span.stop)],
            temporal_limits(viewing.velocity_deg_s(here.flow.speed), here.geometry, settings),
            settings,
        )

    def _composited(self, segment: Segment, frame: int) -> Shading:
        geometry, progress = self.geometry(frame), self.walk.path.progress(segment, frame)
        settings = self.walk.settings[WarpSettings]
        warped = warped_pair(self.walk, self.keyframe(segment.first), self.keyframe(segment.last), frame)
        color, is_disoccluded = composite(*warped, geometry, progress=progress, settings=settings)
        before, after = map(_with_variance_as_color, warped)
        density, _ = composite(before, after, geometry, progress=progress, settings=settings)
        variance, traced = np.ascontiguousarray(density[..., 0]), self.traced(frame)
        color[is_disoccluded] = traced.color[is_disoccluded]
        variance[is_disoccluded] = traced.variance[is_disoccluded]
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
    by_speed = sorted(range(margin, length - margin), key=lambda frame: analysis.frames[frame].speed_deg_s)
    at = [round((len(by_speed) - 1) * k / max(count - 1, 1)) for k in range(count)]
    return list(dict.fromkeys(by_speed[i] for i in at))


def _trace(walk: Walkthrough, frame: int, spp: int, purpose: Purpose, pixel_filter: PixelFilter) -> Shading:
    everywhere = np.ones((walk.path.height, walk.path.width), np.bool_)
    return walk.trace(frame, everywhere, purpose, spp=spp, pixel_filter=pixel_filter).to_image(everywhere)


def _with_variance_as_color(warped: Warped) -> Warped:
    return replace(warped, color=np.repeat(warped.variance[..., None], 3, axis=2))
