# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces: a BSDF, its opacity, and the radiance that it emits, of a tree of shaders."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from enfilade_blender.image_files import F32
from enfilade_blender.materials import mapping
from enfilade_blender.materials.bsdfs import (
    blended,
    layered,
    lobe_bsdf,
    plastic_bsdf,
    two_sided,
    with_normal,
)
from enfilade_blender.materials.context import Context
from enfilade_blender.materials.microfacets import glass_bsdf
from enfilade_blender.materials.principled import principled_bsdf
from enfilade_blender.materials.values import (
    ALMOST,
    Add,
    Constant,
    Emission,
    ImageValue,
    Lobe,
    Mix,
    Nothing,
    Principled,
    Shader,
    Texture,
    Value,
    is_one,
    is_zero,
)
from enfilade_blender.scene_xml import Element, plugin

ONE = Constant((1.0, 1.0, 1.0))
BLACK = (0.0, 0.0, 0.0)
SHARP = 0.03  # roughness of a pane below which its reflections are sharp
DIM = 0.25  # radiance below which a texture of 8 bits has too few levels


@dataclass(frozen=True, eq=False)
class Factor:
    """A textured number that emitted radiance is multiplied by.

    Attributes
    ----------
    value : Value
    is_share : bool
        Whether it is clipped to 0..1, as opacities and factors of mixes are; strengths are not.
    is_inverted : bool
        Whether 1 minus the share is meant.
    """

    value: Value
    is_share: bool
    is_inverted: bool

    def of(self, numbers: F32) -> F32:
        """The factors of the value's numbers."""
        if not self.is_share:
            return numbers
        share: F32 = np.clip(numbers, np.float32(0), np.float32(1))
        return np.float32(1) - share if self.is_inverted else share


