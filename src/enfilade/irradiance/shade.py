"""Radiance along camera rays: exact surfaces and lobes, cached light.

Tracing a kernel through all materials of a scene takes longer than running it on a frame's lanes: the
kernels are recorded once and replayed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from enfilade.arrays import PCG32, Array3f, Bool, Float, UInt
from enfilade.irradiance.cache import LightCache
from enfilade.renderer import Bounce, LightRenderer, Lit, Rays

BOUNCES = 16  # most bounces off lobes before a path is given up
ROULETTE_FROM = 1  # bounce after which faint paths are ended at random
LEAST_CHANCE = 0.05  # of a faint path to go on
BLACK = 1e-4  # albedo below which no light is looked up


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
    rng : PCG32
    """

    lane: Any
    rays: Rays
    bounce: Bounce | None
    throughput: Any
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
    has_lobe : Bool
    path : _Path
        On their way to the surface that was met.
    """

    sent: Any
    is_missing: Any
    has_lobe: Any
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
    """

    def __init__(self, renderer: LightRenderer) -> None:
        self._renderer = renderer
        self._meet = self._recorded(self._meet_kernel)
        self._look_up = self._recorded(self._look_up_kernel)
        self._go_on = self._recorded(self._go_on_kernel)
        self._estimate = self._recorded(self._estimate_kernel)

    def seen(self, view: LightCache, cache: LightCache, rays: Rays, rng: Any) -> tuple[Any, Any]:
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
        radiance : Array3f
        has_lobe : Bool
            Whether the surface does more: where :meth:`scattered` must be asked.
        """
        step = self._meet(view, self._begun(rays, rng))
        radiance = Array3f(step.sent)
        missing = _chosen(step.path, dr.compress(step.is_missing))
        if dr.width(missing.lane):
            self._add_unknown(radiance, self._look_up(cache, missing))
        return radiance, step.has_lobe

    def scattered(self, cache: LightCache, rays: Rays, rng: Any) -> Any:
        """Radiance that the surfaces seen send by all their other lobes.

        Parameters and random numbers are those of :meth:`seen`.

        Returns
        -------
        Array3f
        """
        radiance = dr.zeros(Array3f, dr.width(rng.state))
        path, bounce = self._begun(rays, rng), 0
        while bounce < BOUNCES and dr.width(path.lane):
            is_faint = UInt(dr.opaque(UInt, int(bounce >= ROULETTE_FROM)))
            direct, step, is_alive = self._go_on(cache, path, is_faint)
            _scatter_add(radiance, direct, path.lane)
            self._add_unknown(radiance, step)
            path = _chosen(step.path, dr.compress(is_alive & step.has_lobe))
            bounce += 1
        return radiance

    def _begun(self, rays: Rays, rng: Any) -> _Path:
        count = dr.width(rng.state)
        origin = rays.origin + dr.zeros(Array3f, count)
        path = _Path(
            dr.arange(UInt, count), Rays(origin, rays.direction), None, dr.full(Array3f, 1, count), rng
        )
        # Now, and not while a kernel is recorded: then no memory of NumPy's can be let go.
        dr.eval(path)
        return path

    def _add_unknown(self, radiance: Any, step: _Step) -> None:
        """Add what a step sent; where the light is not known, estimate it first."""
        _scatter_add(radiance, step.sent, step.path.lane)
        lanes = dr.compress(step.is_missing)
        if dr.width(lanes):
            missing = _chosen(step.path, lanes)
            estimated, rng = self._estimate(missing)
            _scatter_add(radiance, estimated, missing.lane)
            # The paths go on with other random numbers than the estimates were made with.
            dr.scatter(step.path.rng.state, rng.state, lanes)

    def _meet_kernel(self, cache: LightCache, path: _Path) -> _Step:
        lit = self._renderer.lit(path.rays, path.bounce)
        sent, is_missing = _diffuse(cache, lit)
        return _Step(Array3f(path.throughput * (lit.emission + sent)), is_missing, Bool(lit.has_lobe), path)

    def _look_up_kernel(self, cache: LightCache, path: _Path) -> _Step:
        """What the diffuse lobes alone send."""
        sent, is_missing = _diffuse(cache, self._renderer.lit(path.rays, path.bounce))
        return _Step(Array3f(path.throughput * sent), is_missing, Bool(False), path)

    def _go_on_kernel(self, cache: LightCache, path: _Path, is_faint: Any) -> tuple[Any, _Step, Any]:
        """Scatter off the surface that the rays meet, and meet the next."""
        rng = PCG32(path.rng)
        scattered = self._renderer.scatter(self._renderer.lit(path.rays, path.bounce), rng)
        throughput = path.throughput * scattered.throughput
        chance = dr.select(is_faint != 0, dr.clip(dr.max(dr.abs(throughput)), LEAST_CHANCE, 1.0), 1.0)
        is_alive = scattered.is_alive & (rng.next_float32() < chance)
        ahead = _Path(path.lane, scattered.rays, scattered.bounce, Array3f(throughput / chance), rng)
        step = self._meet_kernel(cache, ahead)
        step = _Step(
            sent=dr.select(is_alive, step.sent, 0.0),
            is_missing=Bool(step.is_missing & is_alive),
            has_lobe=step.has_lobe,
            path=ahead,
        )
        return Array3f(path.throughput * scattered.direct), step, Bool(is_alive)

    def _estimate_kernel(self, path: _Path) -> tuple[Any, Any]:
        """Radiance that the diffuse lobes send where rays meet a surface, by path tracing."""
        rng = PCG32(path.rng)
        lit = self._renderer.lit(path.rays, path.bounce)
        return Array3f(path.throughput * lit.surfaces.albedo * self._renderer.light(lit, rng)), rng

    def _recorded(self, kernel: Any) -> Any:
        renderer = self._renderer
        return dr.freeze(kernel, state_fn=lambda *_: renderer.state)


def _diffuse(cache: LightCache, lit: Lit) -> tuple[Any, Any]:
    """Radiance of the diffuse lobes with the light that is known, and where it is not."""
    albedo = lit.surfaces.albedo
    is_diffuse = lit.surfaces.is_hit & (dr.max(albedo) > BLACK)
    found, is_known = cache.find(lit.position, lit.surfaces.normal, lit.surfaces.item)
    return dr.select(is_diffuse & is_known, albedo * found, 0.0), Bool(is_diffuse & ~is_known)


def _chosen(path: _Path, lanes: Any) -> _Path:
    return _Path(
        lane=dr.gather(UInt, path.lane, lanes),
        rays=dr.gather(Rays, path.rays, lanes),
        bounce=dr.gather(Bounce, path.bounce, lanes) if path.bounce else None,
        throughput=dr.gather(Array3f, path.throughput, lanes),
        rng=dr.gather(PCG32, path.rng, lanes),
    )


def _scatter_add(radiance: Any, sent: Any, lane: Any) -> None:
    """Add to each lane's radiance; a lane has one path, so that the order does not matter."""
    for target, value in zip(radiance, sent, strict=True):
        dr.scatter_add(target, Float(value), lane)
    dr.eval(radiance)
