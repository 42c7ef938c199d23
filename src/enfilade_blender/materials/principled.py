# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's Principled BSDF, by what its inputs make of it: plastic, metal, glass, with coat and sheen."""

from __future__ import annotations

import numpy as np

from enfilade_blender.materials import mapping
from enfilade_blender.materials.bsdfs import blend, layered, plastic_bsdf, with_normal
from enfilade_blender.materials.context import Context
from enfilade_blender.materials.microfacets import SMOOTH, WHITE, clipped, conductor_bsdf, glass_bsdf
from enfilade_blender.materials.values import ALMOST, Constant, Principled, is_zero
from enfilade_blender.notes import Kind
from enfilade_blender.scene_xml import Element, Property

# Layers in place of sheen: roughness of the sheen, and what is nearest to the albedo that Cycles 4.5 gives it
# over directions: the mean albedo, and the index of a dielectric layer of one roughness.
SHEENS = np.array(
    [
        [0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0],
        [0.0, 0.01, 0.031, 0.066, 0.114, 0.173, 0.24, 0.31, 0.379, 0.445],
        [1.02, 1.02, 1.02, 1.02, 1.05, 1.1, 1.2, 1.35, 1.5, 2.0],
    ]
)
SHEEN_LAYER = Constant((1.0,))  # roughness


def principled_bsdf(shader: Principled, context: Context) -> Element:
    """BSDF of the Principled BSDF, without its emission and opacity."""

    def plastic() -> Element:
        ior = mapping.interface_ior(shader.number("IOR"), shader.number("Specular IOR Level"))
        return plastic_bsdf(shader["Base Color"], shader["Roughness"], ior, context)

    def dielectric() -> Element:
        return blend(shader["Transmission Weight"], plastic, lambda: _glass(shader, context), context)

    whole = blend(shader["Metallic"], dielectric, lambda: _metal(shader, context), context)
    whole = with_normal(whole, shader.normal, context)  # which a coat has not
    coat_ior, coat_roughness = shader.number("Coat IOR"), shader["Coat Roughness"]
    whole = layered(whole, shader["Coat Weight"], coat_ior, coat_roughness, WHITE, context)
    tint = context.textures.mean(shader["Sheen Tint"])
    roughness = Constant(context.textures.mean(shader["Sheen Roughness"])).number
    mean, ior = (float(np.interp(roughness, SHEENS[0], row)) for row in SHEENS[1:])
    whole = layered(whole, shader["Sheen Weight"], ior, SHEEN_LAYER, tint, context, mean=mean)
    _note_principled(shader, context)
    return whole


def _glass(shader: Principled, context: Context) -> Element:
    # Twice through an interface is once through the colour.
    tint = context.textures.root(shader["Base Color"])
    return glass_bsdf(
        tint, Constant(WHITE), shader["Roughness"], shader.number("IOR"), context,
        is_multiple=shader.is_multiple,
    )  # fmt: skip


def _metal(shader: Principled, context: Context) -> Element:
    edge = context.textures.mean(shader["Specular Tint"])
    anisotropy, roughness = shader.number("Anisotropic"), shader["Roughness"]
    extra: dict[str, Property] = {}
    if anisotropy > 0.0 and isinstance(roughness, Constant):
        aspect = (1.0 - 0.9 * anisotropy) ** 0.5
        alpha = max(clipped(roughness.number) ** 2, SMOOTH)
        extra = {"alpha_u": alpha / aspect, "alpha_v": alpha * aspect}
    return conductor_bsdf(
        shader["Base Color"], roughness, extra, context, edge=edge, is_multiple=shader.is_multiple
    )


def _note_principled(shader: Principled, context: Context) -> None:
    """Notes on inputs that are not, or not exactly, carried over."""

    def note(kind: Kind, name: str, what: str, effect: str) -> None:
        context.notes.add(kind, context.owner, f"{shader.name}: {name}", what, effect)

    effects: dict[str, tuple[str, str]] = {
        "Sheen Weight": ("a rough dielectric layer", "edges are a little darker"),
        "Subsurface Weight": ("diffuse reflection", "light does not spread below the surface"),
        "Thin Film Thickness": ("the thin film is left out", "there are no interference colours"),
        "Diffuse Roughness": ("the roughness of diffuse reflection is left out", "the surface is Lambertian"),
    }
    for name, (what, effect) in effects.items():
        if not is_zero(shader[name]):
            note("not-carried" if "left out" in what else "approximated", name, what, effect)
    is_metal = not is_zero(shader["Metallic"])
    if not is_zero(shader["Anisotropic"]):
        _note_anisotropic(shader, context)
    if is_metal and not isinstance(shader["Base Color"], Constant):
        what = "a metal's texture is its reflectance at all angles"
        note("approximated", "Base Color", what, "its edges are not brighter")
    if not is_metal and min(context.textures.mean(shader["Specular Tint"])) < ALMOST:
        what = "the tint of reflections is left out"
        note("not-carried", "Specular Tint", what, "reflections have the colour of the light")
    if not is_zero(shader["Coat Weight"]) and min(context.textures.mean(shader["Coat Tint"])) < ALMOST:
        note("not-carried", "Coat Tint", "the tint of the coat is left out", "what lies below is brighter")
    for name in ("IOR", "Specular IOR Level", "Coat IOR"):
        if not isinstance(shader[name], Constant):
            effect = "reflections have the same strength everywhere"
            note("approximated", name, "a texture is left out", effect)


def _note_anisotropic(shader: Principled, context: Context) -> None:
    is_constant = all(isinstance(shader[name], Constant) for name in ("Anisotropic", "Roughness"))
    if is_zero(shader["Metallic"]) or not is_constant:
        what, effect = "its anisotropy is left out", "highlights are round"
        context.notes.add("not-carried", context.owner, f"{shader.name}: Anisotropic", what, effect)
        return
    what, effect = "highlights are stretched along the UV map", "their direction differs from that of Tangent"
    context.notes.add("approximated", context.owner, f"{shader.name}: Anisotropic", what, effect)
    if not is_zero(shader["Anisotropic Rotation"]):
        what, effect = "the rotation is left out", "highlights are stretched in another direction"
        context.notes.add("not-carried", context.owner, f"{shader.name}: Anisotropic Rotation", what, effect)
