"""The light of a shot, kept in pages at its keyframes and between them."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from enfilade.camera.path import Segment
from enfilade.errors import DamagedFileError
from enfilade.images import read_light, write_light
from enfilade.kernels.estimate import Estimate
from enfilade.kernels.lookup import Page
from enfilade.methods.decoupled import LightCache, known, light_of, open_cache, open_page, pooled, seen_from
from enfilade.methods.denoise import denoise
from enfilade.pipeline.drafts import Drafts
from enfilade.pipeline.kept import Kept, either_side, nearest
from enfilade.pipeline.workshop import Workshop
from enfilade.records import F32, Geometry, LightPage, Mask, Shading
from enfilade.renderer import PixelFilter, Purpose

LEAST_SHARE = 1e-3  # of a page: it counts where no other knows the surface
POOL = 4  # keyframes to each side with which a page is pooled
LEAST_HOLES = 5e-3  # of a frame's pixels: fewer are left to the frames themselves
LEAST_LIT = 0.5  # of the pixels with light in the keyframe that has most: the pilot takes none with fewer
PILOT_PATHS = 4  # of each of the two estimates that tell how many paths are needed
PATHS = 4, 256  # fewest and most paths of a keyframe's pixel that the quality may ask for
FILLS = 2  # pages that fill holes in which a frame looks: the one before and the one after it
EVEN = 0.25  # of the spread of evenly shared paths counts as noise; pages differ by 0.3 to 0.6 of it
TRACED = 4  # pages kept as they were traced


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
        self._path = workshop.job.path
        self._workshop = workshop
        self.segments = segments
        self.keyframes = sorted({s.first for s in segments} | {s.last for s in segments})
        self.drafts = Drafts(workshop, self.keyframes)
        settings = workshop.job.settings.light
        self._quality = settings.denoiser
        self._traced: Kept[LightPage] = Kept(TRACED)
        self._opened: Kept[Page] = Kept(2 * (2 * POOL + 1))
        self._pooled: Kept[Page] = Kept(settings.keyframes + FILLS + 1)

    def prepare(self, segment: Segment) -> None:
        """Trace the light of a segment's keyframes, and of what they leave open between them."""
        workshop = self._workshop
        unit = self._unit(segment)
        line = workshop.run.done(unit)
        if line and all(workshop.run.done(f"keyframe {number}") for number in line["fills"]):
            return
        fills = self._filled(segment.first, segment.last, [])
        workshop.finish(unit, [], fills=[workshop.number(frame) for frame in fills])

    def trace(self, keyframe: int) -> LightPage:
        """The light of a keyframe: from memory, from the run folder, or traced now."""
        return self._trace(keyframe)

    def around(self, frame: int) -> tuple[LightCache, LightCache]:
        """What is known of the very view of a frame, and what is known near it.

        Pages are weighted so that none comes or goes abruptly.
        """
        count = self._workshop.job.settings.light.keyframes
        shared = self._shares(frame) | self._fill_shares(frame)
        pages, shares = [self._page(f) for f in shared], list(shared.values())
        view = seen_from(self._workshop.views[frame].geometry, pages, shares)
        # Always as many pages, so that the kernels which look them up are recorded once.
        missing = count + FILLS - len(pages)
        pages, shares = [*pages, *[pages[0]] * missing], [*shares, *[0.0] * missing]
        return open_cache([view], [1.0]), open_cache(pages, shares, self.drafts.cells(frame))

    def _shares(self, frame: int) -> dict[int, float]:
        """The keyframes nearest to a frame, and how much each counts: none where another takes its place."""
        count = self._workshop.job.settings.light.keyframes
        *near, beyond = nearest(self._path, self.keyframes, frame, count + 1)
        reach = float(self._way(frame, beyond))
        if len(near) < count:
            near, reach = [*near, beyond], 2.0 * max(reach, 1.0)
        return {f: max(1.0 - self._way(frame, f) / reach, LEAST_SHARE) for f in near}

    def _fill_shares(self, frame: int) -> dict[int, float]:
        """The pages that fill holes on either side of a frame; one becomes the other.

        The outermost count for nothing where their segment ends and those of the next take over.
        """
        segment = self._segment(frame)
        pair = either_side(self._fills[segment], frame)
        shares = {}
        for fill in pair:
            ends = [f for f in (*pair, segment.first, segment.last) if (f - fill) * (frame - fill) > 0]
            reach = min((self._way(fill, end) for end in ends), default=0)
            shares[fill] = max(1.0 - self._way(frame, fill) / reach, LEAST_SHARE) if reach else 1.0
        return shares

    def _way(self, one: int, other: int) -> int:
        return abs(self._path.distance(one) - self._path.distance(other))

    def _segment(self, frame: int) -> Segment:
        """A frame's own segment, whose fills it asks: others see other holes."""
        # The last segment ends where the camera comes to rest: what follows shows the same.
        return next((s for s in self.segments if frame <= s.last), self.segments[-1])

    @cached_property
    def _fills(self) -> dict[Segment, list[int]]:
        """Frames whose pages fill holes, by segment, once all of them are prepared."""
        lines = {segment: self._workshop.run.done(self._unit(segment)) for segment in self.segments}
        if missing := [self._unit(segment) for segment, line in lines.items() if line is None]:
            raise ValueError(f"unit {missing[0]!r} is not finished")
        return {s: [self._frame(n) for n in line["fills"]] for s, line in lines.items() if line}

    def _unit(self, segment: Segment) -> str:
        return f"light {self._workshop.number(segment.first)}-{self._workshop.number(segment.last)}"

    def _frame(self, number: int) -> int:
        return self._workshop.job.path.numbers.index(number)

    def _filled(self, first: int, last: int, fills: list[int]) -> list[int]:
        """Halve a stretch of views until nothing new comes into view; returns the frames that fill holes.

        A page that fills holes knows all that the keyframes don't, so that the two around a frame do.
        """
        middle = self._path.middle(Segment(first, last))
        if middle is None or self._holes(middle, either_side(fills, middle)).mean() < LEAST_HOLES:
            return fills
        self._trace(middle, self._holes(middle, []))
        fills = sorted([*fills, middle])
        return self._filled(middle, last, self._filled(first, middle, fills))

    def _holes(self, frame: int, fills: list[int]) -> Mask:
        """Pixels whose light is known neither to the keyframes nor to pages that fill holes."""
        geometry = self._workshop.views[frame].geometry
        frames = nearest(self._path, self.keyframes, frame, self._workshop.job.settings.light.keyframes)
        return geometry.has_diffuse & ~known(geometry, [self._open(f) for f in (*frames, *fills)])

    def _page(self, frame: int) -> Page:
        """A page with what all around it know of its surfaces."""
        return self._pooled.made(frame, lambda: self._pool(frame))

    def _pool(self, frame: int) -> Page:
        around = nearest(self._path, self.keyframes, frame, 2 * POOL + 1)
        around += nearest(self._path, sorted(set().union(*self._fills.values())), frame, 2 * POOL + 1)
        with self._workshop.costs.of("pool"):
            pages = [self._open(f) for f in sorted({*around, frame})]
            page = self._trace(frame)
            # A page that fills holes is too small for a denoiser to make anything of.
            is_denoised = self._quality != "none" and frame in self.keyframes
            return pooled(page, pages, partial(self._denoised, page.geometry) if is_denoised else None)

    def _denoised(self, geometry: Geometry, light: F32) -> F32:
        has_diffuse = geometry.has_diffuse[..., None].astype(np.float32)
        white = np.broadcast_to(has_diffuse, light.shape)  # the light has no albedo in it
        return denoise(light, white, geometry.normal, quality=self._quality)

    def _open(self, frame: int) -> Page:
        return self._opened.made(frame, lambda: open_page(self._trace(frame)))

    def _trace(self, frame: int, holes: Mask | None = None) -> LightPage:
        """Light at what pixels' centres of a frame see: of all of them, or of those in holes."""
        return self._traced.made(frame, lambda: self._read_or_trace(frame, holes))

    def _read_or_trace(self, frame: int, holes: Mask | None) -> LightPage:
        workshop = self._workshop
        number, geometry = workshop.number(frame), workshop.views[frame].geometry
        unit, file = f"keyframe {number}", workshop.run.file("keyframes", number)
        if workshop.run.done(unit):
            workshop.run.check(file)
            return LightPage(frame, geometry, *read_light(file))
        if holes is None and frame not in self.keyframes:
            # It knew holes alone; which ones, only what prepares its segment can tell.
            raise DamagedFileError(f"{file} is missing", str(file.relative_to(workshop.run.folder)))
        where = geometry.has_diffuse if holes is None else holes
        paths = self.paths
        with workshop.costs.of("trace"):
            light = self._light(frame, where, Purpose.IRRADIANCE)
            light.add(paths)
        direct, indirect = _layers(light, where)
        write_light(file, direct, indirect, where)
        workshop.finish(unit, [file], frame=number, dropped=direct.dropped, rays={"light": light.paths})
        return LightPage(frame, geometry, direct, indirect, where)

    def _light(self, frame: int, where: Mask, purpose: Purpose) -> Estimate:
        workshop, cache = self._workshop, self.drafts.cache(frame)
        camera = workshop.job.path.cameras[frame]
        return Estimate(
            camera,
            np.flatnonzero(where).astype(np.uint32),
            lambda rays, rng, square: workshop.shader.gathered(
                cache, rays, rng, square, pixel_angle=camera.pixel_angle
            ),
            chunk=workshop.job.settings.trace.chunk,
            pixel_filter=PixelFilter.CENTRE,
            random=workshop.random(frame, purpose),
            layers=2,
            is_stratified=True,
        )

    @cached_property
    def paths(self) -> int:
        """Paths of a keyframe's pixel: as set, or as many as the quality asks for."""
        workshop = self._workshop
        settings = workshop.job.settings.light
        if settings.paths:
            return settings.paths
        middle = self.keyframes[len(self.keyframes) // 2]
        unit = f"pilot {workshop.number(middle)}"
        if line := workshop.run.done(unit):
            return int(line["paths"])
        # One that looks at the sky or into a mirror would tell nothing.
        most = max(self.keyframes, key=self.drafts.lit_pixels)
        is_dark = self.drafts.lit_pixels(middle) < LEAST_LIT * self.drafts.lit_pixels(most)
        frame = most if is_dark else middle
        jnd = self._pilot_jnd(frame)
        paths = paths_for(jnd, settings.quality, len(self.keyframes))
        rays = 2 * PILOT_PATHS * int(workshop.views[frame].geometry.has_diffuse.sum())
        workshop.finish(unit, [], frame=workshop.number(frame), jnd=jnd, paths=paths, rays={"drafts": rays})
        return paths

    def _pilot_jnd(self, frame: int) -> float:
        """Visible difference between two estimates of a frame's light, as its surfaces show it."""
        workshop = self._workshop
        geometry = workshop.views[frame].geometry
        where = geometry.has_diffuse
        if not where.any():
            return 0.0
        shown = []
        with workshop.costs.of("pilot"):
            for purpose in (Purpose.PILOT, Purpose.IRRADIANCE):
                light = self._light(frame, where, purpose)
                light.add(PILOT_PATHS)
                direct, indirect = _layers(light, where)
                page = LightPage(frame, geometry, direct, indirect, where)
                shown.append(workshop.shown(geometry.albedo * light_of(pooled(page, [open_page(page)]))))
            return workshop.judge.compare(*shown, valid=where).score


def paths_for(jnd: float, quality: float, keyframes: int) -> int:
    """Paths of a keyframe's pixel that a quality asks for.

    Parameters
    ----------
    jnd
        Visible difference between two estimates by :data:`PILOT_PATHS` each.
    quality
        JND.
    keyframes
        Of the shot.
    """
    # Half of the squared difference is either's own; pages that are pooled share what is left.
    share = max(min(keyframes, 2 * POOL + 1) / 2.0, 1.0)
    wanted = PILOT_PATHS * (jnd / quality) ** 2 / (2.0 * share)
    return int(np.clip(4 * math.ceil(wanted / 4), *PATHS))


def _layers(light: Estimate, where: Mask) -> tuple[Shading, Shading]:
    """Direct and indirect light of some pixels as images, with the variance that it has from page to page."""
    spread = [shading.spread(where) for shading in light.shadings]
    direct, indirect = (replace(s, variance=np.float32(EVEN) * s.variance) for s in spread)
    return direct, indirect
