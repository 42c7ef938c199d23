"""Mitsuba's BSDFs, split into albedo times a diffuse lobe, and specular lobes.

Most BSDFs of Mitsuba evaluate and sample their diffuse component alone when a context selects it. Their
albedo is the value of that component for light along the normal. It includes the transmittance of a coat
towards the viewer, so that the quotient of the diffuse component and the albedo does not depend on the view.
Below masks, bump and normal maps it is that of the nested BSDF: with that of the map, the quotient would
contain the map's slopes, and could not be filtered.

Some BSDFs can't be split by a context: ``principled`` evaluates all of itself, and ``mask`` samples its
diffuse component wrongly. Their diffuse lobe is a Lambertian one with their own albedo, reduced by
transparency, metalness and transmission. The specular part is the difference between the whole BSDF and that
lobe; it may be negative. A mask over a Lambertian BSDF has nothing but its null interaction left.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from enfilade.arrays import Bool, Float, UInt, lanes
from enfilade.kernels.random import one_sequence
from enfilade.renderer import Branch
from enfilade.scene.mitsuba.bsdfs import (
    base,
    below_maps,
    classes,
    is_diffuse_on,
    is_narrow,
    is_solid,
    is_textured_metal,
    is_turned,
    mixes_delta_lobes,
    rough_ior,
)
from enfilade.scene.mitsuba.shapes import bsdf_table, bsdfs_of_shapes, has_lobe, registry_index

UNSPLIT = {
    "Principled",
    "PrincipledThin",
    "MaskBSDF",
    "Hair",
    "Measured",
    "PolarizedPlastic",
}  # no context selects their lobes
# Attributes times these: shares of the base colour that the diffuse lobe does not reflect.
NOT_DIFFUSE = {"metallic": 1.0, "spec_trans": 1.0, "diff_trans": 0.5}
LAMBERTIAN = {"MaskBSDF", "TwoSidedBRDF", "SmoothDiffuse"}  # of these alone: Lambertian, perhaps masked

COATED = {"SmoothPlastic", "TwoSidedBRDF"}  # of these alone: a smooth coat over a Lambertian lobe
CLEAR = {"SmoothDielectric", "ThinDielectric"}
DIELECTRIC_TINT = 0.04  # reflectance of what is no metal
MIN_TINT = 0.01  # of specular lobes
ALMOST_ONE = 1.0 - 2.0**-24

ALBEDO_BINS = 16  # of a BSDF's specular albedo, by the cosine of the viewer's direction, -1..1
ALBEDO_SAMPLES, ALBEDO_SEED = 1 << 18, 1
MIN_ALBEDO_SAMPLES = 16  # of a bin; with fewer its albedo is taken to be one


class Lobes:
    """The BSDFs of a scene, split.

    Directions are in the local frame of the interaction `si`. Methods that evaluate or sample a lobe take the
    :meth:`albedo` there, which is costly.

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
        self._unsplit = bsdf_table(scene, lambda bsdf: not classes(bsdf).isdisjoint(UNSPLIT))
        self._lambertian = bsdf_table(scene, lambda bsdf: classes(bsdf).issubset(LAMBERTIAN))
        self._sides = (
            bsdf_table(scene, lambda bsdf: is_diffuse_on(bsdf, flags.FrontSide)),
            bsdf_table(scene, lambda bsdf: is_diffuse_on(bsdf, flags.BackSide)),
        )
        self._masked = bsdf_table(scene, lambda bsdf: "MaskBSDF" in classes(bsdf))
        self._has_masked = bool(dr.any(self._masked))
        self._bases = (
            bsdf_table(scene, lambda bsdf: registry_index(mi.BSDFPtr(base(bsdf, is_front=True))), UInt),
            bsdf_table(scene, lambda bsdf: registry_index(mi.BSDFPtr(base(bsdf, is_front=False))), UInt),
        )
        self._turned = bsdf_table(scene, is_turned)
        self._solid = bsdf_table(scene, is_solid)
        self._clear = bsdf_table(scene, lambda bsdf: below_maps(bsdf).class_name() in CLEAR)
        self._rough_ior = bsdf_table(scene, rough_ior, Float)
        self._narrow = bsdf_table(scene, is_narrow)
        self._coated = bsdf_table(scene, lambda bsdf: classes(bsdf) <= COATED)
        self._textured_metal = bsdf_table(scene, is_textured_metal)
        self.has_textured_metal = any(map(is_textured_metal, bsdfs_of_shapes(scene)))
        self.has_coats = bool(dr.any(self._coated))
        self._has_unsplit = bool(dr.any(self._unsplit))
        self._mixed = bsdf_table(scene, mixes_delta_lobes)
        self._has_mixed = bool(dr.any(self._mixed))
        self._scene = scene

    @property
    def state(self) -> Any:
        """Arrays that the methods read, but for that of `specular_albedo`."""
        albedos = self._bases, self._turned, self._masked
        interfaces = (
            self._clear,
            self._solid,
            self._rough_ior,
            self._narrow,
            self._coated,
            self._textured_metal,
        )
        return self._unsplit, self._lambertian, self._sides, self._mixed, interfaces, albedos

    def has_specular(self, si: Any, bsdf: Any) -> Any:
        """Whether there are specular lobes, null interactions included."""
        beyond = int(mi.BSDFFlags.All) & ~int(mi.BSDFFlags.Diffuse)
        has_specular = si.is_valid() & ((bsdf.flags() & beyond) != 0)
        if not self._has_unsplit:
            return has_specular
        is_lambertian = _of(self._lambertian, si, bsdf)
        is_opaque = is_lambertian & (_opacity(si, bsdf, has_specular & is_lambertian) >= 1.0)
        return (has_specular & ~is_opaque) | (_of(self._unsplit, si, bsdf) & ~is_lambertian)

    def has_glossy(self, si: Any, bsdf: Any) -> Any:
        """Whether there are specular lobes other than delta lobes and null interactions."""
        is_glossy = has_lobe(bsdf.flags(), "GlossyReflection", "GlossyTransmission")
        if not self._has_unsplit:
            return is_glossy
        return is_glossy | (_of(self._unsplit, si, bsdf) & ~_of(self._lambertian, si, bsdf))

    def specular_albedo(self, si: Any, bsdf: Any) -> Any:
        """Albedo of the specular lobes, a mean over all points of a BSDF, by the viewer's angle; Float."""
        entry = _albedo_entry(_number(bsdf), si.wi.z)
        return dr.gather(Float, self.specular_albedos, entry, si.is_valid())

    def albedo(self, si: Any, bsdf: Any, active: Any) -> Any:
        """Albedo of the diffuse lobe, 0..1; Color3f."""
        is_diffuse = active & has_lobe(bsdf.flags(), "DiffuseReflection", "DiffuseTransmission")
        is_front = si.wi.z > 0.0

        # Look through masks and maps, along the normal: below a coat that is seen at a grazing angle the
        # albedo would be nearly 0, while a map's slopes reflect more.
        base = self._base(si, bsdf)
        is_outside = is_front | _of(self._turned, si, bsdf)
        along_normal = mi.Vector3f(0.0, 0.0, dr.select(is_outside, mi.Float(1.0), -1.0))
        inner = mi.SurfaceInteraction3f(si)
        inner.wi = dr.select(_number(base) != _number(bsdf), along_normal, si.wi)

        # Evaluate the diffuse component, or the reflectance where a BSDF does not tell it apart.
        is_own = is_diffuse & _of(self._unsplit, si, base)
        albedo = dr.pi * base.eval(self._diffuse, inner, along_normal, is_diffuse & ~is_own)
        if self._has_unsplit:
            own = base.eval_diffuse_reflectance(inner, is_own)
            for name, scale in NOT_DIFFUSE.items():
                has_it = is_own & base.has_attribute(name, is_own)
                own *= 1.0 - dr.select(has_it, scale * base.eval_attribute_1(name, inner, has_it), 0.0)
            is_on_side = dr.select(is_front, *(_of(side, si, bsdf) for side in self._sides))
            albedo = dr.select(is_own, dr.select(is_on_side, own, 0.0), albedo)
        if self._has_masked:
            is_masked = is_diffuse & _of(self._masked, si, bsdf)
            albedo *= dr.select(is_masked, _opacity(si, bsdf, is_masked), 1.0)
        parts = (albedo.x, albedo.y, albedo.z)
        return mi.Color3f(*(dr.select(is_diffuse & dr.isfinite(c), dr.clip(c, 0.0, 1.0), 0.0) for c in parts))

    def _base(self, si: Any, bsdf: Any) -> Any:
        """The BSDFs below masks and maps, on the viewer's side."""
        numbers = (_of(table, si, bsdf) for table in self._bases)
        base: Any = dr.reinterpret_array(mi.BSDFPtr, dr.select(si.wi.z > 0.0, *numbers))
        return base

    def eval_diffuse(self, si: Any, bsdf: Any, albedo: Any, wo: Any, active: Any) -> tuple[Any, Any]:
        """Diffuse lobe times cosine, and the density of :meth:`sample_diffuse`."""
        is_unsplit = _of(self._unsplit, si, bsdf)
        value, pdf = bsdf.eval_pdf(self._diffuse, si, wo, active & ~is_unsplit)
        lambert, lambert_pdf = _lambert(si, wo, albedo)
        return dr.select(is_unsplit, lambert, value), dr.select(is_unsplit, lambert_pdf, pdf)

    def sample_diffuse(
        self, si: Any, bsdf: Any, albedo: Any, sampler: Any, active: Any
    ) -> tuple[Any, Any, Any]:
        """Direction, density and weight of a sample of the diffuse lobe."""
        is_unsplit = _of(self._unsplit, si, bsdf)
        second, first = mi.Point2f(sampler.next_2d()), sampler.next_1d()
        sample, weight = bsdf.sample(self._diffuse, si, first, second, active & ~is_unsplit)
        up = _cosine_direction(si, second)
        wo = dr.select(is_unsplit, up, sample.wo)
        pdf = dr.select(is_unsplit, dr.abs(up.z) / dr.pi, sample.pdf)
        return wo, pdf, dr.select(is_unsplit, albedo, weight)

    def eval_specular(self, si: Any, bsdf: Any, albedo: Any, wo: Any, active: Any) -> tuple[Any, Any]:
        """Specular lobes times cosine, and the density of :meth:`sample_specular`."""
        is_unsplit = _of(self._unsplit, si, bsdf)
        value, pdf = bsdf.eval_pdf(self._specular, si, wo, active & ~is_unsplit)
        difference, mixture_pdf = self._difference(si, bsdf, wo, albedo, active & is_unsplit)
        return dr.select(is_unsplit, difference, value), dr.select(is_unsplit, mixture_pdf, pdf)

    def specular_tint(self, si: Any, bsdf: Any, active: Any) -> tuple[Any, Any]:
        """Approximate reflectance of the specular lobes, Color3f, and whether textures of a metal colour it.

        It does not depend on the slopes of a map. Other surfaces than such metals have a mean of their BSDF,
        and those that are not active 0.
        """
        base = self._base(si, bsdf)
        is_textured = active & _of(self._textured_metal, si, bsdf)
        is_principled = is_textured & base.has_attribute("base_color", is_textured)
        is_conductor = is_textured & ~is_principled
        color = base.eval_attribute("base_color", si, is_principled)
        metallic = base.eval_attribute_1("metallic", si, is_principled)
        conductor = base.eval_attribute("specular_reflectance", si, is_conductor)
        # Schlick's approximation, as of `principled`: at grazing angles the texture has less contrast.
        grazing = dr.power(1.0 - dr.minimum(dr.abs(si.wi.z), 1.0), 5.0)
        principled = dr.lerp(dr.lerp(DIELECTRIC_TINT, color, metallic), 1.0, grazing)
        metal = dr.select(is_principled, principled, conductor)
        plain = dr.gather(Float, self.specular_albedos, _albedo_entry(_number(bsdf), Float(1)), active)
        if self._has_masked:  # what is seen through a cut-out has not its colour
            is_masked = is_textured & _of(self._masked, si, bsdf)
            metal = dr.lerp(1.0, metal, dr.select(is_masked, _opacity(si, bsdf, is_masked), 1.0))
        tint = dr.maximum(dr.select(is_textured, metal, mi.Color3f(dr.minimum(plain, 1.0))), MIN_TINT)
        return dr.select(active, tint, 0.0), is_textured

    def is_clear(self, si: Any, bsdf: Any) -> Any:
        """Whether a BSDF is a clear interface: it reflects or transmits, in one direction each."""
        return _of(self._clear, si, bsdf)

    def is_solid(self, si: Any, bsdf: Any) -> Any:
        """Whether a BSDF is an interface with a refractive medium on its inner side."""
        return _of(self._solid, si, bsdf)

    def is_rough_interface(self, si: Any, bsdf: Any) -> Any:
        """Whether a BSDF is a rough interface: it reflects or transmits, by one lobe each."""
        return _of(self._rough_ior, si, bsdf) > 0.0

    def is_narrow(self, si: Any, bsdf: Any) -> Any:
        """Whether all lobes of a BSDF are narrow enough to show images, as those of a mirror do."""
        return _of(self._narrow, si, bsdf)

    def is_coated(self, si: Any, bsdf: Any) -> Any:
        """Whether a BSDF is a diffuse one below a smooth coat."""
        return _of(self._coated, si, bsdf)

    def coat_reflection(self, si: Any, bsdf: Any, active: Any) -> tuple[Any, Any]:
        """Direction into which a smooth coat reflects, and the weight of the light from there."""
        sample, weight = bsdf.sample(self._specular, si, Float(0), mi.Point2f(0), active)
        return sample.wo, weight

    def sample_specular(
        self, si: Any, bsdf: Any, albedo: Any, sampler: Any, choice: Any = None, branch: Any = None
    ) -> tuple[Any, ...]:
        """Direction, density, weight of a sample; whether it is of a delta lobe, and if a null interaction.

        The difference between a whole BSDF and its Lambertian lobe is sampled by either, the latter with half
        of its albedo as probability, so that the weight stays bounded where only one of them is large. Paths
        pass a masked Lambertian BSDF: only its null interaction counts. A given `choice` of the
        lobe, 0..1, yields a direction of that lobe, and a weight without meaning. A branch of an interface
        has its own weight: what is reflected, or transmitted; the density remains that of both.
        """
        is_unsplit = _of(self._unsplit, si, bsdf)
        first, second = sampler.next_1d(), mi.Point2f(sampler.next_2d())
        is_masked = is_unsplit & _of(self._lambertian, si, bsdf)
        share = _bsdf_share(albedo)
        by_bsdf = sampler.next_1d() < share
        if choice is not None:
            is_last = is_unsplit & self.is_rough_interface(si, bsdf)  # `principled` chooses reflection last
            first, by_bsdf = dr.select(is_last, 1.0 - choice, choice), Bool(True)
        if branch is not None:
            # The first number chooses the branch: reflection at 0, but of `principled` at 1.
            is_clear, is_rough = self.is_clear(si, bsdf), self.is_rough_interface(si, bsdf)
            is_reflected = branch == int(Branch.REFLECTED)
            is_first = is_reflected ^ is_unsplit
            first = dr.select(is_clear | is_rough, dr.select(is_first, 0.0, ALMOST_ONE), first)
        sample, weight = self._sampled(self._specular, si, bsdf, first, second, ~is_unsplit)
        whole, whole_weight = self._sampled(self._all, si, bsdf, first, second, is_unsplit)
        kind = dr.select(is_unsplit, whole.sampled_type, sample.sampled_type)
        is_null = mi.has_flag(kind, mi.BSDFFlags.Null) & (~is_unsplit | by_bsdf)
        is_delta = mi.has_flag(kind, mi.BSDFFlags.Delta) & (~is_unsplit | by_bsdf)  # null interactions, too

        # Weigh a sample of the mixture; a delta lobe only has the density of the BSDF.
        wo = dr.select(by_bsdf, whole.wo, _cosine_direction(si, second))
        is_failed = by_bsdf & (dr.max(whole_weight) == 0.0)  # such as a reflection to below the surface
        difference, pdf = self._difference(si, bsdf, wo, albedo, is_unsplit & ~is_delta & ~is_failed)
        difference = dr.select(pdf > 0.0, difference / pdf, 0.0)
        difference = dr.select(is_delta, whole_weight * dr.rcp(share), difference)
        pdf = dr.select(is_delta, whole.pdf, pdf)

        # Of a masked Lambertian BSDF the null interaction alone counts: all paths pass, without chance.
        if self._has_unsplit:
            passed = bsdf.eval_null_transmission(si, is_masked)
            difference, pdf = dr.select(is_masked, passed, difference), dr.select(is_masked, 1.0, pdf)
            wo = dr.select(is_masked, -si.wi, wo)
            is_null, is_delta = is_null | is_masked, is_delta | is_masked
        wo, weight = dr.select(is_unsplit, wo, sample.wo), dr.select(is_unsplit, difference, weight)
        pdf = dr.select(is_unsplit, pdf, sample.pdf)
        if branch is not None:
            of_branch = self._reflectance(si, bsdf, wo)
            of_branch = dr.select(is_reflected, of_branch, 1.0 - of_branch)
            weight *= dr.select(is_clear, sample.pdf, dr.select(is_rough, of_branch, 1.0))
        return wo, pdf, weight, is_delta, is_null

    def _sampled(
        self, context: Any, si: Any, bsdf: Any, first: Any, second: Any, active: Any
    ) -> tuple[Any, Any]:
        """A sample of a BSDF and its weight; of a delta lobe in a blend without the blend's other BSDF.

        Mitsuba's `blendbsdf` mixes value and density of its other BSDF into samples of either, even of delta
        lobes, whose density is a probability: light is lost or added. What it mixes in is what it evaluates
        in that direction.
        """
        sample, weight = bsdf.sample(context, si, first, second, active)
        if self._has_mixed:
            is_mixed = active & _of(self._mixed, si, bsdf)
            is_mixed &= mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
            value, pdf = bsdf.eval_pdf(context, si, sample.wo, is_mixed)
            own = sample.pdf - pdf
            alone = dr.maximum((weight * sample.pdf - value) / own, 0.0)
            weight = dr.select(is_mixed, dr.select(own > 0.0, alone, 0.0), weight)
            sample.pdf = dr.select(is_mixed, own, sample.pdf)
        return sample, weight

    @cached_property
    def specular_albedos(self) -> Any:
        """Table of :meth:`specular_albedo`, estimated where random rays through the scene hit; Float."""
        sampler = one_sequence(ALBEDO_SAMPLES, ALBEDO_SEED)
        box = self._scene.bbox()

        def random_point() -> Any:
            return box.min + mi.Vector3f(*sampler.next_2d(), sampler.next_1d()) * box.extents()

        start, end = random_point(), random_point()
        si = self._scene.ray_intersect(mi.Ray3f(start, dr.normalize(end - start)))
        bsdf = si.bsdf()
        albedo = self.albedo(si, bsdf, si.is_valid())
        _, pdf, weight, *_ = self.sample_specular(si, bsdf, albedo, sampler)
        value = dr.select(pdf > 0.0, dr.max(dr.abs(weight)), 0.0)
        entry = _albedo_entry(_number(bsdf), si.wi.z)
        dr.eval(value, entry)

        # NumPy adds in a fixed order.
        valid = np.array(si.is_valid()) & np.isfinite(np.array(value))
        entry, size = np.array(entry)[valid], len(self._unsplit) * ALBEDO_BINS
        count = np.bincount(entry, minlength=size)
        total = np.bincount(entry, np.array(value)[valid], minlength=size)
        mean = np.where(count >= MIN_ALBEDO_SAMPLES, total / np.maximum(count, 1), 1.0)
        return lanes(mean.astype(np.float32))

    def _reflectance(self, si: Any, bsdf: Any, wo: Any) -> Any:
        """Probability with which the sample of a rough interface reflects, at the facet that it met."""
        ior = dr.maximum(_of(self._rough_ior, si, bsdf), 1e-3)
        ratio = dr.select(si.wi.z > 0.0, ior, dr.rcp(ior))
        facet = dr.normalize(si.wi + wo * dr.select(si.wi.z * wo.z > 0.0, 1.0, ratio))
        return mi.fresnel(dr.select(facet.z > 0.0, 1.0, -1.0) * dr.dot(si.wi, facet), ior)[0]

    def _difference(self, si: Any, bsdf: Any, wo: Any, albedo: Any, active: Any) -> tuple[Any, Any]:
        """A whole BSDF minus its Lambertian lobe, and the density of the mixture of both."""
        whole, whole_pdf = bsdf.eval_pdf(self._all, si, wo, active)
        lambert, lambert_pdf = _lambert(si, wo, albedo)
        pdf = dr.lerp(lambert_pdf, whole_pdf, _bsdf_share(albedo))
        return dr.select(active, whole - lambert, 0.0), dr.select(active, pdf, 0.0)


