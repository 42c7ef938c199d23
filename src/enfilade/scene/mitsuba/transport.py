"""Light transport at a shading point of a Mitsuba scene, for the diffuse and the specular lobes apart."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi

from enfilade.arrays import Array3f, Bool, UInt
from enfilade.kernels.guiding import GuidedLobe, PathGuide
from enfilade.records import MIN_DIFFUSE_ALBEDO
from enfilade.renderer import Bounce, Branch, BsdfSample, Rays, ShadingPoint, SharpLight
from enfilade.scene.mitsuba.lobes import Lobes
from enfilade.scene.mitsuba.resampling import MOST_CANDIDATES, Contributions, resample
from enfilade.scene.mitsuba.shadow_rays import NULL_LAYERS, ShadowRays, Target
from enfilade.scene.mitsuba.sharp_emitters import SharpEmitters, mis_weight

RARE_WEIGHT = 1e-4  # of MIS: next-event estimation samples a direction 100 times as often as the lobe
GUIDE_SALT = 0x632BE5AB  # makes guided directions independent of the path's random numbers
ROULETTE_LAYERS = 3  # null interactions, after which Russian roulette may end a path

Radiance = Callable[[Rays, Any, tuple[int, int], Any], tuple[Any, Any]]


class LightTransport:
    """Emission, next-event estimation and BSDF samples.

    Parameters
    ----------
    scene : mitsuba.Scene
    lobes
        Of its BSDFs.
    radiance
        The path tracer: radiance along rays, and whether emission that is passed is in it; from the rays,
        their samplers, the path depths at which they begin and as of which they end, and which are traced.
    shadow_rays
    """

    def __init__(self, scene: Any, lobes: Lobes, radiance: Radiance, shadow_rays: ShadowRays) -> None:
        self._scene = scene
        self._lobes = lobes
        self._radiance = radiance
        self._shadow_rays = shadow_rays
        self.sharp_emitters = SharpEmitters(scene, shadow_rays)

    def emission(self, si: Any, bounce: Bounce | None, active: Any = True) -> Any:
        """Radiance emitted along the ray by a hit, or by the environment; weighted if the ray was sampled.

        Rays that are not active may have no direction, for which emitters would read tables out of bounds.
        """
        emitter = si.emitter(self._scene, active)
        emitted = emitter.eval(si, active)
        if bounce is None:
            return Array3f(emitted)
        origin = dr.zeros(mi.Interaction3f)
        origin.p = mi.Point3f(bounce.position)
        direction = mi.DirectionSample3f(self._scene, si, origin)
        emitter_pdf = self._scene.pdf_emitter_direction(origin, direction, active & ~bounce.is_delta)
        apart = self.sharp_emitters.pdf(emitter, direction.d, emitter_pdf)
        emitter_pdf = dr.select(bounce.soft_only, apart, emitter_pdf)
        return Array3f(emitted * dr.select(bounce.is_delta, 1.0, mis_weight(bounce.pdf, emitter_pdf)))

    def estimate(self, sample: BsdfSample, sampler: Any, path_depth: int, end_depth: int) -> tuple[Any, Any]:
        """Direct and indirect radiance of a sample: its path is continued by the path tracer."""
        depths = path_depth, end_depth
        found, is_valid = self._radiance(sample.rays, sampler, depths, sample.is_alive)
        # The path tracer adds the emission of the first hit unweighted: replace it by the weighted one.
        met, unweighted, weighted, is_rare = self._emission_along(sample)
        # Mitsuba's `path` returns nothing for paths that meet null interactions alone and leave the scene.
        found = dr.select(is_valid, found, met)
        direct = sample.direct + dr.select(sample.is_alive, sample.throughput * weighted, 0.0)
        # Chance and Russian roulette at null interactions leave noise of the size of the emission: leave out
        # the rest in the few directions that next-event estimation samples far more often.
        is_rest = sample.is_alive & ~is_rare
        indirect = dr.select(is_rest, sample.throughput * (found - unweighted), 0.0)
        return Array3f(direct), Array3f(indirect)

    def _emission_along(self, sample: BsdfSample) -> tuple[Any, Any, Any, Any]:
        """Emission of the first hit, and of null interactions before it.

        As a path meets it that passes all of them by chance; its expectation; that weighted; and whether any
        of it that is met by chance has a weight below :data:`RARE_WEIGHT`.
        """
        ray = mi.Ray3f(mi.Point3f(sample.rays.origin), mi.Vector3f(sample.rays.direction))
        if not self._shadow_rays.has_null:
            si = self._scene.ray_intersect(ray, sample.is_alive)
            met = self.emission(si, None, sample.is_alive)
            return met, met, self.emission(si, sample.bounce, sample.is_alive), Bool(False)

        def add_hit(
            ray: Any,
            share: Any,
            met: Any,
            unweighted: Any,
            weighted: Any,
            is_chance: Any,
            is_rare: Any,
            active: Any,
            layer: Any,
        ) -> tuple[Any, ...]:
            si = self._scene.ray_intersect(ray, int(mi.RayFlags.All), Bool(True), active)
            emitted = dr.select(active, self.emission(si, None, active), 0.0)
            met += emitted
            unweighted += share * emitted
            own = dr.select(active, share * self.emission(si, sample.bounce, active), 0.0)
            weighted += own
            is_rare |= is_chance & (dr.max(own) < RARE_WEIGHT * dr.max(share * emitted))
            active = active & si.is_valid()
            passed = mi.unpolarized_spectrum(si.bsdf().eval_null_transmission(si, active))
            share = dr.select(active, share * Array3f(passed), share)
            is_chance |= active & ((dr.min(passed) < 1.0) | (layer + 1 >= ROULETTE_LAYERS))
            active &= dr.max(share) > 0.0
            return (
                si.spawn_ray(ray.d),
                share,
                met,
                unweighted,
                weighted,
                is_chance,
                is_rare,
                active,
                layer + 1,
            )

        none = Array3f(0), Array3f(0), Array3f(0), Bool(False), Bool(False)  # changed in place
        _, _, met, unweighted, weighted, _, is_rare, _, _ = dr.while_loop(
            (ray, Array3f(1), *none, Bool(sample.is_alive), UInt(0)),
            lambda *state: state[7] & (state[8] < NULL_LAYERS),
            add_hit,
            labels=(
                *("ray", "share", "met", "unweighted", "weighted"),
                *("is_chance", "is_rare", "active", "layer"),
            ),
        )
        return met, unweighted, weighted, is_rare

    def sharp_light(self, point: ShadingPoint, sampler: Any, *, specular: bool = False) -> SharpLight:
        """See :meth:`enfilade.renderer.LobeRenderer.sharp_light`."""
        si, bsdf, albedo = _lobes_of(point)
        is_diffuse = si.is_valid() & (dr.max(albedo) > MIN_DIFFUSE_ALBEDO)
        is_glossy = point.has_specular & self._lobes.has_glossy(si, bsdf) & specular

        def evaluate(direction: Any) -> list[tuple[Any, Any]]:
            wo = si.to_local(direction)
            value, pdf = self._lobes.eval_diffuse(si, bsdf, albedo, wo, is_diffuse)
            lobes = [(_divided(value, albedo), pdf)]
            if specular:
                lobes.append(self._lobes.eval_specular(si, bsdf, albedo, wo, is_glossy))
            return lobes

        active, factors = is_diffuse | is_glossy, [albedo, 1.0][: 2 if specular else 1]
        (diffuse, *others), unoccluded = self.sharp_emitters.estimate(si, sampler, evaluate, factors, active)
        return SharpLight(diffuse, others[0] if specular else Array3f(0), unoccluded)

    def coat_emission(self, point: ShadingPoint) -> Any:
        """See :meth:`enfilade.renderer.LobeRenderer.coat_emission`."""
        if not self._lobes.has_coats:
            return Array3f(0)
        si = point.native
        wo, weight = self._lobes.coat_reflection(si, si.bsdf(), point.is_coated)
        hit = self._scene.ray_intersect(si.spawn_ray(si.to_world(wo)), point.is_coated)
        emitted = weight * self.emission(hit, None, point.is_coated)
        return Array3f(dr.select(point.is_coated, emitted, 0.0))

    def sample_diffuse(
        self, point: ShadingPoint, sampler: Any, *, soft_only: bool = False, guide: PathGuide | None = None
    ) -> BsdfSample:
        """See :meth:`enfilade.renderer.LobeRenderer.sample_diffuse`."""
        si, bsdf, albedo = _lobes_of(point)
        active = si.is_valid() & (dr.max(albedo) > MIN_DIFFUSE_ALBEDO)

        def evaluate(wo: Any, is_lit: Any) -> tuple[Any, Any]:
            value, pdf = self._lobes.eval_diffuse(si, bsdf, albedo, wo, is_lit)
            return _divided(value, albedo), pdf

        direct = self._next_event(si, evaluate, sampler, active, soft_only=soft_only)
        wo, pdf, weight = self._lobes.sample_diffuse(si, bsdf, albedo, sampler, active)
        if guide is not None:
            wo, pdf, weight = self._guided(guide, point, sampler, active, wo, pdf, weight)
        ray = si.spawn_ray(si.to_world(wo))
        return BsdfSample(
            rays=Rays(Array3f(ray.o), Array3f(ray.d)),
            bounce=Bounce(Array3f(si.p), pdf, Bool(False), Bool(soft_only)),
            throughput=_divided(weight, albedo),
            direct=Array3f(direct),
            is_alive=Bool(active & (pdf > 0.0)),
            is_split=Bool(False),
            is_image=Bool(False),
            is_passed=Bool(False),
            is_interface=Bool(False),
            is_within=Bool(False),
        )

    def _guided(
        self, guide: PathGuide, point: ShadingPoint, sampler: Any, active: Any, wo: Any, pdf: Any, weight: Any
    ) -> tuple[Any, Any, Any]:
        """Replace some samples of the diffuse lobe by a guide's, and weigh all by the mixture's density.

        The density that is returned is that of the lobe: it serves multiple importance sampling, whose
        weights may be any that add up to one, and these do so whatever the guide.
        """
        si, bsdf, albedo = _lobes_of(point)
        mixture = GuidedLobe(guide, point.position, point.surfaces.normal)
        numbers = sampler.fork(GUIDE_SALT)
        direction, is_guided = mixture.sample(numbers.next_1d(), numbers.next_2d())
        is_guided &= active
        towards = si.to_local(mi.Vector3f(direction))
        value, own_pdf = self._lobes.eval_diffuse(si, bsdf, albedo, towards, is_guided)
        wo, pdf = dr.select(is_guided, towards, wo), dr.select(is_guided, own_pdf, pdf)
        value = dr.select(is_guided, value, weight * pdf)
        density = mixture.pdf(Array3f(si.to_world(wo)), pdf)
        return wo, pdf, dr.select(pdf > 0.0, value / density, 0.0)

    def sample_specular(
        self,
        point: ShadingPoint,
        sampler: Any,
        choice: Any = None,
        branch: Any = None,
        *,
        soft_only: bool = False,
    ) -> BsdfSample:
        """See :meth:`enfilade.renderer.LobeRenderer.sample_specular`."""
        si, bsdf, albedo = _lobes_of(point)
        wo, pdf, weight, is_delta, is_null = self._lobes.sample_specular(
            si, bsdf, albedo, sampler, choice, branch
        )
        # Total reflection at a clear interface has a density of one, and no other branch.
        is_split = self._lobes.is_clear(si, bsdf) & (pdf < 1.0)
        # Delta lobes reflect nothing from a sampled point: spare its shadow ray.
        has_glossy = point.has_specular & self._lobes.has_glossy(si, bsdf)
        if branch is not None:
            is_rough = self._lobes.is_rough_interface(si, bsdf)
            is_split |= is_rough
            has_glossy &= ~is_rough | (branch == int(Branch.REFLECTED))  # that of both branches at once
        evaluate = partial(self._lobes.eval_specular, si, bsdf, albedo)
        direct = self._next_event(si, evaluate, sampler, has_glossy, soft_only=soft_only)
        ray = si.spawn_ray(si.to_world(wo))
        bounce = Bounce(Array3f(si.p), pdf, Bool(is_delta), Bool(soft_only))
        is_passed = self._shadow_rays.is_passed(si, bsdf, is_null)
        is_interface = self._lobes.is_solid(si, bsdf)
        return BsdfSample(
            rays=Rays(Array3f(ray.o), Array3f(ray.d)),
            bounce=dr.select(is_passed, point.bounce, bounce) if point.bounce else bounce,
            throughput=Array3f(weight),
            direct=Array3f(direct),
            is_alive=Bool(point.has_specular & (pdf > 0.0)),
            is_split=Bool(point.has_specular & is_split & (branch is not None)),
            is_image=Bool(is_delta | self._lobes.is_narrow(si, bsdf)),
            is_passed=is_passed,
            is_interface=Bool(is_interface),
            is_within=Bool(is_interface & (wo.z < 0.0)),
        )

    def _next_event(
        self, si: Any, evaluate: Callable[[Any, Any], Any], sampler: Any, active: Any, *, soft_only: bool
    ) -> Any:
        """Radiance of a lobe from one point on the emitters, MIS-weighted.

        The point is chosen among one candidate for each of the emitters, or :data:`MOST_CANDIDATES`.
        `evaluate` takes directions, and where they count; it returns the lobe's value and density.
        """

        def candidate(place: Any) -> tuple[Target, Contributions]:
            if soft_only:
                emitter, radiance = self.sharp_emitters.sample_soft(si, place, active)
            else:
                emitter, radiance = self._scene.sample_emitter_direction(si, place, False, active)
            is_lit = active & (emitter.pdf != 0.0)
            value, pdf = evaluate(si.to_local(emitter.d), is_lit)
            weight = dr.select(emitter.delta, 1.0, mis_weight(emitter.pdf, pdf))
            return Target(emitter.p, emitter.delta), (
                Array3f(dr.select(is_lit, value * radiance * weight, 0.0)),
            )

        emitters = self.sharp_emitters.soft_count if soft_only else self.sharp_emitters.count
        target, light = resample(candidate, min(max(emitters, 1), MOST_CANDIDATES), sampler)
        (found,) = self._shadow_rays.unoccluded(si, target, light, active)
        return found


def _lobes_of(point: ShadingPoint) -> tuple[Any, Any, Any]:
    """Mitsuba's interaction, its BSDF, and the albedo of its diffuse lobe."""
    si = point.native
    return si, si.bsdf(), mi.Color3f(point.surfaces.albedo)


def _divided(lobe: Any, albedo: Any) -> Any:
    """A diffuse lobe divided by its albedo; Array3f.

    A channel without albedo takes the value of the brightest one: irradiance is shared with surfaces that do
    reflect in this channel.
    """
    channels = list(zip(Array3f(lobe), Array3f(albedo), strict=True))
    most = dr.max(Array3f(albedo))
    brightest = dr.max(Array3f(lobe)) / dr.maximum(most, MIN_DIFFUSE_ALBEDO)
    brightest = dr.select(most > MIN_DIFFUSE_ALBEDO, brightest, 0.0)
    quotients = (
        dr.select(a > MIN_DIFFUSE_ALBEDO, v / dr.maximum(a, MIN_DIFFUSE_ALBEDO), brightest)
        for v, a in channels
    )
    return Array3f(*quotients)
