# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's Principled BSDF, by what its inputs make of it: plastic, metal, glass, with coat and sheen."""

from __future__ import annotations

from enfilade_blender.materials import mapping
from enfilade_blender.materials.bsdfs import (
    ALMOST,
    ALPHA_MIN,
    WHITE,
    Context,
    blend,
    conductor_bsdf,
    glass_bsdf,
    is_one,
    is_zero,
    layered,
    plastic_bsdf,
    with_normal,
)
from enfilade_blender.materials.values import Constant, Principled, Value
from enfilade_blender.notes import Kind
from enfilade_blender.scene_xml import Element, Property

SHEEN_IOR, SHEEN_ROUGHNESS = 1.5, Constant((0.7,))
ENAMEL_ROUGHNESS = 0.5  # a base of more is diffuse below its coat


def principled_bsdf(shader: Principled, context: Context) -> Element:
    """BSDF of the Principled BSDF, without its emission and opacity."""
    coat, coat_roughness = _input(shader, "Coat Weight", 0.0), _input(shader, "Coat Roughness", 0.03)
    coat_ior = _number(shader, "Coat IOR", 1.5)
    is_enamel = _is_enamel(shader)

    def plastic() -> Element:
        if is_enamel:
            return plastic_bsdf(_input(shader, "Base Color", 0.8), coat_roughness, coat_ior, context)
        return _plastic(shader, context)

    def opaque() -> Element:
        return blend(_input(shader, "Metallic", 0.0), plastic, lambda: _metal(shader, context), context)

    transmission = _input(shader, "Transmission Weight", 0.0)
    whole = blend(transmission, opaque, lambda: _principled_glass(shader, context), context)
    if not is_enamel:
        whole = layered(whole, coat, coat_ior, coat_roughness, WHITE, context)
    tint = context.textures.mean(_input(shader, "Sheen Tint", 1.0))
    whole = layered(whole, _input(shader, "Sheen Weight", 0.0), SHEEN_IOR, SHEEN_ROUGHNESS, tint, context)
    _note_principled(shader, context)
    return with_normal(whole, shader.normal, context)


def _is_enamel(shader: Principled) -> bool:
    """Whether a coat hides the interface of a rough base: the coat's `roughplastic` is sampled well."""
    roughness = _input(shader, "Roughness", 0.5)
    is_rough = isinstance(roughness, Constant) and roughness.number >= ENAMEL_ROUGHNESS
    is_plastic = is_zero(_input(shader, "Metallic", 0.0)) and is_zero(
        _input(shader, "Transmission Weight", 0.0)
    )
    return is_rough and is_plastic and is_one(_input(shader, "Coat Weight", 0.0))


def _principled_glass(shader: Principled, context: Context) -> Element:
    base = _input(shader, "Base Color", 0.8)
    tint: Value = base
    if isinstance(base, Constant):  # twice through an interface is once through the colour
        tint = Constant(tuple(max(c, 0.0) ** 0.5 for c in base.colour))
    return glass_bsdf(
        tint, Constant(WHITE), _input(shader, "Roughness", 0.5), _number(shader, "IOR", 1.45), context
    )


def _plastic(shader: Principled, context: Context) -> Element:
    ior = mapping.interface_ior(_number(shader, "IOR", 1.45), _number(shader, "Specular IOR Level", 0.5))
    base, roughness = _input(shader, "Base Color", 0.8), _input(shader, "Roughness", 0.5)
    return plastic_bsdf(base, roughness, ior, context)


def _metal(shader: Principled, context: Context) -> Element:
    edge = context.textures.mean(_input(shader, "Specular Tint", 1.0))
    anisotropy = _number(shader, "Anisotropic", 0.0)
    extra: dict[str, Property] = {}
    roughness = _input(shader, "Roughness", 0.5)
    if anisotropy > 0.0 and isinstance(roughness, Constant):
        aspect = (1.0 - 0.9 * anisotropy) ** 0.5
        alpha = max(roughness.number**2, ALPHA_MIN)
        extra = {"alpha_u": alpha / aspect, "alpha_v": alpha * aspect}
    base = _input(shader, "Base Color", 0.8)
    return conductor_bsdf(base, roughness, extra, context, edge=edge)


def _input(shader: Principled, name: str, default: float) -> Value:
    return shader.inputs.get(name, Constant((default,)))


def _number(shader: Principled, name: str, default: float) -> float:
    value = _input(shader, name, default)
    return value.number if isinstance(value, Constant) else default


def _note_principled(shader: Principled, context: Context) -> None:
    """Notes on inputs that are not, or not exactly, carried over."""
    effects: dict[str, tuple[str, str]] = {
        "Sheen Weight": ("a rough dielectric layer", "brightness of edges differs a little"),
        "Subsurface Weight": ("diffuse reflection", "light does not spread below the surface"),
        "Thin Film Thickness": ("the thin film is left out", "there are no interference colours"),
        "Diffuse Roughness": ("the roughness of diffuse reflection is left out", "the surface is Lambertian"),
    }
    for name, (what, effect) in effects.items():
        if not is_zero(_input(shader, name, 0.0)):
            kind: Kind = "not-carried" if "left out" in what else "approximated"
            context.notes.add(kind, context.owner, f"{shader.name}: {name}", what, effect)
    is_metal = not is_zero(_input(shader, "Metallic", 0.0))
    if is_metal and not isinstance(_input(shader, "Base Color", 0.8), Constant):
        what, effect = "a metal's texture is its reflectance at all angles", "its edges are not brighter"
        context.notes.add("approximated", context.owner, f"{shader.name}: Base Color", what, effect)
    if not is_metal and min(context.textures.mean(_input(shader, "Specular Tint", 1.0))) < ALMOST:
        what, effect = "the tint of reflections is left out", "reflections have the colour of the light"
        context.notes.add("not-carried", context.owner, f"{shader.name}: Specular Tint", what, effect)
    for name in ("IOR", "Specular IOR Level"):
        if not isinstance(_input(shader, name, 0.5), Constant):
            effect = "reflections have the same strength everywhere"
            context.notes.add(
                "approximated", context.owner, f"{shader.name}: {name}", "a texture is left out", effect
            )
