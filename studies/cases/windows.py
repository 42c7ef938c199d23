"""Short sequences around a frame, path traced and composited from keyframes, for filters and comparisons.

Frames are sampled at pixels' centres, as in the paper (§5.2); the filter antialiases them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from pathlib import Path

import numpy as np

from enfilade.cache import LruCache
from enfilade.camera.path import Segment
from enfilade.gbuffer import View, image_flow
from enfilade.images.records import read_record, write_record
from enfilade.methods.analysis import Analysis
from enfilade.methods.paper.composite import composite
from enfilade.methods.paper.spatial_filter import reconstruct
from enfilade.methods.paper.support import spatial_support_px, temporal_limits
from enfilade.methods.paper.temporal_filter import Slice, filter_along_flow
from enfilade.methods.paper.warp import warped_pair
from enfilade.methods.walkthrough import Walkthrough
from enfilade.monitor import Monitor
from enfilade.records import F32, Geometry, Halves, Keyframe, Shading
from enfilade.renderer import PixelFilter, Purpose
from enfilade.settings import AntialiasSettings, SamplingSettings, TraceSettings, WarpSettings
from studies.cases.virtual_images import reflected_geometry
from studies.cases.visibility import Viewer

CACHED_IMAGES, CACHED_VIEWS = 64, 24  # about 600 MiB at 640x480
END_FRAMES = 10  # at the ends of a path, where the support of the temporal filter is truncated


class Windows:
    """Frames of a walkthrough, rendered on demand.

    Parameters
    ----------
    walk
    analysis
    monitor
    probes
        Number of frames around which sequences are rendered.
    reference_spp
    folder
        Holds one file for each frame and kind; a folder belongs to one walkthrough and spp. None: frames are
        cached in memory only.
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
        self.probes = probe_frames(analysis, probes)
        self.viewer = Viewer(walk.viewing, walk.settings)
        self._reference_walk = reseeded(walk)
        self._reference_spp = reference_spp
        self._folder = folder
        self._images: LruCache[tuple[str, int], Shading] = LruCache(CACHED_IMAGES)
        self._views: LruCache[int, View] = LruCache(CACHED_VIEWS)

    @cached_property
    def second_half(self) -> Windows:
        """The same frames, traced with other random numbers."""
        return Windows(
            self._reference_walk,
            self.analysis,
            self.monitor,
            probes=len(self.probes),
            reference_spp=self._reference_spp,
            folder=self._folder and self._folder / "second half",
        )

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

    def reflected_geometry(self, frame: int) -> Geometry:
        """G-buffer of a frame, with virtual images in place of mirrors."""
        return reflected_geometry(self.walk.renderer, self.geometry(frame))

    def traced(self, frame: int) -> Shading:
        """A frame with every pixel traced (I_rt of Fig. 9)."""
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
        """A frame composited from its keyframes, with traced disocclusions (I_ibr of Fig. 9).

        The keyframes are the initial ones, without splits, and not denoised. The variance is not known.
        """
        segments = (s for shot in self.analysis.segments() for s in shot)
        segment = next((s for s in segments if frame in s.inbetweens), None)
        if segment is None:
            return self.traced(frame)
        return self._cached("reused", frame, lambda: self._composited(segment, frame))

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
            Unfiltered colours of each frame; by default those of the traced frames.
        geometry_of
            Geometry of each frame that provides the motion; by default that of the visible surfaces. Where
            it is not specular, the filter has its full length.
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
        images = [self.traced(at).color for at in (segment.first, segment.last)]
        first, last = (
            Keyframe(self.geometry(at), Halves(image, image))
            for at, image in zip((segment.first, segment.last), images, strict=True)
        )
        color, is_disoccluded = composite(
            *warped_pair(self.walk, first, last, frame),
            self.geometry(frame),
            progress=self.walk.path.progress(segment, frame),
            settings=self.walk.settings[WarpSettings],
        )
        color[is_disoccluded] = self.traced(frame).color[is_disoccluded]
        return Shading(color, np.zeros(color.shape[:2], np.float32))

    def _cached(self, kind: str, frame: int, make: Callable[[], Shading]) -> Shading:
        if self._folder is None:
            return self._images.get((kind, frame), make)
        stem = self._folder / kind / f"{self.walk.path.numbers[frame]:04d}"
        return self._images.get((kind, frame), lambda: load_or_render(stem, make))


def load_or_render(stem: Path, make: Callable[[], Shading]) -> Shading:
    """Read a traced image from its file; render and write it if the file is missing."""
    file = stem.with_name(f"{stem.name}.exr")
    if not file.is_file():
        write_record(stem, make())
    return read_record(file, Shading)


def reseeded(walk: Walkthrough) -> Walkthrough:
    """Copy of a walkthrough with independent random numbers."""
    seed = (walk.settings[TraceSettings].seed + 1) % 2**32
    return Walkthrough(walk.path, walk.settings.replace(TraceSettings, seed=seed), walk.renderer)


def probe_frames(analysis: Analysis, count: int) -> list[int]:
    """Distinct frames at even quantiles of the mean velocity, slowest first, without the ends of the path."""
    length = len(analysis.path)
    margin = min(END_FRAMES, length // 4)
    by_speed = sorted(range(margin, length - margin), key=lambda frame: analysis.frames[frame].speed_deg_s)
    at = [round((len(by_speed) - 1) * k / max(count - 1, 1)) for k in range(count)]
    return list(dict.fromkeys(by_speed[i] for i in at))


def _trace(walk: Walkthrough, frame: int, spp: int, purpose: Purpose, pixel_filter: PixelFilter) -> Shading:
    return walk.trace(frame, purpose, spp=spp, pixel_filter=pixel_filter)
