"""The kernels of the integrator: each extends or ends paths by one vertex, and is recorded once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from enfilade.arrays import Array3f, Bool, UInt, opaque
from enfilade.kernels.guiding import PathGuide
from enfilade.kernels.replay import recorded
from enfilade.methods.decoupled.cache_query import CacheQuery, query_further, query_hash_grid, query_view
from enfilade.methods.decoupled.guiding import trace_probes
from enfilade.methods.decoupled.hash_grid import LEVELS, entry_key
from enfilade.methods.decoupled.irradiance_cache import IrradianceCache
from enfilade.methods.decoupled.path_depth import weight_after
from enfilade.methods.decoupled.paths import Path
from enfilade.methods.decoupled.surface_image import UploadedImage, lookup
from enfilade.methods.decoupled.virtual_images import MAX_INTERFACES
from enfilade.records import MIN_DIFFUSE_ALBEDO, SurfaceClass
from enfilade.renderer import MAX_PATH_DEPTH, Branch, BsdfSample, LobeRenderer, ShadingPoint

# Bounces off specular lobes, after which paths are path traced to their end. A broad lobe counts as several.
MAX_BOUNCES = MAX_INTERFACES
BROAD_BOUNCES = 3
# Russian roulette: paths survive with this times their throughput after the next bounce, if below one.
ROULETTE_GAIN = 20.0
MIN_SURVIVAL = 0.05  # least probability of survival
# Width of a hash grid entry: in pixels where a surface is seen sharply; as a part of the lobe's width where
# it is seen through a lobe; as a part of the distance where it lights a diffuse surface.
ENTRY_PX = 2.0
ENTRY_LOBE_WIDTH = 0.25
ENTRY_GATHER_WIDTH = 0.1
BELOW_TOTAL = 1.0 - 2.0**-16  # probability from which on a reflection is total; GPUs may round one down
AOV_COSINE = 0.97  # between normals: specular AOVs of surfaces that differ by more are not looked up
BRANCH_SALT = 0x2545F491  # gives the branches of a path random numbers of their own
SHARP_SALT = 0xD1342543  # makes shadow rays independent of the path's random numbers
ROULETTE_SALT = 0x9FB21C65  # likewise Russian roulette
ESTIMATE_SALT = 0xAF251AF3  # likewise the paths that estimate irradiance


@dataclass(frozen=True)
class Vertex:
    """A vertex of paths, as lanes.

    Attributes
    ----------
    radiance : Array3f
        Contribution to the pixel sample: emitted, and reflected by the diffuse lobe as far as it is cached.
    is_miss : Bool
        Where irradiance is needed and was not found.
    has_specular : Bool
        Where there are other lobes.
    onward : Array3f
        Throughput with which the path goes on from these; 0 where Russian roulette ends it.
    path : Path
        On its way to the vertex.
    query : CacheQuery
    unoccluded : tuple of Array3f
        Of camera rays: the query's irradiance by sharp emitters, without occluders.
    """

    radiance: Any
    is_miss: Any
    has_specular: Any
    onward: Any
    path: Path
    query: CacheQuery
    unoccluded: tuple[Any, ...] = ()


class PathKernels:
    """Recorded kernels; they are replayed for every frame.

    Parameters
    ----------
    renderer

    Attributes
    ----------
    probe
        Light on visible surfaces, and where it comes from.
    see
        Camera rays, and the irradiance in their view.
    see_tint
        Camera rays, and the tint of specular lobes.
    see_aovs
        Camera rays, and filtered specular AOVs.
    extend
        A bounce off specular lobes.
    gather
        A bounce off the diffuse lobe.
    find_entries
        Keys in the hash grid.
    query_further
        The rest of the cache.
    sharp_light
        Irradiance by emitters that cast sharp shadows.
    estimate
        Path traced irradiance.
    terminate
        Path traced specular lobes.
    """

    def __init__(self, renderer: LobeRenderer) -> None:
        self._renderer = renderer
        # As data: scenes that differ in it alone share their kernels.
        self._max_depth = max_depth = opaque(renderer.max_path_depth())

        def state() -> Any:
            return renderer.state(), max_depth

        self.probe = recorded(lambda guide, path: trace_probes(renderer, guide, path), state)
        self.see = recorded(self._see, state)
        self.see_tint = recorded(self._see_tint, state)
        self.see_aovs = recorded(self._see_aovs, state)
        self.query_further = recorded(query_further, lambda: None)
        self.extend = recorded(self._extend, state)
        self.gather = recorded(self._gather, state)
        self.find_entries = recorded(self._find_entries, state)
        self.sharp_light = recorded(self._sharp_light, state)
        self.estimate = recorded(self._estimate, state)
        self.terminate = recorded(self._terminate, state)

    def _see(self, cache: IrradianceCache, path: Path) -> Vertex:
        """Camera rays: intersect, and query the cache."""
        emitted, vertex = self._intersect(cache, path)
        return replace(vertex, radiance=emitted + vertex.radiance)

    def _see_tint(self, path: Path) -> tuple[Any, Any]:
        """Camera rays: intersect, and evaluate the tint of specular lobes; whether it is a texture's."""
        return self._renderer.specular_tint(self._renderer.intersect(path.rays, path.bounce, path.is_active))

    def _see_aovs(self, aovs: UploadedImage, unit: Any, path: Path) -> tuple[Any, ...]:
        """Camera rays: intersect, and look up the AOVs; whether they miss a surface with specular lobes."""
        point = self._renderer.intersect(path.rays, path.bounce, path.is_active)
        at = point.position, point.surfaces.normal, point.surfaces.shape_index
        found = lookup(*at, aovs, min_cosine=AOV_COSINE)
        is_found = (found.weight > 0.0) & ~point.may_pass  # what is seen through it changes with its opacity
        scale = dr.select(is_found & point.has_specular, unit * dr.rcp(dr.maximum(found.weight, 1e-12)), 0.0)
        return *(Array3f(total * scale) for total in found.totals), Bool(point.has_specular & ~is_found)

    def _intersect(self, cache: IrradianceCache, path: Path) -> tuple[Any, Vertex]:
        """Emission at the next surface, and the vertex there, with its cached diffuse reflection."""
        point = self._renderer.intersect(path.rays, path.bounce, path.is_active)
        albedo = point.surfaces.albedo
        is_diffuse = point.surfaces.is_hit & (dr.max(albedo) > MIN_DIFFUSE_ALBEDO)
        sharp: tuple[Any, ...] = ()
        unoccluded: tuple[Any, ...] = ()
        is_seen = path.bounce is None
        direct = self._renderer.coat_emission(point) if is_seen else Array3f(0)
        if cache.soft_only:  # the camera sees the highlights of sharp emitters, too
            sampler = path.sampler.fork(SHARP_SALT)
            light = self._renderer.sharp_light(point, sampler, specular=is_seen)
            sharp, direct = (light.diffuse,), direct + light.specular
            unoccluded = (light.unoccluded,) if is_seen else ()
        query = CacheQuery(
            position=point.position,
            normal=point.surfaces.normal,
            shape_index=path.shape_at(point.surfaces),
            width=path.width_at(point),
            weight=dr.select(is_diffuse, path.throughput * albedo * self._lit(path), 0.0),
            depth=path.depth,
            sharp=sharp,
        )
        reflected, is_miss = query_view(cache, query)
        onward = _surviving(path, point)
        vertex = Vertex(reflected, is_miss, Bool(point.has_specular), onward, path, query, unoccluded)
        # Where a lobe absorbs the path, its direction is undefined, and so may be the environment's emission.
        emitted = dr.select(path.is_active, path.throughput * (point.emission + direct), 0.0)
        return Array3f(emitted), vertex

    def _extend(
        self,
        cache: IrradianceCache,
        path: Path,
        transmitted_at: Any,
    ) -> tuple[Any, Any, Any, Vertex]:
        """Scatter off a specular lobe at the next surface, and intersect the one after.

        Returns the radiance of next-event estimates, whether the path has another branch, whether it has as
        many bounces as are followed, and the vertex.
        """
        sampler = path.sampler.fork(BRANCH_SALT * path.branch)

        # Intersect, and sample a specular lobe.
        point = self._renderer.intersect(path.rays, path.bounce, path.is_active)
        soft_only = cache.soft_only and path.bounce is None  # the rest is in the diffuse image
        sample = self._renderer.sample_specular(point, sampler, branch=path.branch, soft_only=soft_only)

        # End it at the scene's limit; Mitsuba's `volpath` does not count null interactions.
        depth = path.depth + dr.select(sample.is_passed, UInt(0), UInt(1))
        is_alive = sample.is_alive & (depth < self._max_depth)

        # Extend the path; a broad lobe widens it.
        is_narrow = sample.bounce.is_delta | sample.is_passed
        lobe_width = dr.select(is_narrow, 0.0, ENTRY_LOBE_WIDTH * dr.rsqrt(sample.bounce.pdf))
        extended = Path(
            lane=_aov_lane(path, point, sample, transmitted_at),
            rays=sample.rays,
            bounce=sample.bounce,
            throughput=Array3f(dr.select(is_alive, path.throughput * sample.throughput, 0.0)),
            width=path.width_at(point),
            spread=dr.maximum(path.spread, lobe_width),
            sampler=sampler,
            bounces=path.bounces + dr.select(sample.is_image | sample.is_passed, UInt(1), BROAD_BOUNCES),
            depth=depth,
            branch=path.branch,
            is_within=path.is_within_after(sample),
        )

        # Query the cache at the next vertex.
        emitted, vertex = self._intersect(cache, extended)
        if path.bounce is None:  # the camera sees it in coats
            emitted = dr.select(point.is_coated, 0.0, emitted)
        vertex = replace(vertex, radiance=emitted + vertex.radiance)
        is_split = sample.is_split & path.is_active & (path.branch == int(Branch.REFLECTED))
        is_end = extended.bounces >= MAX_BOUNCES
        direct = Array3f(path.throughput * sample.direct * self._lit(path))
        return direct, Bool(is_split), Bool(is_end), vertex

    def _gather(self, cache: IrradianceCache, path: Path) -> tuple[Any, Vertex]:
        """Scatter off the diffuse lobe of the surface of the G-buffer, and intersect the one after.

        Emitters with sharp shadows are estimated apart.
        """
        sampler = path.sampler.copy()

        # Intersect, and sample the diffuse lobe.
        point = self._renderer.intersect(path.rays, path.bounce, path.is_active, opaque_only=True)
        sample = self._renderer.sample_diffuse(point, sampler, soft_only=True, guide=cache.path_guide)

        # Extend the path.
        extended = Path(
            lane=path.lane,
            rays=sample.rays,
            bounce=sample.bounce,
            throughput=Array3f(dr.select(sample.is_alive, sample.throughput, 0.0)),
            width=path.width_at(point),
            spread=dr.maximum(path.spread, ENTRY_GATHER_WIDTH),
            sampler=sampler,
            bounces=path.bounces + 1,
            depth=path.depth + 1,
            branch=path.branch,
            is_within=path.is_within,
        )

        # Query the view, and at once the hash grid, which has most of what the camera does not see.
        emitted, vertex = self._intersect(cache, extended)
        reflected, is_miss = query_hash_grid(cache, vertex.query, vertex.is_miss)
        vertex = replace(vertex, radiance=vertex.radiance + reflected, is_miss=is_miss)
        return Array3f(sample.direct + emitted), vertex

    def _find_entries(self, cache: IrradianceCache, path: Path) -> tuple[tuple[Any, ...], Any, Any, Any]:
        """Keys of the hash grid's entries at the next surfaces of paths, and their irradiance in the images.

        Returns
        -------
        keys : tuple of UInt64
            One a level, and as many above as entries of the largest one need.
        irradiance : Array3f
            Over pi; 0 where the images do not show the surface.
        is_known, is_missing : Bool
            Whether a surface is diffuse, and in the images of the cache, or not.
        """
        point = self._renderer.intersect(path.rays, path.bounce, path.is_active)
        at = point.position, point.surfaces.normal, path.shape_at(point.surfaces)
        irradiance, is_known = cache.lookup(*at)
        is_diffuse = point.surfaces.is_hit & (dr.max(point.surfaces.albedo) > MIN_DIFFUSE_ALBEDO)
        is_diffuse &= path.is_active
        return (
            _keys(point, path, 2 * LEVELS),
            irradiance,
            Bool(is_diffuse & is_known),
            Bool(is_diffuse & ~is_known),
        )

    def _sharp_light(self, path: Path) -> Any:
        """Irradiance over pi at the next surface, by emitters that cast sharp shadows; Array3f."""
        point = self._renderer.intersect(path.rays, path.bounce, path.is_active)
        sharp = self._renderer.sharp_light(point, path.sampler.fork(SHARP_SALT)).diffuse
        return Array3f(dr.select(path.is_active, sharp, 0.0))

    def _estimate(
        self, guide: PathGuide | None, depth_weights: tuple[Any, Any], path: Path
    ) -> tuple[Any, tuple[Any, ...], tuple[Any, ...]]:
        """Path trace the irradiance at the next surface; also its weight, and its keys in the hash grid.

        It is that of all light, and without emitters that cast sharp shadows where the scene has any. Its
        paths begin at the first surface, or at the second, as those of the irradiance in the cache. The
        weight has what a ``max_depth`` leaves of it after further bounces.
        """
        sampler = path.sampler.fork(ESTIMATE_SALT)
        point = self._renderer.intersect(path.rays, path.bounce, path.is_active)
        path_depth = 2 if path.bounce else 1
        is_divided = self._renderer.has_sharp_light()
        light = self._renderer.estimate_diffuse(point, sampler, path_depth, guide, soft_only=is_divided)
        irradiance = [Array3f(sum(light))]
        if is_divided:
            sharp = self._renderer.sharp_light(point, path.sampler.fork(SHARP_SALT)).diffuse
            irradiance.insert(0, Array3f(irradiance[0] + sharp))
        scales = [weight_after(of, path.depth) for of in depth_weights[: len(irradiance)]]
        if path.bounce is None:  # in the hash grid it is that of a path after one bounce
            irradiance = [of * dr.rcp(scale) for of, scale in zip(irradiance, scales, strict=True)]
        weight = Array3f(path.throughput * point.surfaces.albedo * self._lit(path) * scales[0])
        return weight, tuple(irradiance), _keys(point, path)

    def _lit(self, path: Path) -> Any:
        """1 where the next surface may reflect light within the scene's limit of path depth, else 0."""
        return dr.select(path.depth + 1 < self._max_depth, 1.0, 0.0)

    def _terminate(self, path: Path) -> Any:
        """Path trace the specular lobes at the next surface to their end."""
        sampler = path.sampler.copy()
        point = self._renderer.intersect(path.rays, path.bounce, path.is_active)
        direct, indirect = self._renderer.estimate_specular(point, sampler, path_depth=MAX_PATH_DEPTH)
        return Array3f(path.throughput * (direct + indirect))


