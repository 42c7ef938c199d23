"""The integrator: radiance along camera rays, with exact surfaces and specular lobes, and cached irradiance.

Where a ray meets a diffuse lobe, the irradiance is looked up; where the cache misses, it is path traced for
that lookup alone. Specular lobes extend the path by one bounce, and the same happens at the next surface.
With an empty cache, diffuse plus specular radiance converges to that of a path tracer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import PCG32, Array3f, Array4f, Bool, Float, UInt, UInt64, opaque, rows
from enfilade.kernels.estimate import Samples
from enfilade.kernels.random import PrefixedRng
from enfilade.kernels.replay import padded, recorded
from enfilade.methods.decoupled.cache_query import CacheQuery, query_further, query_images
from enfilade.methods.decoupled.hash_grid import LEVELS, Entries, entry_key
from enfilade.methods.decoupled.irradiance_cache import PLANE_TOLERANCE, IrradianceCache
from enfilade.methods.decoupled.lookup import UploadedImage, lookup
from enfilade.methods.decoupled.paths import (
    Contributions,
    Path,
    compact,
    joined,
    merged,
    scatter_add,
    spawn,
)
from enfilade.records import MIN_DIFFUSE_ALBEDO, SurfaceClass
from enfilade.renderer import MAX_PATH_DEPTH, Branch, BsdfSample, LobeRenderer, Rays, ShadingPoint

MAX_BOUNCES = MAX_PATH_DEPTH - 1  # off specular lobes; longer paths are path traced to their end
ROULETTE_GAIN = 4.0  # Russian roulette: a path survives with this times its throughput, if that is below one
SPECULAR_AOVS = 2  # reflection, transmission
MIN_SURVIVAL = 0.05  # least probability of survival
# Width of a hash grid entry: in pixels where a surface is seen sharply; as a part of the lobe's width where
# it is seen through a lobe; as a part of the distance where it lights a diffuse surface.
ENTRY_PX = 2.0
ENTRY_LOBE_WIDTH = 0.25
ENTRY_GATHER_WIDTH = 0.2
AOV_COSINE = 0.97  # between normals: specular AOVs of surfaces that differ by more are not looked up
BRANCH_SALT = 0x2545F4914F6CDD1D  # gives the branches of a path random numbers of their own
SHARP_SALT = 0xD1342543DE82EF95  # makes shadow rays independent of the path's random numbers
ESTIMATE_SALT = 0xAF251AF3B0F025B5  # likewise the paths that estimate irradiance

JITTER = 3.0  # range of lookups in the hash grid, in widths of an entry

OnMiss = Callable[[Entries], None]


@dataclass(frozen=True)
class _Vertex:
    """A vertex of paths, as lanes.

    Attributes
    ----------
    radiance : Array3f
        Contribution to the pixel sample: emitted, and reflected by the diffuse lobe as far as it is cached.
    is_miss : Bool
        Where irradiance is needed and was not found.
    has_specular : Bool
        Where there are other lobes.
    path : Path
        On its way to the vertex.
    query : CacheQuery
    """

    radiance: Any
    is_miss: Any
    has_specular: Any
    path: Path
    query: CacheQuery


@dataclass(frozen=True)
class _Missed:
    """Vertices whose irradiance the first lookup did not find, as lanes; padding needs none.

    Attributes
    ----------
    path
        That ends at the vertex.
    query
    jitter : Float
        Of lookups in the hash grid, in widths of an entry.
    """

    path: Path
    query: CacheQuery
    jitter: Any


@dataclass(frozen=True)
class _Deferred:
    """What is left to estimate when all paths are extended: all together, in few launches."""

    missed: list[_Missed] = field(default_factory=list)
    ends: list[Path] = field(default_factory=list)

    def add_missed(self, vertex: _Vertex, jitter: float = 0.0) -> None:
        """Add the vertices that miss the cache."""
        missing: Any = dr.compress(vertex.is_miss)
        if dr.width(missing):
            lanes, is_real = padded(missing)
            query = dr.gather(CacheQuery, vertex.query, lanes)
            query = replace(query, weight=dr.select(is_real, query.weight, 0.0))
            missed = _Missed(compact(vertex.path, missing), query, dr.full(Float, jitter, dr.width(lanes)))
            dr.eval(missed)
            self.missed.append(missed)


class Integrator:
    """Estimates radiance with cached irradiance. Its kernels are recorded once and replayed for every frame.

    Parameters
    ----------
    renderer
    """

    def __init__(self, renderer: LobeRenderer) -> None:
        self._renderer = renderer

        def state() -> Any:
            return renderer.state

        self._see = recorded(self._see_kernel, state)
        self._see_aovs = recorded(self._see_aovs_kernel, state)
        self._query_further = recorded(query_further, lambda: None)
        self._extend = recorded(self._extend_kernel, state)
        self._gather = recorded(self._gather_kernel, state)
        self._estimate = recorded(self._estimate_kernel, state)
        self._terminate = recorded(self._terminate_kernel, state)

    def diffuse_radiance(
        self,
        reprojected: IrradianceCache,
        cache: IrradianceCache,
        rays: Rays,
        rng: Any,
        *,
        pixel_angle: float,
    ) -> Samples:
        """Radiance that visible surfaces emit, and reflect by their diffuse lobes.

        Parameters
        ----------
        reprojected
            Queried first: irradiance reprojected to the view of these rays.
        cache
            Queried where `reprojected` misses.
        rays
            From the camera, one a lane.
        rng : PCG32
            One generator a lane.
        pixel_angle
            Of the camera, radians.

        Returns
        -------
        Samples
            Marked where the surface has specular lobes, for :meth:`specular_radiance`.
        """
        vertex = self._see(reprojected, spawn(rays, rng, ENTRY_PX * pixel_angle))
        radiance, deferred = Array3f(vertex.radiance), _Deferred()
        deferred.add_missed(vertex, JITTER)
        for found, lane in self._missed_light(cache, deferred):
            scatter_add(radiance, found, lane)
        return Samples((radiance,), vertex.has_specular)

    def specular_radiance(
        self,
        cache: IrradianceCache,
        rays: Rays,
        rng: Any,
        qmc_point: Any,
        on_miss: OnMiss | None = None,
        *,
        pixel_angle: float,
    ) -> Samples:
        """Radiance that visible surfaces reflect and transmit by their specular lobes.

        Parameters
        ----------
        cache
        rays
            From the camera, one a lane.
        rng : PCG32
            One generator a lane.
        qmc_point : Array4f
            Quasi-Monte Carlo point in [0, 1)^4: chooses the first lobe and its direction.
        on_miss
            Receives the irradiance that was not cached and had to be estimated.
        pixel_angle
            Of the camera, radians.

        Returns
        -------
        Samples
            Two AOVs, each of which has its own virtual image: reflection (with transmission through rough
            surfaces), and transmission straight through clear surfaces.
        """
        path = spawn(rays, rng, ENTRY_PX * pixel_angle)
        return Samples(self._reflected(cache, path, qmc_point, on_miss))

    def specular_radiance_at_edges(
        self,
        aovs: UploadedImage,
        cache: IrradianceCache,
        rays: Rays,
        rng: Any,
        qmc_point: Any,
        *,
        pixel_angle: float,
    ) -> Samples:
        """The same from filtered AOVs of the pixels' centres; traced where these do not show the surface.

        Parameters
        ----------
        aovs
            Both AOVs of the surfaces at pixel centres, without the pixels whose values are to be traced.
        cache, rays, rng, qmc_point, pixel_angle
            As of :meth:`specular_radiance`.

        Returns
        -------
        Samples
        """
        path = spawn(rays, rng, ENTRY_PX * pixel_angle)
        *found, is_missing = self._see_aovs(aovs, path)
        missing = compact(path, dr.compress(is_missing))
        if not dr.width(missing.lane):
            return Samples(tuple(found))
        traced = self._reflected(cache, missing, qmc_point, count=dr.width(path.lane))
        return Samples(tuple(have + more for have, more in zip(found, traced, strict=True)))

    def _reflected(
        self,
        cache: IrradianceCache,
        path: Path,
        qmc_point: Any,
        on_miss: OnMiss | None = None,
        count: int | None = None,
    ) -> tuple[Any, ...]:
        """Radiance of both specular AOVs by lane, of `count` lanes, from camera paths."""
        count = count or dr.width(path.lane)
        light, deferred = Contributions(), _Deferred()

        # Bounce off the visible surface: all paths, then the other branch at clear interfaces.
        onward = []
        while dr.width(path.lane):
            ahead, path = self._bounce(
                light, cache, path, deferred, dr.gather(Array4f, qmc_point, path.lane), transmitted_at=count
            )
            onward.append(ahead)

        # Follow the paths that meet another specular lobe.
        self._trace_specular(light, cache, merged(onward), deferred, transmitted_at=count)
        self._finish(light, cache, deferred, on_miss)
        radiance = light.summed(SPECULAR_AOVS * count)  # one AOV after the other
        lane = dr.arange(UInt, count)
        return tuple(dr.gather(Array3f, radiance, lane + opaque(k * count)) for k in range(SPECULAR_AOVS))

    def final_gather(
        self,
        cache: IrradianceCache,
        rays: Rays,
        rng: Any,
        qmc_point: Any,
        on_miss: OnMiss | None = None,
        *,
        pixel_angle: float,
    ) -> Samples:
        """Irradiance over pi at visible surfaces, by next-event estimation and one bounce into the cache.

        Parameters
        ----------
        cache, rays, rng, on_miss, pixel_angle
            As of :meth:`specular_radiance`.
        qmc_point : Array4f
            Quasi-Monte Carlo point in [0, 1)^4: chooses a point on an emitter, and a direction.

        Returns
        -------
        Samples
            Two layers: by light straight from emitters, without those that cast sharp shadows; and by all
            other.
        """
        dr.eval(qmc_point)  # see `spawn`
        direct, vertex = self._gather(cache, spawn(rays, rng, ENTRY_PX * pixel_angle), qmc_point)
        light, deferred = Contributions(), _Deferred()
        if cache.images:  # an empty cache leaves a literal zero, whose size a recorded kernel does not adapt
            light.add(vertex.radiance, vertex.path.lane)
        deferred.add_missed(vertex)
        onward = compact(vertex.path, dr.compress(vertex.has_specular))
        self._trace_specular(light, cache, onward, deferred)
        self._finish(light, cache, deferred, on_miss)
        return Samples((direct, light.summed(dr.width(rng.state))))

    def _trace_specular(
        self,
        light: Contributions,
        cache: IrradianceCache,
        path: Path,
        deferred: _Deferred,
        transmitted_at: int = 0,
    ) -> None:
        """Follow paths from specular lobe to specular lobe: those of all bounces and branches together.

        Parameters
        ----------
        light
            Receives their contributions.
        cache
        path
            That have bounced at least once.
        deferred
            Receives what is left to estimate.
        transmitted_at
            Offset of the lanes that receive transmission through clear surfaces.
        """
        while dr.width(path.lane):
            path = merged(self._bounce(light, cache, path, deferred, None, transmitted_at))

    def _bounce(
        self,
        light: Contributions,
        cache: IrradianceCache,
        path: Path,
        deferred: _Deferred,
        qmc_point: Any,
        transmitted_at: int,
    ) -> tuple[Path, Path]:
        """Extend all paths by one bounce off a specular lobe.

        Parameters
        ----------
        light, cache, path, deferred, transmitted_at
            As of :meth:`_trace_specular`.
        qmc_point : Array4f or None
            Of the first bounce, by path: chooses the lobe and its direction. None: pseudorandom.

        Returns
        -------
        onward : Path
            Paths that meet another specular lobe.
        other : Path
            Paths at clear interfaces, whose other branch is left to follow.
        """
        # Jitter smooths the hash grid's entries where they are seen, not where they light another surface.
        # The first bounce off the visible surface always survives; Russian roulette begins with the second.
        jitter, survival = (0.0, MIN_SURVIVAL) if qmc_point is None else (JITTER, 1.0)
        dr.eval(qmc_point)

        # Scatter, and add next-event estimates, emission and cached irradiance at the next vertex.
        direct, is_split, is_end, vertex = self._extend(
            cache, path, opaque(survival), qmc_point, opaque(transmitted_at)
        )
        light.add(direct, path.lane)
        light.add(vertex.radiance, vertex.path.lane)
        deferred.add_missed(vertex, jitter)

        # Divide the paths that go on.
        is_onward = vertex.has_specular & vertex.path.is_active
        ends = compact(vertex.path, dr.compress(is_onward & is_end))
        if dr.width(ends.lane):
            deferred.ends.append(ends)
        onward = compact(vertex.path, dr.compress(is_onward & ~is_end))
        other = compact(path, dr.compress(is_split))
        return onward.on_branch(Branch.REFLECTED), other.on_branch(Branch.TRANSMITTED)

    def _finish(
        self, light: Contributions, cache: IrradianceCache, deferred: _Deferred, on_miss: OnMiss | None
    ) -> None:
        """Add what was deferred, after a lookup in the images of the cache."""
        for found, lane in self._missed_light(IrradianceCache(hash_grid=cache.hash_grid), deferred, on_miss):
            light.add(found, lane)
        if deferred.ends:
            ends = joined(deferred.ends)
            dr.eval(ends)
            light.add(self._terminate(ends), ends.lane)

    def _missed_light(
        self, cache: IrradianceCache, deferred: _Deferred, on_miss: OnMiss | None = None
    ) -> list[tuple[Any, Any]]:
        """Diffuse reflection where no irradiance was found: from the rest of the cache, or estimated.

        Parameters
        ----------
        cache
            What was not queried yet.
        deferred
        on_miss

        Returns
        -------
        list of (Array3f, UInt)
            Contributions and their lanes.
        """
        if not deferred.missed:
            return []
        missed = joined(deferred.missed)
        dr.eval(missed)
        contributions = []
        is_miss = missed.query.is_needed

        # Query the cache.
        if cache.images or cache.hash_grid:
            found, is_miss = self._query_further(cache, missed.query, missed.path.rng, missed.jitter)
            contributions.append((found, missed.path.lane))

        # Path trace what is still missing.
        missing: Any = dr.compress(is_miss)
        if dr.width(missing):
            unknown = compact(missed.path, missing)
            weight, irradiance, keys = self._estimate(unknown)
            contributions.append((weight * irradiance, unknown.lane))
            if on_miss:
                _report(on_miss, keys, irradiance, dr.width(missing))
        return contributions

    def _see_kernel(self, cache: IrradianceCache, path: Path) -> _Vertex:
        """Camera rays: intersect, and query the cache."""
        emitted, vertex = self._intersect(cache, path)
        return replace(vertex, radiance=emitted + vertex.radiance)

    def _see_aovs_kernel(self, aovs: UploadedImage, path: Path) -> tuple[Any, ...]:
        """Camera rays: intersect, and look up the AOVs; whether they miss a surface with specular lobes."""
        point = self._renderer.intersect(path.rays, path.bounce, path.is_active)
        at = point.position, point.surfaces.normal, point.surfaces.shape_index
        found = lookup(*at, aovs, plane_tolerance=PLANE_TOLERANCE, min_cosine=AOV_COSINE)
        is_found = found.weight > 0.0
        scale = dr.select(is_found & point.has_specular, dr.rcp(dr.maximum(found.weight, 1e-12)), 0.0)
        return *(Array3f(total * scale) for total in found.totals), Bool(point.has_specular & ~is_found)

    def _intersect(
        self, cache: IrradianceCache, path: Path, *, soft_only: bool = False
    ) -> tuple[Any, _Vertex]:
        """Emission at the next surface, and the vertex there, with its cached diffuse reflection."""
        point = self._renderer.intersect(path.rays, path.bounce, path.is_active, soft_only=soft_only)
        albedo = point.surfaces.albedo
        is_diffuse = point.surfaces.is_hit & (dr.max(albedo) > MIN_DIFFUSE_ALBEDO)
        sharp: tuple[Any, ...] = ()
        if cache.is_soft:
            rng = PCG32(path.rng)
            rng.state ^= SHARP_SALT
            sharp = (self._renderer.sharp_light(point, rng),)
        query = CacheQuery(
            position=point.position,
            normal=point.surfaces.normal,
            shape_index=point.surfaces.shape_index,
            width=path.width_at(point),
            weight=dr.select(is_diffuse, path.throughput * albedo, 0.0),
            sharp=sharp,
        )
        reflected, is_miss = query_images(cache, query)
        vertex = _Vertex(reflected, is_miss, Bool(point.has_specular), path, query)
        # Where a lobe absorbs the path, its direction is undefined, and so may be the environment's emission.
        emitted = dr.select(path.is_active, path.throughput * point.emission, 0.0)
        return Array3f(emitted), vertex

    def _extend_kernel(
        self,
        cache: IrradianceCache,
        path: Path,
        min_survival: Any,
        qmc_point: Any,
        transmitted_at: Any,
    ) -> tuple[Any, Any, Any, _Vertex]:
        """Scatter off a specular lobe at the next surface, and intersect the one after.

        Returns the radiance of next-event estimates, whether the path has another branch, and whether it has
        as many bounces as are followed.
        """
        rng = PCG32(path.rng)
        rng.state ^= BRANCH_SALT * UInt64(path.branch)

        # Intersect, and sample a specular lobe.
        point = self._renderer.intersect(path.rays, path.bounce, path.is_active)
        sample = self._renderer.sample_specular(
            point, rng if qmc_point is None else PrefixedRng(qmc_point, rng), branch=path.branch
        )

        # Play Russian roulette.
        throughput = path.throughput * sample.throughput
        survival = dr.clip(ROULETTE_GAIN * dr.max(dr.abs(throughput)), min_survival, 1.0)
        is_alive = sample.is_alive & (rng.next_float32() < survival)

        # Extend the path; a broad lobe widens it.
        lobe_width = dr.select(sample.bounce.is_delta, 0.0, ENTRY_LOBE_WIDTH * dr.rsqrt(sample.bounce.pdf))
        extended = Path(
            lane=_aov_lane(path, point, sample, transmitted_at),
            rays=sample.rays,
            bounce=sample.bounce,
            throughput=Array3f(dr.select(is_alive, throughput / survival, 0.0)),
            width=path.width_at(point),
            spread=dr.maximum(path.spread, lobe_width),
            rng=rng,
            bounces=path.bounces + 1,
            branch=path.branch,
        )

        # Query the cache at the next vertex.
        emitted, vertex = self._intersect(cache, extended)
        vertex = replace(vertex, radiance=emitted + vertex.radiance)
        is_split = sample.is_split & path.is_active & (path.branch == int(Branch.REFLECTED))
        is_end = extended.bounces >= MAX_BOUNCES
        return Array3f(path.throughput * sample.direct), Bool(is_split), Bool(is_end), vertex

    def _gather_kernel(self, cache: IrradianceCache, path: Path, qmc_point: Any) -> tuple[Any, _Vertex]:
        """Scatter off the diffuse lobe of the visible surface, and intersect the next one."""
        rng = PCG32(path.rng)

        # Intersect, and sample the diffuse lobe.
        point = self._renderer.intersect(path.rays, path.bounce, path.is_active, opaque_only=True)
        sample = self._renderer.sample_diffuse(point, PrefixedRng(qmc_point, rng), soft_only=True)

        # Extend the path.
        extended = Path(
            lane=path.lane,
            rays=sample.rays,
            bounce=sample.bounce,
            throughput=Array3f(dr.select(sample.is_alive, sample.throughput, 0.0)),
            width=path.width_at(point),
            spread=dr.maximum(path.spread, ENTRY_GATHER_WIDTH),
            rng=rng,
            bounces=path.bounces + 1,
            branch=path.branch,
        )

        # Query the cache at the next vertex.
        emitted, vertex = self._intersect(cache, extended, soft_only=True)
        return Array3f(sample.direct + emitted), vertex

    def _estimate_kernel(self, path: Path) -> tuple[Any, Any, tuple[Any, ...]]:
        """Path trace the irradiance at the next surface; also its weight, and its keys in the hash grid.

        Its depth is that of a surface seen directly, or after one bounce, as of the irradiance in the cache:
        a finite ``--max-depth`` does not cut it shorter behind several mirrors.
        """
        rng = PCG32(path.rng)
        rng.state ^= ESTIMATE_SALT
        point = self._renderer.intersect(path.rays, path.bounce, path.is_active)
        width = path.width_at(point)
        direct, indirect = self._renderer.estimate_diffuse(point, rng, path_depth=2 if path.bounce else 1)
        irradiance = Array3f(direct + indirect)
        at = point.position, point.surfaces.normal, point.surfaces.shape_index, width
        keys = tuple(entry_key(*at, level) for level in range(LEVELS))
        return Array3f(path.throughput * point.surfaces.albedo), irradiance, keys

    def _terminate_kernel(self, path: Path) -> Any:
        """Path trace the specular lobes at the next surface to their end."""
        rng = PCG32(path.rng)
        point = self._renderer.intersect(path.rays, path.bounce, path.is_active)
        direct, indirect = self._renderer.estimate_specular(point, rng, path_depth=MAX_PATH_DEPTH)
        return Array3f(path.throughput * (direct + indirect))


def _report(on_miss: OnMiss, keys: tuple[Any, ...], irradiance: Any, count: int) -> None:
    values = rows(irradiance)[:count]
    for key in keys:
        on_miss(Entries.of(np.array(key)[:count], values))


def _aov_lane(path: Path, point: ShadingPoint, sample: BsdfSample, transmitted_at: Any) -> Any:
    """Lanes that receive the radiance of scattered paths: transmission has its own; UInt.

    Light that passes one pane and is reflected by another, or by the other face of the same, is a
    reflection; total internal reflection, to which there is no alternative, is not.
    """
    normal, bounce = point.surfaces.normal, sample.bounce
    is_through = dr.dot(normal, path.rays.direction) * dr.dot(normal, sample.rays.direction) > 0.0
    if path.bounce is None:
        return path.lane + dr.select(bounce.is_delta & is_through, transmitted_at, 0)
    is_clear = bounce.is_delta & (point.surfaces.surface == int(SurfaceClass.TRANSPARENT))
    is_back = is_clear & ~is_through & (bounce.pdf < 1.0) & (path.lane >= transmitted_at)
    return path.lane - dr.select(is_back, transmitted_at, 0)