@dataclass(frozen=True, eq=False)
class Radiance:
    """Emitted radiance: a colour times a strength and factors."""

    colour: Value
    strength: float = 1.0
    factors: tuple[Factor, ...] = ()

    def scaled(self, value: Value, *, is_share: bool = True, is_inverted: bool = False) -> Radiance:
        """The radiance times a number; see :class:`Factor`."""
        factor = Factor(value, is_share, is_inverted)
        if isinstance(value, Constant):
            return replace(
                self, strength=self.strength * float(factor.of(np.array(value.number, np.float32)))
            )
        return replace(self, factors=(*self.factors, factor))


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface of Mitsuba.

    Attributes
    ----------
    bsdf : Element or None
        None: black, of shaders that only emit.
    opacity : Value
        1 is opaque.
    opacity_is_inverted : bool
        Whether 1 minus the value is the opacity.
    emitted : tuple of Radiance
        Their sum is emitted.
    """

    bsdf: Element | None
    opacity: Value = ONE
    opacity_is_inverted: bool = False
    emitted: tuple[Radiance, ...] = ()

    @property
    def is_invisible(self) -> bool:
        """Whether everything passes through the surface."""
        return is_zero(self.opacity) and not self.opacity_is_inverted

    def plain(self) -> Element:
        """BSDF without its opacity, of one side; black where there is none."""
        return self.bsdf if self.bsdf is not None else plugin("bsdf", "diffuse", reflectance=BLACK)

    def element(self, context: Context, back: Surface | None = None) -> Element:
        """BSDF with its opacity; `back` is the surface as built for the other side."""
        bsdf = two_sided(self.plain(), back and _other(back.plain(), self.plain()))
        if is_one(self.opacity):
            return bsdf
        opacity = context.textures.number(self.opacity)
        if self.opacity_is_inverted:
            opacity = inverted(self.opacity, context)
        return plugin("bsdf", "mask", bsdf, opacity=opacity)

    def radiance(self, context: Context) -> tuple[float, float, float] | Element | None:
        """Emitted radiance, or None."""
        textures = context.textures
        values = [v for part in self.emitted for v in (part.colour, *(f.value for f in part.factors))]
        images = [value for value in values if textures.has_pixels(value)]
        if images == values and len(values) == 1 and abs(self.emitted[0].strength - 1.0) < 1e-3:
            return textures.colour(images[0])
        place = images[0] if images else None
        total = np.zeros((1, 1, 3), np.float32)
        for part in self.emitted:
            first, second = _of_one_size(total, _product(part, place, context))
            total = first + second
        total = np.maximum(total, np.float32(0))
        if place is None:
            r, g, b = (float(c) for c in total[0, 0])
            return (r, g, b) if max(r, g, b) > 0.0 else None
        name = f"emission {zlib.crc32(total.tobytes()):08x}"
        return textures.rewritten(place, total, name, raw=False, is_exact=bool(total.max() < DIM))


def _product(part: Radiance, place: ImageValue | Texture | None, context: Context) -> F32:
    """Radiance for each pixel of the images that are looked up as `place` is; of others the mean is taken."""
    textures = context.textures

    def pixels(value: Value, of: Callable[[ImageValue | Texture], F32], mean: Sequence[float]) -> F32:
        if place is not None and textures.has_pixels(value):
            if _lookup(value) == _lookup(place):
                return of(value)
            what, effect = "the mean of an image that is mapped differently", "its pattern is lost"
            context.notes.add("approximated", context.owner, "Emission", what, effect)
        return np.array(mean, np.float32)[None, None]

    product = np.float32(part.strength) * pixels(part.colour, textures.pixels, textures.mean(part.colour))
    for factor in part.factors:
        mean = Constant(textures.mean(factor.value)).number
        first, second = _of_one_size(product, factor.of(pixels(factor.value, textures.numbers, [mean])))
        product = first * second
    return product


def _lookup(value: ImageValue | Texture) -> tuple[Any, ...]:
    """How an image is looked up at texture coordinates."""
    return value.matrix, value.node.extension if isinstance(value, ImageValue) else "REPEAT"


def _of_one_size(first: F32, second: F32) -> tuple[F32, F32]:
    """Two images (H, W, 1 or 3), at the size of the larger one."""
    height, width, _ = np.maximum(first.shape, second.shape)

    def resized(image: F32) -> F32:
        rows, columns = (np.arange(n) * of // n for n, of in zip((height, width), image.shape, strict=False))
        return (
            image if len(rows) == len(image) and len(columns) == image.shape[1] else image[rows][:, columns]
        )

    return resized(first), resized(second)


def _other(bsdf: Element, than: Element) -> Element | None:
    """The BSDF, unless it is the same as another: every BSDF makes Mitsuba's kernels slower."""
    return None if ET.tostring(bsdf) == ET.tostring(than) else bsdf


def build(shader: Shader, context: Context) -> Surface:
    """Surface of a shader whose procedural values are baked."""
    if isinstance(shader, Lobe) and shader.kind == "transparent":
        return _veil(shader, context)
    return _part(shader, context)


def _part(shader: Shader, context: Context) -> Surface:
    """Surface of a shader that may be a part of another, in which transparency has no colour."""
    if isinstance(shader, Nothing):
        return Surface(None)
    if isinstance(shader, Emission):
        return Surface(None, emitted=_radiance(shader.colour, shader.strength, context))
    if isinstance(shader, Lobe):
        if shader.kind == "transparent":
            return _transparent(shader, context)
        return Surface(lobe_bsdf(shader, context))
    if isinstance(shader, Principled):
        alpha = shader["Alpha"]
        emitted = _radiance(shader["Emission Color"], shader["Emission Strength"], context)
        surface = Surface(principled_bsdf(shader, context), emitted=emitted)
        return surface if is_one(alpha) else _cut_out(surface, alpha, shader.name, context)
    if isinstance(shader, Add):
        return _sum(shader, context)
    return _mix(shader, context)


