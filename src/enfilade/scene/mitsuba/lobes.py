"""Mitsuba's BSDFs as a diffuse lobe times an albedo, and the rest.

Most of Mitsuba's BSDFs evaluate and sample their diffuse component alone when asked to. Their albedo is what
that component sends straight ahead: a coat that lets less light out the more obliquely it is seen is part of
it, so that the light by the albedo is the same whoever looks. Some BSDFs do not divide themselves
(``principled`` answers with all of itself, ``mask`` samples its diffuse component wrongly): for them the
diffuse lobe is Lambert's with their own albedo, as far as they are opaque and no metal or glass, and the rest
is what the whole BSDF has beyond it, which may be negative; a mask over a Lambert lobe has none where it is
opaque.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from enfilade.arrays import Bool, UInt

UNDIVIDED = ("Principled", "PrincipledThin", "MaskBSDF", "Hair", "Measured")
NOT_DIFFUSE = ("metallic", "spec_trans")  # shares of a surface that its base colour's diffuse lobe lacks
LAMBERT = ("MaskBSDF", "TwoSidedBRDF", "SmoothDiffuse")  # made of these alone it is Lambert's lobe with holes


class Lobes:
    """The materials of a scene, divided.

    Parameters
    ----------
    scene : mitsuba.Scene
    """

    def __init__(self, scene: Any) -> None:
        flags = mi.BSDFFlags
        self._all = mi.BSDFContext()
        self._diffuse, self._specular = mi.BSDFContext(), mi.BSDFContext()
        self._diffuse.type_mask = int(flags.Diffuse)
        self._specular.type_mask = int(flags.All) & ~int(flags.Diffuse)
        materials = [node for node in mi.traverse(scene).hierarchy if isinstance(node, mi.BSDF)]
        numbers: Any = [dr.reinterpret_array(mi.UInt32, mi.BSDFPtr(material)) for material in materials]
        registry = [int(number[0]) for number in numbers]
        is_undivided, is_lambert = np.zeros((2, max(registry, default=0) + 1), bool)
        is_undivided[registry] = [not names.isdisjoint(UNDIVIDED) for names in map(_classes, materials)]
        is_lambert[registry] = [names.issubset(LAMBERT) for names in map(_classes, materials)]
        self._is_undivided, self._is_lambert = Bool(is_undivided), Bool(is_lambert)
        self._has_undivided = bool(is_undivided.any())

    @property
    def state(self) -> Any:
        """Arrays that the methods read."""
        return self._is_undivided, self._is_lambert

    def is_undivided(self, seen: Any, material: Any) -> Any:
        """Whether the diffuse lobe of these hits is Lambert's, and not Mitsuba's own component."""
        number: Any = dr.reinterpret_array(UInt, material)
        return dr.gather(Bool, self._is_undivided, number, seen.is_valid())

    def _is_lamberts(self, seen: Any, material: Any) -> Any:
        """Whether these hits are Lambert's lobe, perhaps with holes."""
        number: Any = dr.reinterpret_array(UInt, material)
        return dr.gather(Bool, self._is_lambert, number, seen.is_valid())

    def has_specular(self, seen: Any, material: Any) -> Any:
        """Whether these hits have more than a diffuse lobe."""
        beyond = int(mi.BSDFFlags.All) & ~int(mi.BSDFFlags.Diffuse)
        has_specular = seen.is_valid() & ((material.flags() & beyond) != 0)
        if not self._has_undivided:
            return has_specular
        is_lambert = self._is_lamberts(seen, material)
        is_opaque = is_lambert & (self._opacity(seen, material, has_specular & is_lambert) >= 1.0)
        return (has_specular & ~is_opaque) | (self.is_undivided(seen, material) & ~is_lambert)

    def has_glossy(self, seen: Any, material: Any) -> Any:
        """Whether what these hits have beyond the diffuse lobe is more than lobes of one direction each."""
        is_glossy = has_lobe(material.flags(), "GlossyReflection", "GlossyTransmission")
        if not self._has_undivided:
            return is_glossy
        return is_glossy | (self.is_undivided(seen, material) & ~self._is_lamberts(seen, material))

    def albedo(self, seen: Any, material: Any, active: Any) -> Any:
        """Albedo of the diffuse lobe, 0..1: what light is multiplied with, and what the rest is without."""
        is_diffuse = active & has_lobe(material.flags(), "DiffuseReflection", "DiffuseTransmission")
        undivided = self.is_undivided(seen, material)
        ahead = mi.Vector3f(0.0, 0.0, dr.copysign(mi.Float(1.0), seen.wi.z))
        albedo = dr.pi * material.eval(self._diffuse, seen, ahead, is_diffuse & ~undivided)
        if self._has_undivided:
            undivided &= is_diffuse
            own = material.eval_diffuse_reflectance(seen, undivided)
            own *= self._opacity(seen, material, undivided)
            for name in NOT_DIFFUSE:
                has_it = undivided & material.has_attribute(name, undivided)
                own *= 1.0 - dr.select(has_it, material.eval_attribute_1(name, seen, has_it), 0.0)
            albedo = dr.select(undivided, own, albedo)
        parts = (albedo.x, albedo.y, albedo.z)
        return mi.Color3f(*(dr.select(is_diffuse & dr.isfinite(c), dr.clip(c, 0.0, 1.0), 0.0) for c in parts))

    def eval_diffuse(self, seen: Any, material: Any, wo: Any, active: Any) -> tuple[Any, Any]:
        """Diffuse lobe times cosine, and its density, for a direction in the local frame."""
        undivided = self.is_undivided(seen, material)
        own, own_pdf = material.eval_pdf(self._diffuse, seen, wo, active & ~undivided)
        lambert, lambert_pdf = self._lambert(seen, material, wo, active & undivided)
        return dr.select(undivided, lambert, own), dr.select(undivided, lambert_pdf, own_pdf)

    def sample_diffuse(self, seen: Any, material: Any, rng: Any, active: Any) -> tuple[Any, Any, Any]:
        """Direction, density and weight of a sample of the diffuse lobe."""
        undivided = self.is_undivided(seen, material)
        second, first = mi.Point2f(rng.next_float32(), rng.next_float32()), rng.next_float32()
        own, weight = material.sample(self._diffuse, seen, first, second, active & ~undivided)
        up = _cosine(seen, second)
        albedo = self.albedo(seen, material, active & undivided)
        wo = dr.select(undivided, up, own.wo)
        pdf = dr.select(undivided, dr.abs(up.z) / dr.pi, own.pdf)
        return wo, pdf, dr.select(undivided, albedo, weight)

    def eval_specular(self, seen: Any, material: Any, wo: Any, active: Any) -> tuple[Any, Any]:
        """Everything but the diffuse lobe, times cosine, and the density of :meth:`sample_specular`."""
        undivided = self.is_undivided(seen, material)
        own, own_pdf = material.eval_pdf(self._specular, seen, wo, active & ~undivided)
        beyond, mixed_pdf = self._beyond(seen, material, wo, active & undivided)
        return dr.select(undivided, beyond, own), dr.select(undivided, mixed_pdf, own_pdf)

    def sample_specular(
        self, seen: Any, material: Any, rng: Any, choice: Any = None
    ) -> tuple[Any, Any, Any, Any]:
        """Direction, density, weight, and whether the direction is the only one (a delta lobe).

        What a whole BSDF has beyond Lambert's lobe is sampled by both in turn: where only the one or the
        other is large, the weight stays bounded. A Lambert lobe with holes has nothing beyond but these. Who
        makes the choice of the lobe, 0..1, gets a direction of it, and no weight.
        """
        undivided = self.is_undivided(seen, material)
        first, second = rng.next_float32(), mi.Point2f(rng.next_float32(), rng.next_float32())
        has_holes = undivided & self._is_lamberts(seen, material)
        is_turn = has_holes | (rng.next_float32() < 0.5)
        if choice is not None:
            first, is_turn = choice, Bool(True)
        own, weight = material.sample(self._specular, seen, first, second, ~undivided)
        whole, whole_weight = material.sample(self._all, seen, first, second, undivided)
        kind = dr.select(undivided, whole.sampled_type, own.sampled_type)
        is_delta = mi.has_flag(kind, mi.BSDFFlags.Delta) | mi.has_flag(kind, mi.BSDFFlags.Null)
        is_delta &= ~undivided | is_turn

        mixed_wo = dr.select(is_turn, whole.wo, _cosine(seen, second))
        beyond, mixed_pdf = self._beyond(seen, material, mixed_wo, undivided & ~is_delta)
        beyond = dr.select(mixed_pdf > 0.0, beyond / mixed_pdf, 0.0)
        beyond = dr.select(is_delta, dr.select(has_holes, 1.0, 2.0) * whole_weight, beyond)
        mixed_pdf = dr.select(is_delta, whole.pdf, mixed_pdf)

        wo, pdf = dr.select(undivided, mixed_wo, own.wo), dr.select(undivided, mixed_pdf, own.pdf)
        return wo, pdf, dr.select(undivided, beyond, weight), is_delta

    def _opacity(self, seen: Any, material: Any, active: Any) -> Any:
        """What part of a surface is there: 1 - what it lets through unseen."""
        return 1.0 - dr.mean(material.eval_null_transmission(seen, active))

    def _beyond(self, seen: Any, material: Any, wo: Any, active: Any) -> tuple[Any, Any]:
        """What a whole BSDF has beyond Lambert's lobe, and the mean density of sampling the two."""
        whole, whole_pdf = material.eval_pdf(self._all, seen, wo, active)
        lambert, lambert_pdf = self._lambert(seen, material, wo, active)
        return whole - lambert, 0.5 * (whole_pdf + lambert_pdf)

    def _lambert(self, seen: Any, material: Any, wo: Any, active: Any) -> tuple[Any, Any]:
        is_reflected = wo.z * seen.wi.z > 0.0
        pdf = dr.select(is_reflected, dr.abs(wo.z) / dr.pi, 0.0)
        return self.albedo(seen, material, active) * pdf, pdf


def _classes(material: Any) -> set[str]:
    """Mitsuba's classes of a material, and of those nested in it."""
    return {n.class_name() for n in mi.traverse(material).hierarchy if isinstance(n, mi.BSDF)}


def has_lobe(flags: Any, *lobes: str) -> Any:
    """Whether a material has any of these lobes, by Mitsuba's names of them."""
    return (flags & sum(int(getattr(mi.BSDFFlags, lobe)) for lobe in lobes)) != 0


def _cosine(seen: Any, square: Any) -> Any:
    """Direction on the side from which a surface is seen, as likely as its cosine."""
    up = mi.warp.square_to_cosine_hemisphere(square)
    return mi.Vector3f(up.x, up.y, dr.copysign(up.z, seen.wi.z))
