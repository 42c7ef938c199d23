# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces: a BSDF, its opacity, and the radiance that it emits, of a tree of shaders."""

from __future__ import annotations

from dataclasses import dataclass, replace
from xml.etree import ElementTree as ET

from enfilade_blender.materials import mapping
from enfilade_blender.materials.bsdfs import (
    ALMOST,
    Context,
    blended,
    is_one,
    is_zero,
    layered,
    lobe_bsdf,
    plastic_bsdf,
    two_sided,
    with_normal,
)
from enfilade_blender.materials.principled import principled_bsdf
from enfilade_blender.materials.values import (
    Add,
    Constant,
    Emission,
    Lobe,
    Mix,
    Nothing,
    Principled,
    Shader,
    Value,
)
from enfilade_blender.scene_xml import Element, plugin

ONE = Constant((1.0, 1.0, 1.0))
BLACK = (0.0, 0.0, 0.0)
SHARP = 0.03  # roughness of a pane below which its reflections are sharp


@dataclass(frozen=True, eq=False)
class Radiance:
    """Emitted radiance: a colour or texture times a number."""

    colour: Value
    strength: float


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
        Empty, or one.
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
        if not self.emitted:
            return None
        (radiance,) = self.emitted
        if isinstance(radiance.colour, Constant):
            r, g, b = (max(c * radiance.strength, 0.0) for c in radiance.colour.colour)
            return (r, g, b) if max(r, g, b) > 0.0 else None
        if not context.textures.has_pixels(radiance.colour):
            return (0.5 * radiance.strength,) * 3
        if abs(radiance.strength - 1.0) < 1e-3:
            return context.textures.colour(radiance.colour)
        scaled = context.textures.pixels(radiance.colour) * radiance.strength
        name = f"emission {radiance.strength:.3g}"
        return context.textures.rewritten(radiance.colour, scaled, name, raw=False)


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
    """Glossy over a shader by Fresnel's factor: over diffuse it is plastic, over transparent thin glass."""
    if isinstance(below, Lobe) and below.kind == "diffuse":
        if min(context.textures.mean(above.colour)) < ALMOST:
            what, effect = "the tint of reflections is left out", "reflections have the colour of the light"
            context.notes.add("not-carried", context.owner, above.name, what, effect)
        bsdf = plastic_bsdf(below.colour, above.roughness, ior, context)
        return Surface(with_normal(bsdf, below.normal or above.normal, context))
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
    emitted = surface.emitted
    if emitted and isinstance(factor, Constant):
        share = 1.0 - factor.number if is_inverted else factor.number
        emitted = tuple(replace(part, strength=part.strength * share) for part in emitted if share > 0.0)
    elif emitted:
        what, effect = "light is emitted where the surface is transparent, too", "the cut-out shines"
        context.notes.add("approximated", context.owner, node, what, effect)
    return replace(surface, opacity=factor, opacity_is_inverted=is_inverted, emitted=emitted)


def _blended(first: Surface, second: Surface, mix: Mix, context: Context) -> Surface:
    factor = mix.factor if isinstance(mix.factor, Constant) else None
    share = factor.number if factor else Constant(context.textures.mean(mix.factor)).number
    emitted = [replace(part, strength=part.strength * (1.0 - share)) for part in first.emitted]
    emitted += [replace(part, strength=part.strength * share) for part in second.emitted]
    if emitted and factor is None:
        what, effect = "emission by the mean of a textured factor", "light is even over the surface"
        context.notes.add("approximated", context.owner, mix.name, what, effect)
    if first.bsdf is None and second.bsdf is None and first.opacity == second.opacity:
        return replace(first, emitted=_joined(emitted, mix, context))
    parts = _masked(first, context), _masked(second, context)
    bsdf = blended(*parts, context.textures.number(mix.factor))
    return Surface(bsdf, emitted=_joined(emitted, mix, context))


def _sum(add: Add, context: Context) -> Surface:
    first, second = _part(add.first, context), _part(add.second, context)
    emitted = _joined([*first.emitted, *second.emitted], add, context)
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


def _joined(emitted: list[Radiance], shader: Mix | Add, context: Context) -> tuple[Radiance, ...]:
    """At most one radiance: constants are added, of textures the strongest is kept."""
    lit = [part for part in emitted if part.strength > 0.0]
    if len(lit) <= 1:
        return tuple(lit)
    if all(isinstance(part.colour, Constant) for part in lit):
        total = [
            sum(part.colour.colour[i] * part.strength for part in lit if isinstance(part.colour, Constant))
            for i in range(3)
        ]
        return (Radiance(Constant(tuple(total)), 1.0),)
    what, effect = "of two emissions the stronger is kept", "the surface shines less"
    context.notes.add("approximated", context.owner, shader.name, what, effect)
    return (max(lit, key=lambda part: part.strength * sum(context.textures.mean(part.colour))),)


def _radiance(colour: Value, strength: Value, context: Context) -> tuple[Radiance, ...]:
    if _takes_light(colour, strength):
        what, effect = "its negative light is left out", "surfaces are brighter: Blender takes light away"
        context.notes.add("not-carried", context.owner, "Emission", what, effect)
    if is_zero_exactly(strength) or is_zero_exactly(colour):
        return ()
    if isinstance(strength, Constant):
        return (Radiance(colour, strength.number),)
    if isinstance(colour, Constant) and max(colour.colour) - min(colour.colour) < 1e-6:
        return (Radiance(strength, colour.number),)
    effect = "the pattern of the emission's strength is lost"
    context.notes.add(
        "approximated", context.owner, "Emission", "a textured strength is taken as its mean", effect
    )
    return (Radiance(colour, Constant(context.textures.mean(strength)).number),)


def _takes_light(colour: Value, strength: Value) -> bool:
    """Whether an emission is negative by its constants."""
    first, second = (value if isinstance(value, Constant) else ONE for value in (colour, strength))
    return min(a * b for a, b in zip(first.colour, second.colour, strict=True)) < 0.0


def is_zero_exactly(value: Value) -> bool:
    """Whether a value is 0 everywhere; an emission of 0.001 is one."""
    return isinstance(value, Constant) and max(value.colour) <= 0.0