def inverted(value: Value, context: Context) -> float | Element:
    """1 minus a value; 0.5 of a missing image or an attribute."""
    if isinstance(value, Constant):
        return 1.0 - value.number
    if context.textures.has_pixels(value):
        pixels = context.textures.numbers(value)
        return context.textures.rewritten(value, 1.0 - pixels, "inverted")
    return 0.5


def _veil(lobe: Lobe, context: Context) -> Surface:
    """Transparency alone: black that passes the luminance of its colour."""
    mean = context.textures.mean(lobe.colour)
    if max(mean) - min(mean) > 1.0 - ALMOST:
        what, effect = "the tint of transparency is left out", "what lies behind is dimmed, but not tinted"
        context.notes.add("not-carried", context.owner, lobe.name, what, effect)
    if isinstance(lobe.colour, Constant):
        return Surface(None, opacity=Constant((1.0 - lobe.colour.number,)))
    return Surface(None, opacity=lobe.colour, opacity_is_inverted=True)


def _transparent(lobe: Lobe, context: Context) -> Surface:
    if not isinstance(lobe.colour, Constant) or min(lobe.colour.colour) < ALMOST:
        what, effect = (
            "the colour of transparency is left out",
            "what lies behind is neither dimmed nor tinted",
        )
        context.notes.add("not-carried", context.owner, lobe.name, what, effect)
    return Surface(None, opacity=Constant((0.0,)))


def _mix(mix: Mix, context: Context) -> Surface:
    """A mix, by what its parts are: a cut-out, a coated surface, thin glass, a light, or two BSDFs."""
    if is_zero(mix.factor) or is_one(mix.factor):
        return _part(mix.second if is_one(mix.factor) else mix.first, context)
    if mix.fresnel_ior is not None and isinstance(mix.second, Lobe):
        if mix.is_pane and isinstance(mix.first, Lobe):
            if context.is_solid:
                what, effect = "glass that shadow rays pass stops them on solid objects", "shadows are darker"
                context.notes.add("approximated", context.owner, mix.name, what, effect)
                return Surface(
                    lobe_bsdf(replace(mix.first, kind="glass", ior=Constant((mix.fresnel_ior,))), context)
                )
            what = "clear glass that shadow rays pass is thin glass"
            effect = (
                "it does not bend what is seen through it; with refractive caustics, Blender counts light "
                "through it twice"
            )
            context.notes.add("approximated", context.owner, mix.name, what, effect)
        return _interface(mix.first, mix.second, mix.fresnel_ior, context)
    first, second = _part(mix.first, context), _part(mix.second, context)
    if first.is_invisible and not first.emitted:
        return _cut_out(second, mix.factor, mix.name, context)
    if second.is_invisible and not second.emitted:
        return _cut_out(first, mix.factor, mix.name, context, is_inverted=True)
    return _blended(first, second, mix, context)


def _interface(below: Shader, above: Lobe, ior: float, context: Context) -> Surface:
    """Glossy over a shader by Fresnel's factor: over diffuse it is plastic, over transparent thin glass.

    Over refraction it is glass.
    """
    if isinstance(below, Lobe) and below.kind == "diffuse":
        if min(context.textures.mean(above.colour)) < ALMOST:
            what, effect = "the tint of reflections is left out", "reflections have the colour of the light"
            context.notes.add("not-carried", context.owner, above.name, what, effect)
        bsdf = plastic_bsdf(below.colour, above.roughness, ior, context)
        return Surface(with_normal(bsdf, below.normal or above.normal, context))
    if isinstance(below, Lobe) and below.kind == "refraction":
        glass = glass_bsdf(
            below.colour, above.colour, below.roughness, ior, context, is_multiple=below.is_multiple
        )
        return Surface(with_normal(glass, below.normal or above.normal, context))
    if above.normal is not None:
        what, effect = "the normals of the glossy layer are left out", "its reflections are even"
        context.notes.add("not-carried", context.owner, above.name, what, effect)
    if isinstance(below, Lobe) and below.kind == "transparent":
        if max(context.textures.mean(above.roughness)) >= SHARP:
            what, effect = "the roughness of reflections is left out", "they are sharp"
            context.notes.add("approximated", context.owner, above.name, what, effect)
        tints = {
            "specular_reflectance": context.textures.colour(above.colour),
            "specular_transmittance": context.textures.colour(below.colour),
        }
        return Surface(plugin("bsdf", "thindielectric", int_ior=mapping.thin_ior(ior), ext_ior=1.0, **tints))
    surface = _part(below, context)
    tint = context.textures.mean(above.colour)
    return replace(surface, bsdf=layered(surface.plain(), ONE, ior, above.roughness, tint, context))


