"""Frames with visibility of their own and light from the keyframes: ``--method decoupled``.

Every frame is shaded by itself: camera rays, textures and lobes are exact, and the light on diffuse
surfaces is looked up in the keyframes nearest on the path. What they don't know is path traced, for that
lookup alone.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from functools import cached_property
from typing import TypeVar

import numpy as np
import numpy.typing as npt
from scipy.ndimage import binary_dilation

from enfilade.codec import read_arrays, read_light, write_arrays, write_light
from enfilade.errors import SettingsError
from enfilade.irradiance import (
    Estimates,
    LightCache,
    Shader,
    known,
    light_of,
    open_cache,
    open_page,
    pooled,
    seen_from,
    smoothed,
)
from enfilade.irradiance.cells import Cells
from enfilade.pipeline.finish import result_unit, write_frame_result
from enfilade.pipeline.workshop import Workshop
from enfilade.pixels.estimate import LUMINANCE, Estimate, Samples, estimate
from enfilade.pixels.lookup import Page
from enfilade.records import Frame, Geometry, LightPage, Mask, Segment, Shading, Source
from enfilade.renderer import LightRenderer, PixelFilter, Purpose

REACH = 2.0  # of the keyframes' spacing: how far along the path a keyframe counts
LEAST_SHARE = 1e-3  # of a keyframe farther away: it counts where no other knows the surface
POOL = 4  # keyframes to each side with which a page is pooled
LEAST_HOLES = 2e-3  # of a frame's pixels: fewer are left to the frames themselves
LEAST_ALBEDO = 1e-3  # of a surface whose light is worth knowing
EDGE_CONTRAST = 0.001  # by JND of the quality: relative deviation above which a pixel takes more camera rays
SCOUT_SPP = 4  # rays of a pixel that look for what no page sees
SCOUTS = 8  # keyframes whose estimates of what no page sees a frame shares
NOISE_CONTRAST = 0.01  # the same of what lobes scatter, once it is smoothed
PILOT_PATHS = 4  # of each of the two estimates that tell how many paths are needed
PATHS = 4, 256  # fewest and most paths of a keyframe's pixel that the quality may ask for
KEPT = 24  # pages kept in memory, of each kind

T = TypeVar("T")


class LightTable:
    """The light of a shot: pages at its keyframes, and smaller ones that fill the holes between them.

    Parameters
    ----------
    workshop
    segments
        The shot's initial segments.

    Raises
    ------
    SettingsError
        The renderer can't be asked for light.
    """

    def __init__(self, workshop: Workshop, segments: list[Segment]) -> None:
        if not isinstance(workshop.renderer, LightRenderer):
            name = workshop.renderer.describe().renderer
            raise SettingsError(f"{name} can't be asked for light: --method decoupled needs a Mitsuba scene")
        self.renderer: LightRenderer = workshop.renderer
        first = workshop.job.path.cameras[segments[0].first]
        self.shader = Shader(self.renderer, pixel_angle=1.0 / first.focal_px)
        self._workshop = workshop
        self.segments = segments
        self.keyframes = sorted({s.first for s in segments} | {s.last for s in segments})
        self._fills: list[int] = []
        self._traced: _Kept[LightPage] = _Kept()
        self._opened: _Kept[Page] = _Kept()
        self._pooled: _Kept[Page] = _Kept()
        self._scouted: _Kept[Estimates] = _Kept()
        self._cells: tuple[list[int], Cells | None] = ([], None)

    def prepare(self, segment: Segment) -> None:
        """Trace the light of a segment's keyframes, and of what they leave open between them."""
        workshop = self._workshop
        first, last = workshop.number(segment.first), workshop.number(segment.last)
        unit = f"light {first}-{last}"
        if line := workshop.run.done(unit):
            fills = [self._frame(number) for number in line["fills"]]
        else:
            fills = self._filled(segment.first, segment.last, [])
            numbers = [workshop.number(frame) for frame in fills]
            workshop.finish(unit, [], fills=numbers)
        self._fills = sorted({*self._fills, *fills})

    def around(self, frame: int, *, with_cells: bool = True) -> tuple[LightCache, LightCache]:
        """What is known of the very view of a frame, and what is known near it.

        Pages are weighted so that none comes or goes abruptly.
        """
        settings = self._workshop.job.settings.light
        frames = [*_nearest(self.keyframes, frame, settings.keyframes)]
        frames += _nearest(self._fills, frame, settings.fills)
        pages = [self._page(f) for f in frames]
        shares = [max(1.0 - abs(f - frame) / (REACH * self._spacing), LEAST_SHARE) for f in frames]
        view = seen_from(self._workshop.views[frame].geometry, pages, shares)
        # Always as many pages, so that the kernels which look them up are recorded once.
        missing = settings.keyframes + settings.fills - len(pages)
        pages, shares = [*pages, *[pages[0]] * missing], [*shares, *[0.0] * missing]
        return open_cache([view], [1.0]), open_cache(
            pages, shares, self._cells_near(frame) if with_cells else None
        )

    def scout(self, frame: int) -> Estimates:
        """Estimate the light where lobes lead from a frame and no page sees: frames near it share that."""
        if frame not in self._scouted:
            self._scouted[frame] = self._read_or_scout(frame)
        return self._scouted[frame]

    def _read_or_scout(self, frame: int) -> Estimates:
        workshop = self._workshop
        number = workshop.number(frame)
        unit, file = f"cells {number}", workshop.run.file("cells", number).with_suffix(".npz")
        if workshop.run.done(unit):
            workshop.run.check(file)
            return Estimates(*read_arrays(file, "keys", "sums", "counts"))
        job = workshop.job
        parts: list[Estimates] = []
        _, cache = self.around(frame, with_cells=False)
        with workshop.costs.of("scout"):
            estimate(
                job.path.cameras[frame],
                np.arange(job.path.width * job.path.height, dtype=np.uint32),
                lambda rays, rng: self.shader.scattered(cache, rays, rng, parts.append),
                spp=SCOUT_SPP,
                chunk=job.settings.trace.chunk,
                pixel_filter=PixelFilter.BOX,
                random=_random(workshop, frame, Purpose.SCOUT),
            )
            estimates = Estimates.joined(parts)
        write_arrays(file, {"keys": estimates.keys, "sums": estimates.sums, "counts": estimates.counts})
        workshop.finish(unit, [file], frame=number, cells=len(estimates.keys))
        return estimates

    def _cells_near(self, frame: int) -> Cells | None:
        near = _nearest(self.keyframes, frame, SCOUTS)
        if self._cells[0] != near:
            self._cells = near, Estimates.joined([self.scout(k) for k in near]).opened()
        return self._cells[1]

    @property
    def _spacing(self) -> float:
        return max((self.keyframes[-1] - self.keyframes[0]) / max(len(self.keyframes) - 1, 1), 1.0)

    def _frame(self, number: int) -> int:
        return self._workshop.job.path.numbers.index(number)

    def _filled(self, first: int, last: int, fills: list[int]) -> list[int]:
        """Halve a stretch of frames until nothing new comes into view; returns the frames that fill holes."""
        middle = (first + last) // 2
        if middle == first:
            return fills
        holes = self._holes(middle, fills)
        if holes.mean() < LEAST_HOLES:
            return fills
        self._trace(middle, holes)
        fills = [*fills, middle]
        return self._filled(middle, last, self._filled(first, middle, fills))

    def _holes(self, frame: int, fills: list[int]) -> Mask:
        geometry = self._workshop.views[frame].geometry
        frames = _nearest(self.keyframes, frame, self._workshop.job.settings.light.keyframes)
        pages = [self._open(f) for f in (*frames, *fills)]
        return _has_light(geometry) & ~known(geometry, pages)

    def _page(self, frame: int) -> Page:
        """A page with what all around it know of its surfaces."""
        if frame not in self._pooled:
            around = _nearest(self.keyframes, frame, 2 * POOL + 1)
            around += _nearest(self._fills, frame, 2 * POOL + 1)
            with self._workshop.costs.of("gather"):
                pages = [self._open(f) for f in sorted({*around, frame})]
                self._pooled[frame] = pooled(self._trace(frame), pages)
        return self._pooled[frame]

    def _open(self, frame: int) -> Page:
        if frame not in self._opened:
            self._opened[frame] = open_page(self._trace(frame))
        return self._opened[frame]

    def _trace(self, frame: int, holes: Mask | None = None) -> LightPage:
        """Light at what pixels' centres of a frame see: of all of them, or of those in holes."""
        if frame not in self._traced:
            self._traced[frame] = self._read_or_trace(frame, holes)
        return self._traced[frame]

    def _read_or_trace(self, frame: int, holes: Mask | None) -> LightPage:
        workshop = self._workshop
        number, geometry = workshop.number(frame), workshop.views[frame].geometry
        unit, file = f"keyframe {number}", workshop.run.file("keyframes", number)
        if workshop.run.done(unit):
            workshop.run.check(file)
            return LightPage(frame, geometry, *read_light(file))
        where = _has_light(geometry) if holes is None else holes
        direct, indirect = self._estimated(frame, where)
        write_light(file, direct, indirect, where)
        workshop.finish(unit, [file], frame=number, pixels=int(where.sum()), dropped=direct.dropped)
        return LightPage(frame, geometry, direct, indirect, where)

    def _estimated(self, frame: int, where: Mask) -> tuple[Shading, Shading]:
        """Direct and indirect light."""
        paths = self.paths
        with self._workshop.costs.of("trace"):
            light = self._light(frame, where, Purpose.LIGHT)
            light.add(paths)
        direct, indirect = (_spread(shading, where) for shading in light.shadings)
        return direct, indirect

    def _light(self, frame: int, where: Mask, purpose: Purpose) -> Estimate:
        workshop, renderer = self._workshop, self.renderer
        return Estimate(
            workshop.job.path.cameras[frame],
            np.flatnonzero(where).astype(np.uint32),
            lambda rays, rng: Samples(renderer.light(renderer.lit(rays), rng)),
            chunk=workshop.job.settings.trace.chunk,
            pixel_filter=PixelFilter.CENTRE,
            random=_random(workshop, frame, purpose),
            layers=2,
        )

    @cached_property
    def paths(self) -> int:
        """Paths of a keyframe's pixel: as set, or as many as the quality asks for."""
        workshop = self._workshop
        settings = workshop.job.settings.light
        if settings.paths:
            return settings.paths
        frame = self.keyframes[len(self.keyframes) // 2]
        unit = f"pilot {workshop.number(frame)}"
        if line := workshop.run.done(unit):
            return int(line["paths"])
        jnd = self._pilot_jnd(frame)
        # Half of the squared difference is either's own; pages that are pooled share what is left.
        share = max(min(len(self.keyframes), 2 * POOL + 1) / 2.0, 1.0)
        wanted = PILOT_PATHS * (jnd / settings.quality) ** 2 / (2.0 * share)
        paths = int(np.clip(4 * math.ceil(wanted / 4), *PATHS))
        workshop.finish(unit, [], jnd=jnd, paths=paths)
        return paths

    def _pilot_jnd(self, frame: int) -> float:
        """Visible difference between two estimates of a frame's light, as its surfaces show it."""
        workshop = self._workshop
        geometry = workshop.views[frame].geometry
        where = _has_light(geometry)
        if not where.any():
            return 0.0
        shown = []
        with workshop.costs.of("pilot"):
            for purpose in (Purpose.PILOT, Purpose.LIGHT):
                light = self._light(frame, where, purpose)
                light.add(PILOT_PATHS)
                direct, indirect = (_spread(shading, where) for shading in light.shadings)
                page = LightPage(frame, geometry, direct, indirect, where)
                shown.append(workshop.shown(geometry.albedo * light_of(pooled(page, [open_page(page)]))))
            return workshop.judge.compare(*shown, valid=where).score


def make_frame(workshop: Workshop, table: LightTable, frame: int) -> None:
    """Shade a frame from the light of the pages around it."""
    if workshop.run.done(result_unit(workshop, frame)):
        return
    view = workshop.views[frame]
    with workshop.costs.of("gather"):
        near, cache = table.around(frame)
        seen = _seen(workshop, table, frame, near, cache)
    with workshop.costs.of("scatter"):
        scattered = _scattered(workshop, table, frame, cache, seen)
    height, width = view.geometry.item.shape
    color = seen.shading.color.reshape(height, width, 3) + scattered.color
    kind = Source.KEYFRAME if frame in table.keyframes else Source.REUSED
    made = Frame(color, np.full((height, width), kind, np.uint8))
    dropped = seen.shading.dropped + scattered.dropped
    write_frame_result(workshop, frame, view.geometry, view.flow, made, dropped)


def _seen(workshop: Workshop, table: LightTable, frame: int, view: LightCache, cache: LightCache) -> Estimate:
    """What surfaces emit and scatter diffusely; edges and fine textures get more camera rays."""
    path, settings = workshop.job.path, workshop.job.settings
    seen = Estimate(
        path.cameras[frame],
        np.arange(path.width * path.height, dtype=np.uint32),
        lambda rays, rng: table.shader.seen(view, cache, rays, rng),
        chunk=settings.trace.chunk,
        pixel_filter=PixelFilter.GAUSSIAN,
        random=_random(workshop, frame, Purpose.GATHER),
    )
    seen.add(settings.light.least_samples)
    if settings.light.samples > settings.light.least_samples:
        shading = seen.shading
        limit = EDGE_CONTRAST * settings.light.quality
        is_edge = np.sqrt(shading.variance) > limit * _luminance(shading)
        seen.add(settings.light.samples - settings.light.least_samples, _grown(is_edge, path.width))
    return seen


def _scattered(
    workshop: Workshop, table: LightTable, frame: int, cache: LightCache, seen: Estimate
) -> Shading:
    """What surfaces scatter by all but their diffuse lobes, (H, W), smoothed.

    Pixels where noise is left get more rays.
    """
    path, settings = workshop.job.path, workshop.job.settings
    where = _grown(seen.is_marked, path.width)
    scattered = Estimate(
        path.cameras[frame],
        np.flatnonzero(where).astype(np.uint32),
        lambda rays, rng: table.shader.scattered(cache, rays, rng),
        chunk=settings.trace.chunk,
        pixel_filter=PixelFilter.GAUSSIAN,
        random=_random(workshop, frame, Purpose.SCATTER),
    )
    least, most = settings.light.least_lobe_samples, settings.light.lobe_samples
    scattered.add(least)

    shown = table.shader.shown(workshop.views[frame].geometry)

    def image() -> Shading:
        return smoothed(shown, _spread(scattered.shading, where.reshape(path.height, path.width)))

    if most > least:
        left = image()
        whole = _luminance(seen.shading) + _luminance(left).ravel()
        is_noisy = np.sqrt(left.variance).ravel() > NOISE_CONTRAST * settings.light.quality * whole
        scattered.add(most - least, _grown(is_noisy, path.width)[where])
    return image()


def _luminance(shading: Shading) -> npt.NDArray[np.float32]:
    mean: npt.NDArray[np.float32] = shading.color @ np.array(LUMINANCE, np.float32)
    return mean


def _spread(shading: Shading, where: Mask) -> Shading:
    """An image of what was estimated for a list of its pixels."""
    color, variance = np.zeros((*where.shape, 3), np.float32), np.zeros(where.shape, np.float32)
    color[where], variance[where] = shading.color, shading.variance
    return Shading(color, variance, shading.dropped)


class _Kept(OrderedDict[int, T]):
    """The pages last made, by frame."""

    def __setitem__(self, frame: int, page: T) -> None:
        super().__setitem__(frame, page)
        if len(self) > KEPT:
            self.popitem(last=False)


def _nearest(frames: list[int], frame: int, count: int) -> list[int]:
    return sorted(frames, key=lambda k: (abs(k - frame), k))[:count]


def _has_light(geometry: Geometry) -> Mask:
    has_light: Mask = geometry.is_hit & (geometry.albedo.max(axis=2) > LEAST_ALBEDO)
    return has_light


def _grown(chosen: npt.NDArray[np.bool_], width: int) -> npt.NDArray[np.bool_]:
    """Pixels of a flat image, and those around them."""
    grown: npt.NDArray[np.bool_] = binary_dilation(chosen.reshape(-1, width), np.ones((3, 3), bool)).ravel()
    return grown


def _random(workshop: Workshop, frame: int, purpose: Purpose) -> dict[str, int]:
    seed = workshop.job.settings.trace.seed
    return {"seed": seed, "frame": workshop.number(frame), "purpose": int(purpose)}