def _bsdf_share(albedo: Any) -> Any:
    """Probability with which the difference from a Lambertian lobe is sampled by the BSDF."""
    return 1.0 - 0.5 * dr.max(albedo)


def _lambert(si: Any, wo: Any, albedo: Any) -> tuple[Any, Any]:
    """A Lambertian lobe times cosine, and its density."""
    pdf = dr.select(wo.z * si.wi.z > 0.0, dr.abs(wo.z) / dr.pi, 0.0)
    return albedo * pdf, pdf


def _of(table: Any, si: Any, bsdf: Any) -> Any:
    """Entries of a table of BSDFs, of its type."""
    return dr.gather(type(table), table, _number(bsdf), si.is_valid())


def _number(bsdf: Any) -> Any:
    """Numbers of BSDFs in Dr.Jit's registry; UInt."""
    number: Any = dr.reinterpret_array(UInt, bsdf)
    return number


def _albedo_entry(number: Any, cosine: Any) -> Any:
    """Entries of the table of specular albedos; UInt."""
    cosine = dr.select(dr.isfinite(cosine), cosine, 0.0)  # normals that cancel out have none
    return number * ALBEDO_BINS + UInt(dr.clip((0.5 + 0.5 * cosine) * ALBEDO_BINS, 0.0, ALBEDO_BINS - 1))


def _opacity(si: Any, bsdf: Any, active: Any) -> Any:
    # Not `dr.mean`: it compiles the number of lanes into the kernel.
    transmitted = bsdf.eval_null_transmission(si, active)
    return 1.0 - (transmitted.x + transmitted.y + transmitted.z) / 3.0


def _cosine_direction(si: Any, sample_point: Any) -> Any:
    """A cosine-distributed direction in the hemisphere of the viewer."""
    up = mi.warp.square_to_cosine_hemisphere(sample_point)
    return mi.Vector3f(up.x, up.y, dr.copysign(up.z, si.wi.z))
