"""Frames with visibility of their own and light from the keyframes: ``--method decoupled``.

Every frame is shaded by itself: camera rays, textures and lobes are exact, and the light on diffuse
surfaces is looked up in the keyframes nearest on the path. What they don't know is path traced, for that
lookup alone. What lobes scatter is sampled afresh in each frame, and then averaged over a few frames along
its own motion: that of the surface, or of the virtual image in a mirror or behind glass.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from enfilade.images import read_parts, write_parts
from enfilade.kernels.estimate import LUMINANCE, Estimate
from enfilade.kernels.lookup import Page
from enfilade.methods.decoupled import LightCache, open_scattered, over_time, smoothed
from enfilade.methods.paper.masks import emitter_pixels
from enfilade.pipeline.finish import result_unit, write_frame_result
from enfilade.pipeline.kept import Kept, around
from enfilade.pipeline.light import LightTable
from enfilade.pipeline.units import REACH
from enfilade.pipeline.views import View
from enfilade.pipeline.workshop import Workshop
from enfilade.records import F32, LOBE_LAYERS, U8, Frame, Geometry, Mask, Shading, Source
from enfilade.renderer import PixelFilter, Purpose

EDGE_CONTRAST = 0.003  # by JND of the quality: relative deviation above which a pixel takes more camera rays
EDGE_SAMPLES = 256.0, 8, 64  # camera rays of such a pixel at a quality of one JND; fewest and most
LOBE_SAMPLES = 34.0, 2, 34  # lobe rays of a pixel, likewise, but by the root of the quality


def raw_unit(workshop: Workshop, frame: int) -> str:
    """Name in the ledger of a frame shaded by itself."""
    return f"raw {workshop.number(frame)}"


class DecoupledFrames:
    """Shades frames, and filters over time what is sampled afresh in each; a view that rests, once.

    Memory is bounded by the frames that the filter spans, whatever the length of the shot.

    Parameters
    ----------
    workshop
    """

    def __init__(self, workshop: Workshop) -> None:
        self._workshop = workshop
        self._kept: Kept[_Parts] = Kept(2 * REACH + 2)
        self._made: Kept[tuple[Frame, View]] = Kept(1)

    def shade(self, table: LightTable, frame: int) -> None:
        """Shade a frame by itself, from the light of the pages around it."""
        if not self._workshop.run.done(raw_unit(self._workshop, frame)):
            self._kept.made(frame, lambda: self._shaded(table, frame))

    def make(self, frame: int) -> None:
        """Deliver a frame, once those around it are shaded."""
        workshop = self._workshop
        if workshop.run.done(result_unit(workshop, frame)):
            return
        original = workshop.job.path.static_frame(frame)
        made, view = self._made.made(original, lambda: self._averaged(original))
        if frame != original:
            made, view = replace(made, source=np.full_like(made.source, Source.REUSED)), workshop.views[frame]
        write_frame_result(workshop, frame, view, made)

    def _averaged(self, frame: int) -> tuple[Frame, View]:
        """A frame with what its surfaces scatter, averaged over the views around it; and its view."""
        workshop, path = self._workshop, self._workshop.job.path
        shot = next(shot for shot in path.shots() if frame in shot)
        span = around(path, shot, frame, REACH)
        parts = {f: self._kept.made(f, lambda f=f: self._read(f)) for f in span}  # type: ignore[misc]
        here = parts[frame]
        others = [f for f in span if f != frame]
        shares = {f: 1.0 - abs(path.distance(f) - path.distance(frame)) / (REACH + 1) for f in others}
        color = here.seen
        if np.any(here.source == Source.SPECULAR):
            with workshop.costs.of("over time"):
                for k, page in enumerate(here.scattered):
                    have = [
                        f for f in others if k < len(parts[f].scattered)
                    ]  # what lacks a layer saw none of it
                    pages = [(parts[f].scattered[k], shares[f]) for f in have]
                    color = color + over_time(here.view.geometry, page, pages)
        # What a lobe is sampled as may be negative; what arrives is not.
        return Frame(np.maximum(color, 0.0), here.source), here.view

    def _shaded(self, table: LightTable, frame: int) -> _Parts:
        workshop = self._workshop
        view = workshop.views[frame]
        with workshop.costs.of("gather"):
            near, cache = table.around(frame)
            estimate = _seen(workshop, frame, near, cache)
        with workshop.costs.of("scatter"):
            shown, scattered, lobe_rays = _scattered(workshop, view.geometry, frame, cache, estimate)
        source = _source(view.geometry, near, estimate.is_marked, is_keyframe=frame in table.keyframes)
        seen = estimate.shading.color.reshape(*source.shape, 3)
        dropped = scattered[0].dropped + estimate.shading.dropped
        file = workshop.run.file("raw", workshop.number(frame))
        with workshop.costs.of("files"):
            seen, scattered = write_parts(file, seen, scattered, source, dropped)
        rays = {"camera": estimate.paths, "lobes": lobe_rays}
        number = workshop.number(frame)
        workshop.finish(raw_unit(workshop, frame), [file], frame=number, dropped=dropped, rays=rays)
        return _parts(workshop, view, shown, seen, scattered, source)

    def _read(self, frame: int) -> _Parts:
        workshop = self._workshop
        file, view = workshop.run.file("raw", workshop.number(frame)), workshop.views[frame]
        workshop.run.check(file)
        with workshop.costs.of("files"):
            seen, scattered, source = read_parts(file)
        shown = _shown(workshop, view.geometry, len(scattered))
        return _parts(workshop, view, shown, seen, scattered, source)


@dataclass(frozen=True, eq=False)
class _Parts:
    """A frame shaded by itself."""

    view: View
    seen: F32
    scattered: list[Page]
    source: U8


def _parts(
    workshop: Workshop,
    view: View,
    shown: Sequence[Geometry],
    seen: F32,
    scattered: Sequence[Shading],
    source: U8,
) -> _Parts:
    where = _grown(source == Source.SPECULAR)
    with workshop.costs.of("over time"):
        pairs = zip(shown, scattered, strict=True)
        pages = [open_scattered(geometry, shading, where) for geometry, shading in pairs]
    return _Parts(view, seen, pages, source)


def _shown(workshop: Workshop, geometry: Geometry, layers: int) -> list[Geometry]:
    """What so many of a frame's lobe layers show, where it seems to be."""
    images = workshop.virtual_images
    return [image(geometry) for image in (images.reflected, images.transmitted)[:layers]]


