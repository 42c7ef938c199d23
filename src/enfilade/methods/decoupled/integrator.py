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
import numpy.typing as npt

from enfilade.arrays import Array3f, Float, UInt, opaque, rows
from enfilade.kernels.estimate import Samples
from enfilade.kernels.replay import padded
from enfilade.methods.decoupled.cache_query import CacheQuery
from enfilade.methods.decoupled.irradiance_cache import IrradianceCache
from enfilade.methods.decoupled.path_kernels import PathKernels, Vertex
from enfilade.methods.decoupled.paths import (
    Contributions,
    Path,
    compact,
    joined,
    merged,
    scatter_add,
)
from enfilade.methods.decoupled.surface_image import UploadedImage
from enfilade.methods.decoupled.virtual_images import MAX_INTERFACES
from enfilade.records import F32
from enfilade.renderer import MAX_PATH_DEPTH, Branch, LobeRenderer

SPECULAR_AOVS = 2  # reflection, transmission
JITTER = 1.0  # range of lookups in the hash grid, in widths of an entry: linear interpolation

# Receives keys by level, and one above, and irradiance over pi (N, 3 or 6), as of `Entries`.
OnMiss = Callable[[list[npt.NDArray[np.uint64]], F32], None]


@dataclass(frozen=True)
class _Missed:
    """Vertices without irradiance in the camera's view, as lanes; padding needs none.

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

    def add_missed(self, vertex: Vertex, jitter: float = 0.0) -> None:
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
    """Estimates radiance with cached irradiance.

    Parameters
    ----------
    renderer

    Attributes
    ----------
    irradiance_layers : int
        Of :meth:`gathered` and :meth:`path_traced`.
    """

    def __init__(self, renderer: LobeRenderer) -> None:
        self.kernels = PathKernels(renderer)
        self.irradiance_layers = 2 if renderer.has_sharp_light() else 1
        self._is_shallow = renderer.max_path_depth() < 2 * MAX_INTERFACES

    def diffuse_radiance(self, cache: IrradianceCache, path: Path, on_miss: OnMiss | None = None) -> Samples:
        """Radiance that visible surfaces emit, and reflect by their diffuse lobes.

        Includes specular highlights of sharp emitters where the cache excludes these emitters.

        Parameters
        ----------
        cache
        path
            From the camera, one a lane.
        on_miss
            Receives the irradiance that was not cached and had to be estimated.

        Returns
        -------
        Samples
            Marked where the surface has specular lobes, for :meth:`specular_radiance`. Two more
            layers where the cache excludes sharp emitters: irradiance by these over pi, with and without
            occluders.
        """
        vertex = self.kernels.see(cache, path)
        radiance, deferred = Array3f(vertex.radiance), _Deferred()
        deferred.add_missed(vertex, JITTER)
        for found, lane in self._missed_light(cache, deferred, on_miss):
            scatter_add(radiance, found, lane)
        sharp = (*vertex.query.sharp, *vertex.unoccluded)
        layers = (dr.select(vertex.query.is_needed, of, 0.0) for of in sharp)
        return Samples((radiance, *layers), vertex.has_specular)

    def specular_radiance(self, cache: IrradianceCache, path: Path, on_miss: OnMiss | None = None) -> Samples:
        """Radiance that visible surfaces reflect and transmit by their specular lobes.

        Without the highlights that :meth:`diffuse_radiance` has.

        Parameters
        ----------
        cache
        path
            From the camera, one a lane.
        on_miss
            Receives the irradiance that was not cached and had to be estimated.

        Returns
        -------
        Samples
            Two AOVs, each of which has its own virtual image: reflection (with transmission through rough
            surfaces), and transmission straight through clear surfaces.
        """
        # Pad the paths: a number of lanes that is the size of a scene's array changes a kernel's signature.
        count = dr.width(path.lane)
        return Samples(self._reflected(cache, compact(path, path.lane), count, on_miss))

    def specular_radiance_at_edges(
        self, aovs: UploadedImage, cache: IrradianceCache, path: Path, *, unit: float
    ) -> Samples:
        """The same from filtered AOVs of the pixels' centres; traced where these do not show the surface.

        Parameters
        ----------
        aovs
            Both AOVs of the surfaces at pixel centres, without the pixels whose values are to be traced.
        cache, path
            As of :meth:`specular_radiance`.
        unit
            Radiance that the AOVs store as 1.

        Returns
        -------
        Samples
        """
        *found, is_missing = self.kernels.see_aovs(aovs, opaque(unit), path)
        missing = compact(path, dr.compress(is_missing))
        if not dr.width(missing.lane):
            return Samples(tuple(found))
        traced = self._reflected(cache, missing, dr.width(path.lane))
        return Samples(tuple(have + more for have, more in zip(found, traced, strict=True)))

    def _reflected(
        self, cache: IrradianceCache, path: Path, count: int, on_miss: OnMiss | None = None
    ) -> tuple[Any, ...]:
        """Radiance of both specular AOVs by lane, of `count` lanes, from camera paths."""
        light, deferred = Contributions(SPECULAR_AOVS * count), _Deferred()  # one AOV after the other

        # Bounce off the visible surface: all paths, then the other branch at interfaces.
        onward = []
        while dr.width(path.lane):
            ahead, path = self._bounce(light, cache, path, deferred, transmitted_at=count)
            onward.append(ahead)

        # Follow the paths that meet another specular lobe.
        self._trace_specular(light, cache, merged(onward), deferred, transmitted_at=count)
        self._finish(light, cache, deferred, on_miss)
        radiance = light.summed()
        lane = dr.arange(UInt, count)
        return tuple(dr.gather(Array3f, radiance, lane + opaque(k * count)) for k in range(SPECULAR_AOVS))

    def final_gather(self, cache: IrradianceCache, path: Path, on_miss: OnMiss | None = None) -> Samples:
        """Irradiance over pi at visible surfaces, by next-event estimation and one bounce into the cache.

        Parameters
        ----------
        cache, path, on_miss
            As of :meth:`specular_radiance`.

        Returns
        -------
        Samples
            Two layers: by light straight from emitters, without next-event estimates of those that cast
            sharp shadows; and by all other.
        """
        return Samples(self._gathered(cache, path, dr.width(path.lane), on_miss))

    def gathered(self, cache: IrradianceCache, path: Path, count: int) -> Samples:
        """Irradiance over pi at the next surfaces of paths, as by :meth:`final_gather`.

        Parameters
        ----------
        cache
        path
            On their way to the surfaces; at most one a lane.
        count
            Number of lanes.

        Returns
        -------
        Samples
            Layers of all light, and without emitters that cast sharp shadows where the scene has any.
        """
        if not dr.width(path.lane):
            return Samples(tuple(dr.zeros(Array3f, count) for _ in range(self.irradiance_layers)))
        soft = Array3f(sum(self._gathered(cache, path, count)))
        if self.irradiance_layers == 1:
            return Samples((soft,))
        whole = Array3f(soft)
        scatter_add(whole, self.kernels.sharp_light(path), path.lane)
        return Samples((whole, soft))

    def path_traced(self, cache: IrradianceCache, path: Path, count: int) -> Samples:
        """The same, path traced; of the cache, the path guide is used."""
        found = tuple(dr.zeros(Array3f, count) for _ in range(self.irradiance_layers))
        if dr.width(path.lane):
            _, irradiance, _ = self.kernels.estimate(cache.path_guide, cache.depth_weights.of_entries, path)
            for layer, of in zip(found, irradiance, strict=True):
                scatter_add(layer, of, path.lane)
        return Samples(found)

    def _gathered(
        self, cache: IrradianceCache, path: Path, count: int, on_miss: OnMiss | None = None
    ) -> tuple[Any, Any]:
        """Both layers of :meth:`final_gather` by lane, of `count` lanes."""
        emitted, vertex = self.kernels.gather(cache, path)
        direct, light, deferred = dr.zeros(Array3f, count), Contributions(count), _Deferred()
        scatter_add(direct, emitted, path.lane)
        # An empty cache leaves a literal zero, whose size a recorded kernel does not adapt.
        if cache.view or cache.hash_grid:
            light.add_once(vertex.radiance, vertex.path.lane)
        deferred.add_missed(vertex)
        onward = replace(vertex.path, throughput=vertex.onward)
        onward = compact(onward, dr.compress(onward.is_active))
        self._trace_specular(light, cache, onward, deferred)
        self._finish(light, cache, deferred, on_miss)
        return direct, light.summed()

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
            path = merged(self._bounce(light, cache, path, deferred, transmitted_at))

    def _bounce(
        self,
        light: Contributions,
        cache: IrradianceCache,
        path: Path,
        deferred: _Deferred,
        transmitted_at: int,
    ) -> tuple[Path, Path]:
        """Extend all paths by one bounce off a specular lobe.

        Parameters
        ----------
        light, cache, path, deferred, transmitted_at
            As of :meth:`_trace_specular`.

        Returns
        -------
        onward : Path
            Paths that meet another specular lobe.
        other : Path
            Paths at interfaces, whose other branch is left to follow.
        """
        # Jitter smooths the hash grid's entries where they are seen, not where they light another surface.
        jitter = 0.0 if path.bounce else JITTER

        # Scatter, and add next-event estimates, emission and cached irradiance at the next vertex.
        direct, is_split, is_end, vertex = self.kernels.extend(cache, path, opaque(transmitted_at))
        add = light.add if path.bounce else light.add_once
        add(direct, path.lane)
        add(vertex.radiance, vertex.path.lane)
        deferred.add_missed(vertex, jitter)

        # Divide the paths that go on.
        survivors = replace(vertex.path, throughput=vertex.onward)
        is_onward = survivors.is_active
        ends = compact(survivors, dr.compress(is_onward & is_end))
        if dr.width(ends.lane):
            deferred.ends.append(ends)
        onward = compact(survivors, dr.compress(is_onward & ~is_end))
        other = compact(path, dr.compress(is_split))
        return onward.on_branch(Branch.REFLECTED), other.on_branch(Branch.TRANSMITTED)

    def _finish(
        self, light: Contributions, cache: IrradianceCache, deferred: _Deferred, on_miss: OnMiss | None
    ) -> None:
        """Add what was deferred; with `on_miss` the ends of paths are not wanted."""
        for found, lane in self._missed_light(cache, deferred, on_miss):
            light.add(found, lane)
        if deferred.ends and on_miss is None:
            ends = joined(deferred.ends)
            dr.eval(ends)
            if self._is_shallow:  # the rest of a deep path would be too long
                ends = compact(ends, dr.compress(ends.depth <= MAX_PATH_DEPTH))
            if dr.width(ends.lane):
                light.add(self.kernels.terminate(ends), ends.lane)

    def _missed_light(
        self, cache: IrradianceCache, deferred: _Deferred, on_miss: OnMiss | None = None
    ) -> list[tuple[Any, Any]]:
        """Diffuse reflection where the view has no irradiance: from the rest of the cache, or estimated.

        Parameters
        ----------
        cache, deferred, on_miss

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
            found, is_miss = self.kernels.query_further(
                cache, missed.query, missed.path.sampler, missed.jitter
            )
            contributions.append((found, missed.path.lane))

        # Path trace what is still missing.
        missing: Any = dr.compress(is_miss)
        if dr.width(missing):
            unknown = compact(missed.path, missing)
            weight, irradiance, keys = self.kernels.estimate(
                cache.path_guide, cache.depth_weights.of_entries, unknown
            )
            contributions.append((weight * irradiance[0], unknown.lane))
            if on_miss:
                count = dr.width(missing)
                light = np.hstack([rows(of)[:count] for of in irradiance])
                on_miss([np.array(key)[:count] for key in keys], light)
        return contributions
