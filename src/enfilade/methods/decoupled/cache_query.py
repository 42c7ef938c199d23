"""Queries of the irradiance cache at the vertices of paths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from enfilade.arrays import Array3f, Bool
from enfilade.methods.decoupled.irradiance_cache import IrradianceCache
from enfilade.methods.decoupled.path_depth import weight_after

STREAM_SALT = 0x9E3779B9  # makes the jitter of lookups independent of the path's random numbers


@dataclass(frozen=True)
class CacheQuery:
    """A point whose irradiance is looked up, as lanes.

    Attributes
    ----------
    position, normal : Array3f
    shape_index : UInt
    width : Float
        Of the path there, scene units.
    weight : Array3f
        Contribution of irradiance over pi to the pixel sample; 0 where there is no diffuse lobe.
    depth : UInt
        Bounces of the path before the point, as of :class:`Path`.
    sharp : tuple of Array3f
        Irradiance over pi by emitters with sharp shadows, where the cache is soft.
    """

    position: Any
    normal: Any
    shape_index: Any
    width: Any
    weight: Any
    depth: Any
    sharp: Any

    @property
    def is_needed(self) -> Any:
        """Whether irradiance contributes at all; Bool."""
        return dr.max(dr.abs(self.weight)) > 0.0


def query_view(cache: IrradianceCache, query: CacheQuery) -> tuple[Any, Any]:
    """Diffuse reflection of irradiance cached in the camera's view, and where that is missing."""
    return _reflected(cache, query, *cache.lookup_in_view(query.position, query.normal, query.shape_index))


def query_hash_grid(
    cache: IrradianceCache, query: CacheQuery, where: Any, offset: Any = None
) -> tuple[Any, Any]:
    """Diffuse reflection of irradiance from the hash grid alone, and which of some lanes miss it.

    Parameters
    ----------
    cache, query
    where : Bool
        Lanes that are looked up; of others the reflection is 0.
    offset : Array3f or None
        As of :meth:`HashGrid.lookup`.
    """
    if not cache.hash_grid:
        return Array3f(0), Bool(where)
    at = query.position, query.normal, query.shape_index, query.width
    irradiance, is_found = cache.hash_grid.lookup(*at, offset, where, soft_only=cache.soft_only)
    weights = cache.depth_weights.soft if cache.soft_only else cache.depth_weights.others
    scale = weight_after(weights, query.depth)
    reflected = query.weight * sum(query.sharp, scale * irradiance)
    return Array3f(dr.select(is_found, reflected, 0.0)), Bool(where & ~is_found)


def query_further(cache: IrradianceCache, query: CacheQuery, sampler: Any, jitter: Any) -> tuple[Any, Any]:
    """Diffuse reflection of irradiance from the images, then from the hash grid; and where both miss."""
    at = query.position, query.normal, query.shape_index
    reflected, is_miss = _reflected(cache, query, *cache.lookup(*at))

    # Jitter the position in the hash grid along the surface, so that many lookups interpolate.
    sampler = sampler.fork(STREAM_SALT)
    offset = jitter * (Array3f(*sampler.next_2d(), sampler.next_1d()) - 0.5)
    offset -= dr.dot(offset, query.normal) * query.normal
    from_grid, is_miss = query_hash_grid(cache, query, is_miss, 0.5 + offset)
    return Array3f(reflected + from_grid), is_miss


def _reflected(cache: IrradianceCache, query: CacheQuery, irradiance: Any, is_known: Any) -> tuple[Any, Any]:
    scale = weight_after(cache.depth_weights.images, query.depth)
    reflected = dr.select(is_known, query.weight * sum(query.sharp, scale * irradiance), 0.0)
    return Array3f(reflected), Bool(~is_known & query.is_needed)
