"""Radiance along camera rays: exact surfaces and lobes, cached light."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import PCG32, Array3f, Array4f, Bool, UInt, opaque, rows
from enfilade.kernels.estimate import Samples
from enfilade.kernels.random import Leading
from enfilade.kernels.replay import padded, recorded
from enfilade.methods.decoupled.cache import LightCache
from enfilade.methods.decoupled.cells import LEVELS, Estimates, cell_key
from enfilade.methods.decoupled.paths import Path, begun, chosen, scatter_add
from enfilade.records import MIN_DIFFUSE_ALBEDO, SurfaceClass
from enfilade.renderer import MAX_PATH_DEPTH, BsdfSample, LobeRenderer, Rays, ShadingPoint

BOUNCES = MAX_PATH_DEPTH - 1  # off lobes, from cache to cache; what goes on then is path traced to its end
BRIGHT = 4.0  # one over the throughput below which a path is faint
LEAST_CHANCE = 0.05  # of a faint path to go on
CELL_PX = 2.0  # width of a cell at what is seen sharply, in pixels
CELL_BLUR = 0.25  # ... and at what is seen through a lobe, of the lobe's width
GATHER_BLUR = 0.2  # ... and at what lights a diffuse surface, of its distance
UNRELATED = 0x9E3779B97F4A7C15  # makes other random numbers of those with which a path goes on


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
    path : Path
        On their way to the surface that was met.
    spot : _Spot
        Of the surface that was met.
    """

    sent: Any
    is_missing: Any
    goes_on: Any
    path: Path
    spot: _Spot


@dataclass(frozen=True)
class _Spot:
    """What looking up the light of a surface that was met takes, without the scene.

    Attributes
    ----------
    position, normal : Array3f
    shape_index : UInt
    width : Float
        Of the path there, scene units.
    weight : Array3f
        What the diffuse lobe's light counts in the image; 0 where there is none.
    """

    position: Any
    normal: Any
    shape_index: Any
    width: Any
    weight: Any

    @property
    def counts(self) -> Any:
        """Whether it is worth looking up light; Bool."""
        return dr.max(dr.abs(self.weight)) > 0.0