def _cut_out(
    surface: Surface, factor: Value, node: str, context: Context, *, is_inverted: bool = False
) -> Surface:
    """A surface below an opacity, which also scales what it emits."""
    if surface.is_invisible and not surface.emitted:
        return surface
    if not is_one(surface.opacity):
        what, effect = "two opacities; the outer one is kept", "the surface is less transparent"
        context.notes.add("approximated", context.owner, node, what, effect)
    scaled = (part.scaled(factor, is_inverted=is_inverted) for part in surface.emitted)
    emitted = tuple(part for part in scaled if part.strength > 0.0)
    return replace(surface, opacity=factor, opacity_is_inverted=is_inverted, emitted=emitted)


def _blended(first: Surface, second: Surface, mix: Mix, context: Context) -> Surface:
    parts = [part.scaled(mix.factor, is_inverted=True) for part in first.emitted]
    parts += [part.scaled(mix.factor) for part in second.emitted]
    emitted = tuple(part for part in parts if part.strength > 0.0)
    if first.bsdf is None and second.bsdf is None and first.opacity == second.opacity:
        return replace(first, emitted=emitted)
    bsdfs = _masked(first, context), _masked(second, context)
    return Surface(blended(*bsdfs, context.textures.number(mix.factor)), emitted=emitted)


def _sum(add: Add, context: Context) -> Surface:
    first, second = _part(add.first, context), _part(add.second, context)
    emitted = (*first.emitted, *second.emitted)
    if first.bsdf is None and not first.is_invisible:
        return replace(second, emitted=emitted)
    if second.bsdf is None and not second.is_invisible:
        return replace(first, emitted=emitted)
    if first.is_invisible and second.is_invisible:
        return replace(first, emitted=emitted)
    what, effect = "a sum of two BSDFs is a mix of equal shares", "the surface is darker"
    if first.is_invisible or second.is_invisible:
        effect = "half of the light passes through the surface, and the other half meets it"
    context.notes.add("approximated", context.owner, add.name, what, effect)
    return Surface(blended(_masked(first, context), _masked(second, context), 0.5), emitted=emitted)


def _masked(surface: Surface, context: Context) -> Element:
    """BSDF with its opacity, as a part of another."""
    return surface.plain() if is_one(surface.opacity) else surface.element(context)


def _radiance(colour: Value, strength: Value, context: Context) -> tuple[Radiance, ...]:
    if _takes_light(colour, strength):
        what, effect = "its negative light is left out", "surfaces are brighter: Blender takes light away"
        context.notes.add("not-carried", context.owner, "Emission", what, effect)
    if is_zero_exactly(strength) or is_zero_exactly(colour):
        return ()
    return (Radiance(colour).scaled(strength, is_share=False),)


def _takes_light(colour: Value, strength: Value) -> bool:
    """Whether an emission is negative by its constants."""
    first, second = (value if isinstance(value, Constant) else ONE for value in (colour, strength))
    return min(a * b for a, b in zip(first.colour, second.colour, strict=True)) < 0.0


def is_zero_exactly(value: Value) -> bool:
    """Whether a value is 0 everywhere; an emission of 0.001 is one."""
    return isinstance(value, Constant) and max(value.colour) <= 0.0