def _surviving(path: Path, point: ShadingPoint) -> Any:
    """Throughput of the paths that go on from specular lobes at their next surface; Array3f."""
    sampler = path.sampler.fork(ROULETTE_SALT)
    after = dr.max(dr.abs(path.throughput)) * point.specular_albedo
    survival = dr.clip(ROULETTE_GAIN * after, MIN_SURVIVAL, 1.0)
    is_onward = point.has_specular & (sampler.next_1d() < survival)
    return Array3f(dr.select(is_onward, path.throughput / survival, 0.0))


def _keys(point: ShadingPoint, path: Path, count: int = LEVELS + 1) -> tuple[Any, ...]:
    """Keys of the entries of a point, each of twice the size of the one before."""
    at = point.position, point.surfaces.normal, path.shape_at(point.surfaces), path.width_at(point)
    return tuple(entry_key(*at, level) for level in range(count))


def _aov_lane(path: Path, point: ShadingPoint, sample: BsdfSample, transmitted_at: Any) -> Any:
    """Lanes that receive the radiance of scattered paths: transmission has its own; UInt.

    Light that passes one pane and is reflected by another, or by the other face of the same, is a
    reflection; total internal reflection, to which there is no alternative, is not.
    """
    normal, bounce = point.surfaces.normal, sample.bounce
    is_through = dr.dot(normal, path.rays.direction) * dr.dot(normal, sample.rays.direction) > 0.0
    if path.bounce is None:
        return path.lane + dr.select(sample.is_image & is_through, transmitted_at, 0)
    is_clear = bounce.is_delta & (point.surfaces.surface == int(SurfaceClass.TRANSPARENT))
    is_back = is_clear & ~is_through & (bounce.pdf < BELOW_TOTAL) & (path.lane >= transmitted_at)
    return path.lane - dr.select(is_back, transmitted_at, 0)
