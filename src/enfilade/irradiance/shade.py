"""Radiance along camera rays: exact surfaces and lobes, cached light.

Tracing a kernel through all materials of a scene takes longer than running it on a frame's lanes: the
kernels are recorded once and replayed.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt

from enfilade.arrays import PCG32, Array3f, Array4f, Bool, Float, UInt, lanes, matrix3, opaque, vector3
from enfilade.camera import Camera
from enfilade.irradiance.cache import BEHIND, LightCache
from enfilade.irradiance.cells import LEVELS, Estimates, cell_key
from enfilade.pixels.estimate import Samples
from enfilade.pixels.random import Leading
from enfilade.pixels.rays import pinhole_directions
from enfilade.records import Geometry, SurfaceClass
from enfilade.renderer import Bounce, LightRenderer, Lit, Rays

BOUNCES = 16  # most bounces off lobes before a path is given up
BRIGHT = 4.0  # one over the throughput below which a path is faint
LEAST_CHANCE = 0.05  # of a faint path to go on
MOST_CHANCE = (
    1.0,
    1.0,
    1.0,
    1.0,
    0.5,
    0.25,
)  # of any path, by bounce; the last holds on: some are trapped in glass
BLACK = 1e-4  # albedo below which no light is looked up
LEAST_LANES = 1021  # of a kernel; fewer might be as many as some array of the scene: another recording
SHARP = (SurfaceClass.MIRROR, SurfaceClass.TRANSPARENT)
ENDLESS = 1e4  # times as far as a mirror seems what it shows of the sky
THROUGH = 0.999999  # chooses the lobe that lets light through
LAYERS = 8  # of mirrors and glass, one behind the other
CELL_PX = 2.0  # width of a cell at what is seen sharply, in pixels
CELL_BLUR = 0.25  # ... and at what is seen through a lobe, of the lobe's width
GATHER_BLUR = 0.2  # ... and at what lights a diffuse surface, of its distance
UNRELATED = 0x9E3779B97F4A7C15  # makes other random numbers of those with which a path goes on


@dataclass(frozen=True)
class _Path:
    """A lane's path so far: a ray on its way to a surface.

    Attributes
    ----------
    lane : UInt
        Where its light goes.
    rays : Rays
    bounce : Bounce or None
        None for camera rays.
    throughput : Array3f
    width, spread : Float
        Of the path where the ray begins, scene units, and what it gains by unit of length.
    rng : PCG32
    """

    lane: Any
    rays: Rays
    bounce: Bounce | None
    throughput: Any
    width: Any
    spread: Any
    rng: Any


@dataclass(frozen=True)
class _Step:
    """What became of paths that met a surface.

    Attributes
    ----------
    sent : Array3f
        Radiance that reaches the camera: emitted, or known to be scattered by the diffuse lobe.
    is_missing : Bool
        Where the diffuse lobe's light is not known.
    goes_on : Bool
        Where there are other lobes.
    path : _Path
        On their way to the surface that was met.
    """

    sent: Any
    is_missing: Any
    goes_on: Any
    path: _Path


class Shader:
    """Estimates radiance with the light that a cache knows.

    Where a ray meets a diffuse lobe, the light is looked up; what the cache does not know is estimated by
    path tracing for that lookup alone. Other lobes scatter the ray once, and the same is asked where it
    lands. With an empty cache ``seen`` plus ``scattered`` is a path tracer, and converges to what
    ``trace`` does.

    Parameters
    ----------
    renderer
    pixel_angle
        Of the camera, radians: what is seen sharply is cached in finer cells.
    """

    def __init__(self, renderer: LightRenderer, pixel_angle: float) -> None:
        self._renderer = renderer
        self._pixel_angle = pixel_angle
        self._look_on = self._recorded(self._look_on_kernel)
        self._meet = self._recorded(self._meet_kernel)
        self._look_up = self._recorded(self._look_up_kernel)
        self._go_on = self._recorded(self._go_on_kernel)
        self._gather = self._recorded(self._gather_kernel)
        self._estimate = self._recorded(self._estimate_kernel)

    def seen(self, view: LightCache, cache: LightCache, rays: Rays, rng: Any) -> Samples:
        """Radiance that the surfaces seen send by emission and by their diffuse lobes.

        Parameters
        ----------
        view
            Asked first: what all pages know of this very view.
        cache
            Asked for what the first does not know.
        rays
            From the camera, one a lane.
        rng : PCG32
            One generator a lane.

        Returns
        -------
        Samples
            Marked where the surface does more: there :meth:`scattered` must be asked.
        """
        step = self._meet(view, self._begun(rays, rng))
        radiance = Array3f(step.sent)
        self._add_missing(radiance, cache, step, jitter=1.0, is_asked=False)
        return Samples((radiance,), step.goes_on)

    def scattered(
        self,
        cache: LightCache,
        rays: Rays,
        rng: Any,
        square: Any,
        heard: Callable[[Estimates], None] | None = None,
    ) -> Any:
        """Radiance that the surfaces seen send by all their other lobes.

        Parameters are those of :meth:`seen`.

        Parameters
        ----------
        square : Array4f
            In [0, 1): which lobe, and where it sends the ray.
        heard
            Told of the light that was not known and had to be estimated.

        Returns
        -------
        Array3f
        """
        radiance = dr.zeros(Array3f, dr.width(rng.state))
        path = self._begun(rays, rng)
        path = _chosen(path, dr.compress(self._meet(LightCache(), path).goes_on))
        self._follow(radiance, cache, path, 0, heard, square)
        return radiance

    def gathered(
        self,
        cache: LightCache,
        rays: Rays,
        rng: Any,
        square: Any,
        heard: Callable[[Estimates], None] | None = None,
    ) -> Samples:
        """Light on the diffuse surfaces seen, by lights sampled and one bounce into the cache.

        Parameters are those of :meth:`scattered`.

        Parameters
        ----------
        square : Array4f
            In [0, 1): where on the lights, and where to bounce.

        Returns
        -------
        Samples
            Radiance that the diffuse lobe would send if the albedo were one, in two layers: by light
            straight from emitters, and by all other.
        """
        dr.eval(square)  # for the same reason as in _begun
        direct, step = self._gather(cache, self._begun(rays, rng), square)
        indirect = Array3f(step.sent)
        self._add_missing(indirect, cache, step, heard=heard)
        self._follow(indirect, cache, _chosen(step.path, dr.compress(step.goes_on)), 1, heard)
        return Samples((direct, indirect))

    def _follow(
        self,
        radiance: Any,
        cache: LightCache,
        path: _Path,
        bounce: int,
        heard: Callable[[Estimates], None] | None,
        square: Any = None,
    ) -> None:
        """Add what paths find on their way from lobe to lobe, of which some bounces lie behind them.

        The numbers of the first of these bounces may be given, by lane.
        """
        # What is seen in a mirror is smoothed over cells; where light comes from needs no smoothing.
        jitter = 1.0 if bounce == 0 else 0.0
        while bounce < BOUNCES and dr.width(path.lane):
            # The first bounce off what is seen counts; then faint paths are ended at random.
            least = 1.0 if bounce == 0 else LEAST_CHANCE
            most = MOST_CHANCE[min(bounce, len(MOST_CHANCE) - 1)]
            first = None if square is None else dr.gather(Array4f, square, path.lane)
            dr.eval(first)
            square = None
            direct, step = self._go_on(cache, path, opaque(least), opaque(most), first)
            _scatter_add(radiance, direct, path.lane)
            _scatter_add(radiance, step.sent, step.path.lane)
            self._add_missing(radiance, cache, step, jitter=jitter, heard=heard)
            path = _chosen(step.path, dr.compress(step.goes_on))
            bounce += 1

    def shown(self, geometry: Geometry) -> Geometry:
        """What mirrors show and glass lets through, where it seems to be.

        Item and normal of pixels on a sharp surface become those of the surface at the end of the chain, with
        :data:`~enfilade.irradiance.cache.BEHIND` added to the item's number, and the depth that of the
        virtual image: as far away as the way to it is long, which is exact for plane mirrors. Everything else
        stays.
        """
        pixels = np.flatnonzero(np.isin(geometry.surface, SHARP)).astype(np.uint32)
        if not len(pixels):
            return geometry
        item, normal = geometry.item.ravel().copy(), geometry.normal.reshape(-1, 3).copy()
        path = self._begun(*_centre_rays(geometry.camera, pixels))
        way = np.ones(len(item), np.float32)  # in lengths of that to the surface itself
        first = geometry.depth.ravel() * _lengths(geometry.camera)
        item[pixels], normal[pixels] = BEHIND, 0.0
        for _ in range(LAYERS):
            path, found, turned, distance, is_sharp = self._look_on(path)
            lane = pixels[np.array(path.lane)]
            item[lane], normal[lane] = np.array(found) + BEHIND, np.array(turned).T
            way[lane] = np.minimum(way[lane] + np.array(distance) / first[lane], ENDLESS)
            path = _chosen(path, dr.compress(is_sharp))
            if not dr.width(path.lane):
                break
        size = geometry.item.shape
        return replace(
            geometry,
            depth=geometry.depth * way.reshape(size),
            item=item.reshape(size),
            normal=np.ascontiguousarray(normal.reshape(*size, 3)),
        )

    def _begun(self, rays: Rays, rng: Any) -> _Path:
        count = dr.width(rng.state)
        path = _Path(
            lane=dr.arange(UInt, count),
            rays=Rays(rays.origin + dr.zeros(Array3f, count), rays.direction),
            bounce=None,
            throughput=dr.opaque(Array3f, 1.0, count),
            width=dr.opaque(Float, 0.0, count),
            spread=dr.opaque(Float, CELL_PX * self._pixel_angle, count),
            rng=rng,
        )
        # Now, and not while a kernel is recorded: then no memory of NumPy's can be let go.
        dr.eval(path)
        return path

    def _add_missing(
        self,
        radiance: Any,
        cache: LightCache,
        step: _Step,
        *,
        jitter: float = 0.0,
        is_asked: bool = True,
        heard: Callable[[Estimates], None] | None = None,
    ) -> None:
        """Add what diffuse lobes send whose light was not found: look further, or estimate it.

        Parameters
        ----------
        radiance
        cache
        step
        jitter
            Of lookups in cells, in cells.
        is_asked
            Whether the pages of the cache did not know.
        heard
        """
        path = step.path
        missing: Any = dr.compress(step.is_missing)
        further = LightCache(cells=cache.cells) if is_asked else cache
        if (further.pages or further.cells) and dr.width(missing):
            found = self._look_up(further, _chosen(path, missing), opaque(jitter))
            _scatter_add(radiance, found.sent, found.path.lane)
            still: Any = dr.compress(found.is_missing)
            missing = dr.gather(UInt, _padded(missing)[0], still)
        if not dr.width(missing):
            return
        unknown = _chosen(path, missing)
        weight, light, keys, rng = self._estimate(unknown)
        _scatter_add(radiance, weight * light, unknown.lane)
        if heard:
            _tell(heard, keys, light, dr.width(missing))
        # The paths go on with other random numbers than the estimates were made with.
        dr.scatter(path.rng.state, rng.state, _padded(missing)[0])

    def _look_on_kernel(self, path: _Path) -> tuple[_Path, Any, Any, Any, Any]:
        """Go through the surface that the rays meet, or be mirrored; and say what is met next."""
        rng = PCG32(path.rng)
        lit = self._renderer.lit(path.rays, path.bounce)
        scattered = self._renderer.scatter(lit, rng, Float(THROUGH))
        ahead = _Path(
            path.lane, scattered.rays, scattered.bounce, path.throughput, path.width, path.spread, rng
        )
        surfaces = self._renderer.lit(ahead.rays, ahead.bounce).surfaces
        is_sharp = Bool(False)
        for sharp in SHARP:
            is_sharp |= surfaces.surface == int(sharp)
        item = dr.select(surfaces.is_hit, surfaces.item, 0)
        normal = dr.select(surfaces.is_hit, surfaces.normal, 0.0)
        is_sharp &= surfaces.is_hit & scattered.is_alive
        return ahead, item, Array3f(normal), Float(surfaces.distance), Bool(is_sharp)

    def _meet_kernel(self, cache: LightCache, path: _Path) -> _Step:
        emitted, step = self._met(cache, path)
        return replace(step, sent=emitted + step.sent)

    def _met(self, cache: LightCache, path: _Path) -> tuple[Any, _Step]:
        """What is emitted where rays meet a surface; and what it scatters, as far as that is known."""
        lit = self._renderer.lit(path.rays, path.bounce)
        albedo, is_diffuse = _diffuse(lit)
        found, is_known = cache.find(lit.position, lit.surfaces.normal, lit.surfaces.item)
        sent = path.throughput * dr.select(is_diffuse & is_known, albedo * found, 0.0)
        carries = _carries(path)
        is_missing = is_diffuse & ~is_known & carries
        step = _Step(Array3f(sent), Bool(is_missing), Bool(lit.has_lobe & carries), path)
        return Array3f(path.throughput * lit.emission), step

    def _look_up_kernel(self, cache: LightCache, path: _Path, jitter: Any) -> _Step:
        """What the diffuse lobes send, by pages and cells."""
        lit = self._renderer.lit(path.rays, path.bounce)
        albedo, is_diffuse = _diffuse(lit)
        found, is_known = cache.find(lit.position, lit.surfaces.normal, lit.surfaces.item)
        if cache.cells:
            rng = PCG32(path.rng)
            rng.state ^= UNRELATED
            moved = Array3f(rng.next_float32(), rng.next_float32(), rng.next_float32())
            moved = 0.5 + jitter * (moved - 0.5)
            light, is_in_cell = cache.cells.find(
                lit.position, lit.surfaces.normal, lit.surfaces.item, _width(path, lit), moved
            )
            found = dr.select(is_known, found, light)
            is_known |= is_in_cell
        sent = dr.select(is_diffuse & is_known, path.throughput * albedo * found, 0.0)
        return _Step(Array3f(sent), Bool(is_diffuse & ~is_known & _carries(path)), Bool(False), path)

    def _go_on_kernel(
        self, cache: LightCache, path: _Path, least: Any, most: Any, square: Any
    ) -> tuple[Any, _Step]:
        """Scatter off the surface that the rays meet, and meet the next."""
        rng = PCG32(path.rng)
        lit = self._renderer.lit(path.rays, path.bounce)
        scattered = self._renderer.scatter(lit, rng if square is None else Leading(square, rng))
        throughput = path.throughput * scattered.throughput
        chance = dr.clip(BRIGHT * dr.max(dr.abs(throughput)), least, most)
        is_alive = scattered.is_alive & (rng.next_float32() < chance)
        blur = dr.select(scattered.bounce.is_delta, 0.0, CELL_BLUR * dr.rsqrt(scattered.bounce.pdf))
        ahead = _Path(
            lane=path.lane,
            rays=scattered.rays,
            bounce=scattered.bounce,
            throughput=Array3f(throughput / chance),
            width=_width(path, lit),
            spread=dr.maximum(path.spread, blur),
            rng=rng,
        )
        emitted, step = self._met(cache, ahead)
        return Array3f(path.throughput * scattered.direct), _Step(
            sent=dr.select(is_alive, emitted + step.sent, 0.0),
            is_missing=Bool(step.is_missing & is_alive),
            goes_on=Bool(step.goes_on & is_alive),
            path=ahead,
        )

    def _gather_kernel(self, cache: LightCache, path: _Path, square: Any) -> tuple[Any, _Step]:
        """Scatter off the diffuse lobe that the rays meet, and meet the next surface."""
        rng = PCG32(path.rng)
        lit = self._renderer.lit(path.rays, path.bounce)
        lobe = self._renderer.scatter_diffuse(lit, Leading(square, rng))
        ahead = _Path(
            lane=path.lane,
            rays=lobe.rays,
            bounce=lobe.bounce,
            throughput=Array3f(dr.select(lobe.is_alive, lobe.throughput, 0.0)),
            width=_width(path, lit),
            spread=dr.maximum(path.spread, GATHER_BLUR),
            rng=rng,
        )
        emitted, step = self._met(cache, ahead)
        return Array3f(lobe.direct + emitted), step

    def _estimate_kernel(self, path: _Path) -> tuple[Any, Any, tuple[Any, ...], Any]:
        """Light where rays meet a surface, by path tracing, with its weight in the image and its cells."""
        rng = PCG32(path.rng)
        lit = self._renderer.lit(path.rays, path.bounce)
        width = _width(path, lit)
        direct, indirect = self._renderer.light(lit, rng, edges=2 if path.bounce else 1)
        light = Array3f(direct + indirect)
        at = lit.position, lit.surfaces.normal, lit.surfaces.item, width
        keys = tuple(cell_key(*at, level) for level in range(LEVELS))
        return Array3f(path.throughput * lit.surfaces.albedo), light, keys, rng

    def _recorded(self, kernel: Any) -> Any:
        renderer = self._renderer
        recorded = dr.freeze(kernel, auto_opaque=False, state_fn=lambda *_: renderer.state)

        def replayed(*arguments: Any) -> Any:
            # Garbage that shares NumPy's memory can't be let go while a kernel is recorded.
            had_collector = gc.isenabled()
            gc.disable()
            try:
                return recorded(*arguments)
            finally:
                if had_collector:
                    gc.enable()

        return replayed


def _centre_rays(camera: Camera, pixels: npt.NDArray[np.uint32]) -> tuple[Rays, Any]:
    """Rays through the centres of pixels, with a generator each."""
    pixel = lanes(pixels)
    row = pixel // opaque(camera.width)
    direction = pinhole_directions(
        Float(pixel - row * opaque(camera.width)) + 0.5,
        Float(row) + 0.5,
        direction_from_pixel=matrix3(camera.direction_from_pixel),
    )
    return Rays(vector3(camera.eye), direction), PCG32(dr.width(pixel))


def _tell(heard: Callable[[Estimates], None], keys: tuple[Any, ...], light: Any, count: int) -> None:
    values = np.array(light).T[:count]
    for key in keys:
        heard(Estimates.of(np.array(key)[:count], values))


def _lengths(camera: Camera) -> npt.NDArray[np.float32]:
    """Of the directions of unit depth through the centres of all pixels, (N,)."""
    row, column = np.indices((camera.height, camera.width)).reshape(2, -1) + 0.5
    directions = np.stack([column, row, np.ones_like(row)], axis=1) @ camera.direction_from_pixel.T
    lengths: npt.NDArray[np.float32] = np.linalg.norm(directions, axis=1).astype(np.float32)
    return lengths


def _diffuse(lit: Lit) -> tuple[Any, Any]:
    """Albedo, and where it is worth looking up light."""
    albedo = lit.surfaces.albedo
    return albedo, lit.surfaces.is_hit & (dr.max(albedo) > BLACK)


def _carries(path: _Path) -> Any:
    """Whether a path brings anything: those that only fill up a list do not."""
    return dr.max(dr.abs(path.throughput)) > 0.0


def _width(path: _Path, lit: Lit) -> Any:
    """Of paths where they meet a surface, scene units."""
    return path.width + path.spread * lit.surfaces.distance * dr.norm(path.rays.direction)


def _padded(chosen: Any) -> tuple[Any, Any]:
    """Lanes of a list, repeated until they are enough for a kernel, and which are no repetitions."""
    count = dr.width(chosen)
    index = dr.arange(UInt, max(count, LEAST_LANES))
    return dr.gather(UInt, chosen, dr.minimum(index, opaque(count - 1))), index < opaque(count)


def _chosen(path: _Path, chosen_lanes: Any) -> _Path:
    """Paths of some chosen_lanes; what is added to have enough of them carries nothing."""
    if not dr.width(chosen_lanes):
        return _Path(UInt(), path.rays, path.bounce, path.throughput, path.width, path.spread, path.rng)
    chosen_lanes, is_real = _padded(chosen_lanes)
    chosen = _Path(
        lane=dr.gather(UInt, path.lane, chosen_lanes),
        rays=dr.gather(Rays, path.rays, chosen_lanes),
        bounce=dr.gather(Bounce, path.bounce, chosen_lanes) if path.bounce else None,
        throughput=dr.select(is_real, dr.gather(Array3f, path.throughput, chosen_lanes), 0.0),
        width=dr.gather(Float, path.width, chosen_lanes),
        spread=dr.gather(Float, path.spread, chosen_lanes),
        rng=dr.gather(PCG32, path.rng, chosen_lanes),
    )
    dr.eval(chosen)
    return chosen


def _scatter_add(radiance: Any, sent: Any, lane: Any) -> None:
    """Add to each lane's radiance; a lane has one path, so that the order does not matter."""
    for target, value in zip(radiance, sent, strict=True):
        dr.scatter_add(target, Float(value), lane)
    dr.eval(radiance)
