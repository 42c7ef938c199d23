"""Radiance along rays: exact surfaces and lobes, cached light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from enfilade.arrays import PCG32, Array3f, Bool, Float, UInt
from enfilade.irradiance.cache import LightCache
from enfilade.renderer import LightRenderer, Lit, Rays, Scattered

BOUNCES = 16  # most bounces off lobes before a path is given up
ROULETTE_FROM = 3  # bounce after which faint paths are ended at random
BLACK = 1e-4  # albedo below which no light is looked up


@dataclass(frozen=True)
class _Path:
    """A lane's path so far."""

    lane: Any  # UInt, where its light goes
    throughput: Any  # Array3f
    rng: Any  # PCG32


def shade(renderer: LightRenderer, cache: LightCache, rays: Rays, rng: Any) -> Any:
    """Estimate the radiance along camera rays.

    Where a ray meets a diffuse lobe, the light is looked up; what the cache does not know is estimated by
    path tracing for that lookup alone. Other lobes scatter the ray once, and the same is asked where it
    lands. With an empty cache this is a path tracer, and converges to what ``trace`` does.

    Parameters
    ----------
    renderer
    cache
    rays
        One a lane.
    rng : PCG32
        One generator a lane.

    Returns
    -------
    Array3f
    """
    count = dr.width(rng.state)
    radiance = dr.zeros(Array3f, count)
    lit = renderer.lit(rays)
    path = _Path(dr.arange(UInt, count), dr.full(Array3f, 1, count), rng)
    for bounce in range(BOUNCES):
        _add(radiance, path, _arriving(renderer, cache, lit, path))

        # Go on where there is a lobe: fewer lanes each time.
        going: Any = dr.compress(lit.has_lobe)
        if len(going) == 0:
            break
        path, lit = _chosen(path, going), dr.gather(Lit, lit, going)
        scattered = renderer.scatter(lit, path.rng)
        scattered, path = _bounced(scattered, path, bounce)
        _add(radiance, path, scattered.direct)
        alive: Any = dr.compress(scattered.is_alive)
        if len(alive) == 0:
            break
        path = _chosen(path, alive)
        scattered = dr.gather(Scattered, scattered, alive)
        path = _Path(path.lane, path.throughput * scattered.throughput, path.rng)
        lit = renderer.lit(scattered.rays, scattered)
    return radiance


def _arriving(renderer: LightRenderer, cache: LightCache, lit: Lit, path: _Path) -> Any:
    """Light that the hits themselves send: emitted, and scattered by their diffuse lobes."""
    surfaces = lit.surfaces
    albedo = surfaces.albedo
    is_diffuse = surfaces.is_hit & (dr.max(albedo) > BLACK)
    found, is_known = cache.find(lit.position, surfaces.normal, surfaces.item)
    sent = lit.emission + dr.select(is_diffuse & is_known, albedo * found, 0.0)
    is_missing = Bool(is_diffuse & ~is_known)
    dr.eval(sent, is_missing, lit, path)

    missing: Any = dr.compress(is_missing)
    if len(missing):
        there, generators = dr.gather(Lit, lit, missing), dr.gather(PCG32, path.rng, missing)
        estimated = dr.gather(Array3f, albedo, missing) * renderer.light(there, generators)
        dr.eval(estimated, generators)
        for target, value in zip(sent, estimated, strict=True):
            dr.scatter_add(target, value, missing)
        dr.scatter(path.rng.state, generators.state, missing)
    return sent


def _bounced(scattered: Scattered, path: _Path, bounce: int) -> tuple[Scattered, _Path]:
    """End faint paths at random, and evaluate."""
    alive = scattered.is_alive
    throughput = scattered.throughput
    if bounce >= ROULETTE_FROM:
        chance = dr.clip(dr.max(dr.abs(path.throughput * throughput)), 0.05, 1.0)
        alive &= path.rng.next_float32() < chance
        throughput = throughput / chance
    bounced = Scattered(scattered.rays, throughput, scattered.direct, Bool(alive), scattered.native)
    dr.eval(bounced, path)
    return bounced, path


def _chosen(path: _Path, lanes: Any) -> _Path:
    return _Path(
        lane=dr.gather(UInt, path.lane, lanes),
        throughput=dr.gather(Array3f, path.throughput, lanes),
        rng=dr.gather(PCG32, path.rng, lanes),
    )


def _add(radiance: Any, path: _Path, sent: Any) -> None:
    """Add to each lane's radiance; a lane has one path, so that the order does not matter."""
    for target, value in zip(radiance, path.throughput * sent, strict=True):
        dr.scatter_add(target, Float(value), path.lane)
    dr.eval(radiance)
