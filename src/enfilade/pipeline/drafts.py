"""A first, rough idea of the light of a shot, which the keyframes of light are made with.

A keyframe's paths need not be followed through all their bounces: they look up the light where their first
bounce lands. That may be rough, since each looks at many places (final gathering: Jensen 1996; Ward and
Heckbert 1992).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enfilade.gbuffer import find_geometry
from enfilade.images import read_arrays, read_light, write_arrays, write_light
from enfilade.kernels.estimate import Estimate, Samples
from enfilade.kernels.lookup import Page
from enfilade.methods.decoupled import Estimates, LightCache, open_cache, open_page, pooled
from enfilade.methods.decoupled.cells import Cells
from enfilade.pipeline.kept import Kept, nearest
from enfilade.pipeline.workshop import Workshop
from enfilade.records import LOBE_LAYERS, LightPage
from enfilade.renderer import PixelFilter, Purpose

COARSER = 2  # times fewer pixels across than a frame has
PATHS = 4  # of a draft's pixel
POOL = 4  # keyframes to each side with which a draft is pooled
PAGES = 4  # drafts in which a point is looked up
GATHER_SPP = 4  # bounces of a draft's pixel that look for what no draft sees
LOBE_SPP = 4  # rays of a frame's pixel that look for the same off mirrors, glass and glossy surfaces
SCOUTS = 8  # keyframes whose estimates of what no draft sees a frame shares


class Drafts:
    """Rough light at a shot's keyframes: pages of fewer pixels, and cells for what none of them sees.

    Parameters
    ----------
    workshop
    keyframes
        Frames.
    """

    def __init__(self, workshop: Workshop, keyframes: list[int]) -> None:
        self._workshop = workshop
        self._keyframes = keyframes
        # More than one frame asks for, so that going along the path makes each once.
        self._traced: Kept[LightPage] = Kept(2 * POOL + 1 + PAGES)
        self._opened: Kept[Page] = Kept(2 * POOL + 1 + PAGES)
        self._pooled: Kept[Page] = Kept(PAGES + 2)
        self._estimates: Kept[Estimates] = Kept(SCOUTS)
        self._cells: tuple[list[int], Cells | None] = ([], None)

    def cache(self, frame: int) -> LightCache:
        """What drafts and cells near a frame know."""
        return replace(self._pages(frame), cells=self.cells(frame))

    def cells(self, frame: int) -> Cells | None:
        """What is known of surfaces that no draft near a frame sees."""
        near = sorted(nearest(self._workshop.job.path, self._keyframes, frame, SCOUTS))
        if self._cells[0] != near:
            self._cells = near, Estimates.joined([self.scout(k) for k in near]).opened()
        return self._cells[1]

    def scout(self, frame: int) -> Estimates:
        """Estimate the light where paths lead from a keyframe and no draft sees."""
        return self._estimates.made(frame, lambda: self._read_or_scout(frame))

    def trace(self, frame: int) -> LightPage:
        """The draft of a keyframe."""
        return self._traced.made(frame, lambda: self._read_or_trace(frame))

    def lit_pixels(self, frame: int) -> int:
        """Pixels of the draft of a keyframe that show light."""
        unit = f"draft {self._workshop.number(frame)}"
        line = self._workshop.run.done(unit)
        if line is None:
            self.trace(frame)
            line = self._workshop.run.done(unit)
        return int(line["rays"]["drafts"]) if line else 0

    def _pages(self, frame: int) -> LightCache:
        near = nearest(self._workshop.job.path, self._keyframes, frame, PAGES)
        pages = [self._page(keyframe) for keyframe in near]
        # Always as many, so that the kernels which look them up are recorded once.
        missing = PAGES - len(pages)
        return open_cache([*pages, *[pages[0]] * missing], [*[1.0] * len(pages), *[0.0] * missing])

    def _page(self, frame: int) -> Page:
        return self._pooled.made(frame, lambda: self._pool(frame))

    def _pool(self, frame: int) -> Page:
        around = sorted(nearest(self._workshop.job.path, self._keyframes, frame, 2 * POOL + 1))
        return pooled(self.trace(frame), [self._open(keyframe) for keyframe in around])

    def _open(self, frame: int) -> Page:
        return self._opened.made(frame, lambda: open_page(self.trace(frame)))

    def _read_or_trace(self, frame: int) -> LightPage:
        workshop, renderer = self._workshop, self._workshop.lobe_renderer
        number = workshop.number(frame)
        unit, file = f"draft {number}", workshop.run.file("drafts", number)
        with workshop.costs.of("draft"):
            camera = workshop.job.path.cameras[frame]
            camera = replace(
                camera, width=max(camera.width // COARSER, 1), height=max(camera.height // COARSER, 1)
            )
            geometry = find_geometry(renderer, camera)
            if workshop.run.done(unit):
                workshop.run.check(file)
                return LightPage(frame, geometry, *read_light(file))
            where = geometry.has_diffuse
            light = Estimate(
                camera,
                np.flatnonzero(where).astype(np.uint32),
                lambda rays, rng: Samples(
                    renderer.estimate_diffuse(renderer.intersect(rays, opaque_only=True), rng, path_depth=2)
                ),
                chunk=workshop.job.settings.trace.chunk,
                pixel_filter=PixelFilter.CENTRE,
                random=workshop.random(frame, Purpose.PREPASS),
                layers=2,
            )
            light.add(PATHS)
            direct, indirect = (shading.spread(where) for shading in light.shadings)
        write_light(file, direct, indirect, where)
        workshop.finish(unit, [file], frame=number, dropped=direct.dropped, rays={"drafts": light.paths})
        return LightPage(frame, geometry, direct, indirect, where)

    def _read_or_scout(self, frame: int) -> Estimates:
        workshop = self._workshop
        number = workshop.number(frame)
        unit, file = f"cells {number}", workshop.run.file("cells", number).with_suffix(".npz")
        if workshop.run.done(unit):
            workshop.run.check(file)
            return Estimates(*read_arrays(file, "keys", "sums", "counts"))
        parts: list[Estimates] = []
        with workshop.costs.of("scout"):
            rays = self._heard_by_lobes(frame, parts) + self._heard_by_gathering(frame, parts)
            estimates = Estimates.joined(parts)
        write_arrays(file, {"keys": estimates.keys, "sums": estimates.sums, "counts": estimates.counts})
        workshop.finish(unit, [file], frame=number, cells=len(estimates.keys), rays={"drafts": rays})
        return estimates

    def _heard_by_lobes(self, frame: int, parts: list[Estimates]) -> int:
        path, cache, shader = self._workshop.job.path, self._pages(frame), self._workshop.shader
        camera = path.cameras[frame]
        rays = Estimate(
            camera,
            np.arange(path.width * path.height, dtype=np.uint32),
            lambda rays, rng, square: shader.scattered(
                cache, rays, rng, square, parts.append, pixel_angle=camera.pixel_angle
            ),
            chunk=self._workshop.job.settings.trace.chunk,
            pixel_filter=PixelFilter.BOX,
            random=self._workshop.random(frame, Purpose.HASH_GRID),
            layers=len(LOBE_LAYERS),
            is_stratified=True,
        )
        rays.add(LOBE_SPP)
        return rays.paths

    def _heard_by_gathering(self, frame: int, parts: list[Estimates]) -> int:
        page, cache, shader = self.trace(frame), self._pages(frame), self._workshop.shader
        angle = self._workshop.job.path.cameras[frame].pixel_angle
        bounces = Estimate(
            page.geometry.camera,
            np.flatnonzero(page.is_known).astype(np.uint32),
            lambda rays, rng, square: shader.gathered(
                cache, rays, rng, square, parts.append, pixel_angle=angle
            ),
            chunk=self._workshop.job.settings.trace.chunk,
            pixel_filter=PixelFilter.CENTRE,
            random=self._workshop.random(frame, Purpose.PREPASS_HASH_GRID),
            layers=2,
            is_stratified=True,
        )
        bounces.add(GATHER_SPP)
        return bounces.paths