class Shader:
    """Estimates radiance with the light that a cache knows.

    Where a ray meets a diffuse lobe, the light is looked up; what the cache does not know is estimated by
    path tracing for that lookup alone. Other lobes scatter the ray once, and the same is asked where it
    lands. With an empty cache ``seen`` plus ``scattered`` is a path tracer, and converges to what
    ``trace`` does.

    Parameters
    ----------
    renderer
    """

    def __init__(self, renderer: LobeRenderer) -> None:
        self._renderer = renderer

        def state() -> Any:
            return renderer.state

        self._meet = recorded(self._meet_kernel, state)
        self._look_up = recorded(_look_up_kernel, lambda: None)
        self._go_on = recorded(self._go_on_kernel, state)
        self._gather = recorded(self._gather_kernel, state)
        self._estimate = recorded(self._estimate_kernel, state)
        self._finish = recorded(self._finish_kernel, state)

    def seen(
        self, view: LightCache, cache: LightCache, rays: Rays, rng: Any, *, pixel_angle: float
    ) -> Samples:
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
        pixel_angle
            Of the camera, radians: what is seen sharply is cached in finer cells.

        Returns
        -------
        Samples
            Marked where the surface does more: there :meth:`scattered` must be asked.
        """
        step = self._meet(view, begun(rays, rng, CELL_PX * pixel_angle))
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
        *,
        pixel_angle: float,
    ) -> Samples:
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
        Samples
            In two layers, since each has a virtual image of its own: what is reflected, or comes through
            rough surfaces; and what comes straight through clear ones.
        """
        count = dr.width(rng.state)
        radiance = dr.zeros(Array3f, 2 * count)  # one layer after the other
        path = begun(rays, rng, CELL_PX * pixel_angle)
        self._follow(radiance, cache, path, 0, heard, square, transmitted_at=count)
        lane = dr.arange(UInt, count)
        return Samples(tuple(dr.gather(Array3f, radiance, lane + opaque(k * count)) for k in range(2)))

    def gathered(
        self,
        cache: LightCache,
        rays: Rays,
        rng: Any,
        square: Any,
        heard: Callable[[Estimates], None] | None = None,
        *,
        pixel_angle: float,
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
        dr.eval(square)  # for the same reason as in begun
        direct, step = self._gather(cache, begun(rays, rng, CELL_PX * pixel_angle), square)
        indirect = Array3f(step.sent)
        self._add_missing(indirect, cache, step, heard=heard)
        self._follow(indirect, cache, chosen(step.path, dr.compress(step.goes_on)), 1, heard)
        return Samples((direct, indirect))

    def _follow(
        self,
        radiance: Any,
        cache: LightCache,
        path: Path,
        bounce: int,
        heard: Callable[[Estimates], None] | None,
        square: Any = None,
        transmitted_at: int = 0,
    ) -> None:
        """Add what paths find on their way from lobe to lobe, of which some bounces lie behind them.

        The numbers of the first of these bounces may be given, by lane. What comes through clear surfaces is
        added so many lanes further on.
        """
        # What is seen in a mirror is smoothed over cells; where light comes from needs no smoothing.
        jitter = 1.0 if bounce == 0 else 0.0
        while bounce < BOUNCES and dr.width(path.lane):
            # The first bounce off what is seen counts; then faint paths are ended at random.
            least = 1.0 if bounce == 0 else LEAST_CHANCE
            first = None if square is None else dr.gather(Array4f, square, path.lane)
            dr.eval(first)
            square = None
            direct, step = self._go_on(cache, path, opaque(least), first, opaque(transmitted_at))
            scatter_add(radiance, direct, path.lane)
            scatter_add(radiance, step.sent, step.path.lane)
            self._add_missing(radiance, cache, step, jitter=jitter, heard=heard)
            path = chosen(step.path, dr.compress(step.goes_on))
            bounce += 1
        if dr.width(path.lane):
            scatter_add(radiance, self._finish(path), path.lane)

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
            lanes, is_real = padded(missing)
            spot, rng = dr.gather(_Spot, step.spot, lanes), dr.gather(PCG32, path.rng, lanes)
            dr.eval(spot, rng)
            found, is_missing = self._look_up(further, spot, rng, opaque(jitter))
            scatter_add(radiance, dr.select(is_real, found, 0.0), dr.gather(UInt, path.lane, lanes))
            still: Any = dr.compress(is_missing & is_real)
            missing = dr.gather(UInt, lanes, still)
        if not dr.width(missing):
            return
        unknown = chosen(path, missing)
        weight, light, keys, rng = self._estimate(unknown)
        scatter_add(radiance, weight * light, unknown.lane)
        if heard:
            _tell(heard, keys, light, dr.width(missing))
        # The paths go on with other random numbers than the estimates were made with.
        lanes, is_real = padded(missing)
        dr.scatter(path.rng.state, rng.state, lanes, is_real)

    def _meet_kernel(self, cache: LightCache, path: Path) -> _Step:
        emitted, step = self._met(cache, path)
        return replace(step, sent=emitted + step.sent)

    def _met(self, cache: LightCache, path: Path) -> tuple[Any, _Step]:
        """What is emitted where rays meet a surface; and what it scatters, as far as that is known."""
        point = self._renderer.intersect(path.rays, path.bounce, path.carries)
        albedo = point.surfaces.albedo
        is_diffuse = point.surfaces.is_hit & (dr.max(albedo) > MIN_DIFFUSE_ALBEDO)
        spot = _Spot(
            position=point.position,
            normal=point.surfaces.normal,
            shape_index=point.surfaces.shape_index,
            width=path.width_at(point),
            weight=dr.select(is_diffuse, path.throughput * albedo, 0.0),
        )
        sent, is_missing = _known(cache, spot)
        step = _Step(sent, is_missing, Bool(point.has_specular), path, spot)
        # Where a lobe sends nothing, its direction is none, and so may be what the environment emits there.
        return Array3f(dr.select(path.carries, path.throughput * point.emission, 0.0)), step

    def _go_on_kernel(
        self, cache: LightCache, path: Path, least: Any, square: Any, transmitted_at: Any
    ) -> tuple[Any, _Step]:
        """Scatter off the surface that the rays meet, and meet the next."""
        rng = PCG32(path.rng)
        point = self._renderer.intersect(path.rays, path.bounce, path.carries)
        sample = self._renderer.sample_specular(point, rng if square is None else Leading(square, rng))
        throughput = path.throughput * sample.throughput
        chance = dr.clip(BRIGHT * dr.max(dr.abs(throughput)), least, 1.0)
        is_alive = sample.is_alive & (rng.next_float32() < chance)
        blur = dr.select(sample.bounce.is_delta, 0.0, CELL_BLUR * dr.rsqrt(sample.bounce.pdf))
        ahead = Path(
            lane=_layered(path, point, sample, transmitted_at),
            rays=sample.rays,
            bounce=sample.bounce,
            throughput=Array3f(dr.select(is_alive, throughput / chance, 0.0)),
            width=path.width_at(point),
            spread=dr.maximum(path.spread, blur),
            rng=rng,
        )
        emitted, step = self._met(cache, ahead)
        return Array3f(path.throughput * sample.direct), replace(step, sent=emitted + step.sent)

    def _gather_kernel(self, cache: LightCache, path: Path, square: Any) -> tuple[Any, _Step]:
        """Scatter off the diffuse lobe that the rays meet, and meet the next surface."""
        rng = PCG32(path.rng)
        point = self._renderer.intersect(path.rays, path.bounce, path.carries, opaque_only=True)
        lobe = self._renderer.sample_diffuse(point, Leading(square, rng))
        ahead = Path(
            lane=path.lane,
            rays=lobe.rays,
            bounce=lobe.bounce,
            throughput=Array3f(dr.select(lobe.is_alive, lobe.throughput, 0.0)),
            width=path.width_at(point),
            spread=dr.maximum(path.spread, GATHER_BLUR),
            rng=rng,
        )
        emitted, step = self._met(cache, ahead)
        return Array3f(lobe.direct + emitted), step

    def _estimate_kernel(self, path: Path) -> tuple[Any, Any, tuple[Any, ...], Any]:
        """Light where rays meet a surface, by path tracing, with its weight in the image and its cells."""
        rng = PCG32(path.rng)
        point = self._renderer.intersect(path.rays, path.bounce, path.carries)
        width = path.width_at(point)
        direct, indirect = self._renderer.estimate_diffuse(point, rng, path_depth=2 if path.bounce else 1)
        light = Array3f(direct + indirect)
        at = point.position, point.surfaces.normal, point.surfaces.shape_index, width
        keys = tuple(cell_key(*at, level) for level in range(LEVELS))
        return Array3f(path.throughput * point.surfaces.albedo), light, keys, rng

    def _finish_kernel(self, path: Path) -> Any:
        """What the other lobes of the surfaces that rays meet send, by path tracing."""
        rng = PCG32(path.rng)
        point = self._renderer.intersect(path.rays, path.bounce, path.carries)
        direct, indirect = self._renderer.estimate_specular(point, rng, path_depth=MAX_PATH_DEPTH)
        return Array3f(path.throughput * (direct + indirect))


def _tell(heard: Callable[[Estimates], None], keys: tuple[Any, ...], light: Any, count: int) -> None:
    values = rows(light)[:count]
    for key in keys:
        heard(Estimates.of(np.array(key)[:count], values))


def _layered(path: Path, point: ShadingPoint, sample: BsdfSample, transmitted_at: Any) -> Any:
    """Where the light of paths goes that are scattered on: what comes through clear surfaces, apart; UInt.

    What one pane lets through and another reflects, or the other face of the same, is a reflection; total
    reflection inside of glass, where nothing else is possible, is not.
    """
    normal, bounce = point.surfaces.normal, sample.bounce
    is_through = dr.dot(normal, path.rays.direction) * dr.dot(normal, sample.rays.direction) > 0.0
    if path.bounce is None:
        return path.lane + dr.select(bounce.is_delta & is_through, transmitted_at, 0)
    is_clear = bounce.is_delta & (point.surfaces.surface == int(SurfaceClass.TRANSPARENT))
    is_back = is_clear & ~is_through & (bounce.pdf < 1.0) & (path.lane >= transmitted_at)
    return path.lane - dr.select(is_back, transmitted_at, 0)


def _known(cache: LightCache, spot: _Spot) -> tuple[Any, Any]:
    """What diffuse lobes send, and where it is not known."""
    found, is_known = cache.find(spot.position, spot.normal, spot.shape_index)
    return Array3f(dr.select(is_known, spot.weight * found, 0.0)), Bool(~is_known & spot.counts)


def _look_up_kernel(cache: LightCache, spot: _Spot, rng: Any, jitter: Any) -> tuple[Any, Any]:
    """What diffuse lobes send by pages and cells, and where it is not known."""
    sent, is_missing = _known(cache, spot)
    if cache.cells:
        rng = PCG32(rng)
        rng.state ^= UNRELATED
        moved = Array3f(rng.next_float32(), rng.next_float32(), rng.next_float32())
        moved = 0.5 + jitter * (moved - 0.5)
        light, is_in_cell = cache.cells.find(spot.position, spot.normal, spot.shape_index, spot.width, moved)
        sent = dr.select(is_missing & is_in_cell, spot.weight * light, sent)
        is_missing &= ~is_in_cell
    return sent, is_missing
