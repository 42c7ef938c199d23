"""Queries of the irradiance cache at the vertices of paths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from enfilade.arrays import Array3f, Bool
from enfilade.methods.decoupled.irradiance_cache import IrradianceCache

__all__ = ["CacheQuery", "query_further", "query_view"]

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
    sharp : tuple of Array3f
        Irradiance over pi by emitters with sharp shadows, where the images of the cache are without it.
    """

    position: Any
    normal: Any
    shape_index: Any
    width: Any
    weight: Any
    sharp: Any

    @property
    def is_needed(self) -> Any:
        """Whether irradiance contributes at all; Bool."""
        return dr.max(dr.abs(self.weight)) > 0.0


def query_view(cache: IrradianceCache, query: CacheQuery) -> tuple[Any, Any]:
    """Diffuse reflection of irradiance cached in the camera's view, and where that is missing."""
    return _reflected(query, *cache.lookup_in_view(query.position, query.normal, query.shape_index))


def query_further(cache: IrradianceCache, query: CacheQuery, sampler: Any, jitter: Any) -> tuple[Any, Any]:
    """Diffuse reflection of irradiance from the images, then from the hash grid; and where both miss."""
    reflected, is_miss = _reflected(query, *cache.lookup(query.position, query.normal, query.shape_index))
    if cache.hash_grid:
        # Jitter the position, so that many lookups interpolate.
        sampler = sampler.fork(STREAM_SALT)
        offset = Array3f(*sampler.next_2d(), sampler.next_1d())
        offset = 0.5 + jitter * (offset - 0.5)

        # Look up where the images miss.
        irradiance, is_found = cache.hash_grid.lookup(
            query.position, query.normal, query.shape_index, query.width, offset
        )
        reflected = dr.select(is_miss & is_found, query.weight * irradiance, reflected)
        is_miss &= ~is_found
    return reflected, is_miss


def _reflected(query: CacheQuery, irradiance: Any, is_known: Any) -> tuple[Any, Any]:
    reflected = dr.select(is_known, query.weight * sum(query.sharp, irradiance), 0.0)
    return Array3f(reflected), Bool(~is_known & query.is_needed)