def _seen(workshop: Workshop, frame: int, view: LightCache, cache: LightCache) -> Estimate:
    """What surfaces emit and scatter diffusely; edges and fine textures get more camera rays."""
    path, settings = workshop.job.path, workshop.job.settings
    camera = path.cameras[frame]
    seen = Estimate(
        camera,
        np.arange(path.width * path.height, dtype=np.uint32),
        lambda rays, rng: workshop.shader.seen(view, cache, rays, rng, pixel_angle=camera.pixel_angle),
        chunk=settings.trace.chunk,
        pixel_filter=PixelFilter.GAUSSIAN,
        random=workshop.random(frame, Purpose.DIFFUSE),
    )
    least, quality = settings.light.least_samples, settings.light.quality
    most = settings.light.samples or _between(EDGE_SAMPLES, quality)
    seen.add(least)
    if most > least:
        shading = seen.shading
        is_edge = np.sqrt(shading.variance) > EDGE_CONTRAST * quality * _luminance(shading)
        is_edge = is_edge.reshape(path.height, path.width)
        # Small lamps that the first rays miss, and dilute, would lose most of their light.
        is_edge |= emitter_pixels(workshop.lobe_renderer.emitters, workshop.views[frame].geometry)
        seen.add(most - least, _grown(is_edge).ravel())
    return seen


def _source(
    geometry: Geometry, view: LightCache, has_specular: npt.NDArray[np.bool_], *, is_keyframe: bool
) -> U8:
    """Why pixels have their values: lobes are sampled, and so is light that no page knows, (H, W)."""
    is_known = np.array(view.pages[0].shape_indices) > 0
    source = np.full(has_specular.shape, Source.KEYFRAME if is_keyframe else Source.REUSED, np.uint8)
    source[geometry.has_diffuse.ravel() & ~is_known] = Source.HOLE
    source[has_specular] = Source.SPECULAR
    return source.reshape(geometry.shape_index.shape)


def _scattered(
    workshop: Workshop, geometry: Geometry, frame: int, cache: LightCache, seen: Estimate
) -> tuple[list[Geometry], list[Shading], int]:
    """What surfaces scatter by all but their diffuse lobes, (H, W), smoothed; and by how many rays.

    In the layers of ``records.LOBE_LAYERS`` that are not empty, but for the first, each with what it shows.
    All pixels take as many rays: a second pass over the scene for those where noise is left would cost what
    half as many more for all do.
    """
    path, settings = workshop.job.path, workshop.job.settings
    where = _grown(seen.is_marked.reshape(path.height, path.width))
    if not where.any():
        return [geometry], [_black(where.shape)], 0
    camera = path.cameras[frame]
    scattered = Estimate(
        camera,
        np.flatnonzero(where).astype(np.uint32),
        lambda rays, rng, square: workshop.shader.scattered(
            cache, rays, rng, square, pixel_angle=camera.pixel_angle
        ),
        chunk=settings.trace.chunk,
        pixel_filter=PixelFilter.GAUSSIAN,
        random=workshop.random(frame, Purpose.SPECULAR),
        layers=len(LOBE_LAYERS),
        is_stratified=True,
    )
    light = settings.light
    scattered.add(light.lobe_samples or _between(LOBE_SAMPLES, math.sqrt(light.quality)))
    reflected, *more = (shading.spread(where) for shading in scattered.shadings)
    layers = [reflected, *(layer for layer in more if layer.color.any())]
    shown = _shown(workshop, geometry, len(layers))
    return shown, smoothed(shown, layers, where), scattered.paths


def _black(size: tuple[int, ...]) -> Shading:
    return Shading(np.zeros((*size, 3), np.float32), np.zeros(size, np.float32))


def _between(samples: tuple[float, int, int], quality: float) -> int:
    at_one, least, most = samples
    return min(max(round(at_one / quality), least), most)


def _luminance(shading: Shading) -> npt.NDArray[np.float32]:
    mean: npt.NDArray[np.float32] = shading.color @ np.array(LUMINANCE, np.float32)
    return mean


def _grown(chosen: Mask) -> Mask:
    """Pixels, and the eight around each."""
    padded = np.pad(chosen, 1)
    rows = padded[:-2] | padded[1:-1] | padded[2:]
    grown: Mask = rows[:, :-2] | rows[:, 1:-1] | rows[:, 2:]
    return grown
