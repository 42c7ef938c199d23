"""The light apart from the surfaces: what ``renderer.LobeRenderer`` asks, answered by Mitsuba."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi

from enfilade.arrays import Array3f, Bool
from enfilade.records import MIN_DIFFUSE_ALBEDO
from enfilade.renderer import Bounce, BsdfSample, Rays, ShadingPoint
from enfilade.scene.mitsuba.lobes import Lobes

Radiance = Callable[[Rays, Any, int, Any], Any]


class LightTransport:
    """Emission, light samples and bounces of a Mitsuba scene.

    Parameters
    ----------
    scene : mitsuba.Scene
    radiance
        The path tracer: radiance along rays, given a random number generator for each, the
        path depth at which they begin, and which of them are traced.
    """

    def __init__(self, scene: Any, radiance: Radiance) -> None:
        self._scene = scene
        self._radiance = radiance
        self._lobes = Lobes(scene)

    @property
    def state(self) -> Any:
        """Arrays that the materials' division reads."""
        return self._lobes.state

    def albedo(self, seen: Any, material: Any, active: Any) -> Any:
        """Albedo of the diffuse lobe, 0..1; 0 where there is none."""
        return Array3f(self._lobes.albedo(seen, material, active))

    def emission(self, seen: Any, bounce: Bounce | None) -> Any:
        """Radiance that a hit, or the environment, sends back along the ray."""
        emitted = seen.emitter(self._scene).eval(seen)
        if bounce is None:
            return Array3f(emitted)
        origin = dr.zeros(mi.Interaction3f)
        origin.p = mi.Point3f(bounce.position)
        direction = mi.DirectionSample3f(self._scene, seen, origin)
        sampled = self._scene.pdf_emitter_direction(origin, direction, ~bounce.is_delta)
        return Array3f(emitted * dr.select(bounce.is_delta, 1.0, _balance(bounce.pdf, sampled)))

    def has_specular(self, seen: Any) -> Any:
        """Whether a hit's material is more than a diffuse lobe."""
        return self._lobes.has_specular(seen, seen.bsdf())

    def estimate_diffuse(self, point: ShadingPoint, rng: Any, path_depth: int) -> tuple[Any, Any]:
        """See :meth:`enfilade.renderer.LobeRenderer.estimate_diffuse`."""
        return self._onward(self.sample_diffuse(point, rng), rng, path_depth)

    def estimate_specular(self, point: ShadingPoint, rng: Any, path_depth: int) -> tuple[Any, Any]:
        """See :meth:`enfilade.renderer.LobeRenderer.estimate_specular`."""
        return self._onward(self.sample_specular(point, rng), rng, path_depth)

    def _onward(self, lobe: BsdfSample, rng: Any, path_depth: int) -> tuple[Any, Any]:
        """What a lobe sends: sampled lights, and what the path tracer finds, its first emitter weighted."""
        found = self._radiance(lobe.rays, rng, path_depth, lobe.is_alive)
        ray = mi.Ray3f(mi.Point3f(lobe.rays.origin), mi.Vector3f(lobe.rays.direction))
        following = self._scene.ray_intersect(ray, lobe.is_alive)
        whole = following.emitter(self._scene).eval(following, lobe.is_alive)
        emitted = lobe.throughput * self.emission(following, lobe.bounce)
        direct = lobe.direct + dr.select(lobe.is_alive, emitted, 0.0)
        indirect = dr.select(lobe.is_alive, lobe.throughput * (found - whole), 0.0)
        return Array3f(direct), Array3f(indirect)

    def sample_diffuse(self, point: ShadingPoint, rng: Any) -> BsdfSample:
        """See :meth:`enfilade.renderer.LobeRenderer.sample_diffuse`."""
        seen, albedo = point.native, point.surfaces.albedo
        active = seen.is_valid() & (dr.max(albedo) > MIN_DIFFUSE_ALBEDO)
        material = seen.bsdf()
        direct = self._sampled_lights(seen, material, self._lobes.eval_diffuse, rng, active, albedo)
        wo, pdf, weight = self._lobes.sample_diffuse(seen, material, rng, active)
        ray = seen.spawn_ray(seen.to_world(wo))
        return BsdfSample(
            rays=Rays(Array3f(ray.o), Array3f(ray.d)),
            bounce=Bounce(Array3f(seen.p), pdf, Bool(False)),
            throughput=_divided(weight, albedo),
            direct=Array3f(direct),
            is_alive=Bool(active & (pdf > 0.0)),
        )

    def sample_specular(self, point: ShadingPoint, rng: Any, choice: Any = None) -> BsdfSample:
        """See :meth:`enfilade.renderer.LobeRenderer.sample_specular`."""
        seen = point.native
        material = seen.bsdf()
        wo, pdf, weight, is_delta = self._lobes.sample_specular(seen, material, rng, choice)
        # Mirrors and clear glass send nothing from a point on a light: its shadow ray is spared.
        is_spread = point.has_specular & self._lobes.has_glossy(seen, material)
        direct = self._sampled_lights(seen, material, self._lobes.eval_specular, rng, is_spread)
        ray = seen.spawn_ray(seen.to_world(wo))
        return BsdfSample(
            rays=Rays(Array3f(ray.o), Array3f(ray.d)),
            bounce=Bounce(Array3f(seen.p), pdf, Bool(is_delta)),
            throughput=Array3f(weight),
            direct=Array3f(direct),
            is_alive=Bool(point.has_specular & (pdf > 0.0)),
        )

    def _sampled_lights(
        self, seen: Any, material: Any, evaluate: Any, rng: Any, active: Any, albedo: Any = None
    ) -> Any:
        """Weighted radiance that a lobe, by its albedo if any, sends from one sampled point on the lights."""
        point = mi.Point2f(rng.next_float32(), rng.next_float32())
        light, radiance = self._scene.sample_emitter_direction(seen, point, True, active)
        active = active & (light.pdf != 0.0)
        value, pdf = evaluate(seen, material, seen.to_local(light.d), active)
        if albedo is not None:
            value = _divided(value, albedo)
        share = dr.select(light.delta, 1.0, _balance(light.pdf, pdf))
        return dr.select(active, value * radiance * share, 0.0)


def _divided(lobe: Any, albedo: Any) -> Any:
    """A diffuse lobe by its albedo; in channels that have none, as in the one that has most: Array3f.

    What light a red surface gets, its pale neighbours get, too: a channel that it swallows may not look dark.
    """
    channels = list(zip(Array3f(lobe), Array3f(albedo), strict=True))
    most = dr.max(Array3f(albedo))
    brightest = dr.select(
        most > MIN_DIFFUSE_ALBEDO, dr.max(Array3f(lobe)) / dr.maximum(most, MIN_DIFFUSE_ALBEDO), 0.0
    )
    quotients = (
        dr.select(a > MIN_DIFFUSE_ALBEDO, v / dr.maximum(a, MIN_DIFFUSE_ALBEDO), brightest)
        for v, a in channels
    )
    return Array3f(*quotients)


def _balance(this: Any, other: Any) -> Any:
    """Veach's power heuristic; 0 where neither strategy would have found it."""
    this, other = this * this, other * other
    share = this / (this + other)
    return dr.select(dr.isfinite(share), share, 0.0)
