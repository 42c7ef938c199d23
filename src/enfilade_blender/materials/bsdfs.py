# SPDX-License-Identifier: GPL-3.0-or-later
"""BSDFs of Mitsuba for Blender's lobes and its Principled BSDF."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from enfilade_blender.materials import ggx, mapping
from enfilade_blender.materials.textures import Textures
from enfilade_blender.materials.values import (
    AttributeValue,
    Bump,
    Constant,
    ImageValue,
    Lobe,
    Normal,
    NormalMap,
    Principled,
    Texture,
    Value,
)
from enfilade_blender.notes import Notes
from enfilade_blender.scene_xml import Element, Property, colour, plugin

SMOOTH = 1e-3  # alpha below which a surface is a mirror
ALPHA_MIN = 0.01
SHEEN_IOR, SHEEN_ROUGHNESS = 1.5, Constant((0.7,))
WHITE = (1.0, 1.0, 1.0)
TRANSMITTING = {"dielectric", "roughdielectric", "thindielectric", "null", "mask", "twosided"}
ALMOST = 0.995  # weights above are 1, below the rest 0


@dataclass(frozen=True)
class Context:
    """What all functions of this module need: the material's name, textures and notes."""

    owner: str
    textures: Textures
    notes: Notes


def lobe_bsdf(lobe: Lobe, context: Context) -> Element:
    """BSDF of a closure with one lobe."""
    builders = {"diffuse": _diffuse_lobe, "glossy": _glossy_lobe, "glass": _glass_lobe}
    return _with_normal(builders[lobe.kind](lobe, context), lobe.normal, context)


def principled_bsdf(shader: Principled, context: Context) -> Element:
    """BSDF of the Principled BSDF, without its emission and opacity."""

    def opaque() -> Element:
        metallic = _input(shader, "Metallic", 0.0)
        return _blend(metallic, lambda: _plastic(shader, context), lambda: _metal(shader, context), context)

    transmission = _input(shader, "Transmission Weight", 0.0)
    whole = _blend(transmission, opaque, lambda: _principled_glass(shader, context), context)
    coat, coat_ior = _input(shader, "Coat Weight", 0.0), _number(shader, "Coat IOR", 1.5)
    whole = layered(whole, coat, coat_ior, _input(shader, "Coat Roughness", 0.03), WHITE, context)
    tint = context.textures.mean(_input(shader, "Sheen Tint", 1.0))
    whole = layered(whole, _input(shader, "Sheen Weight", 0.0), SHEEN_IOR, SHEEN_ROUGHNESS, tint, context)
    _note_principled(shader, context)
    return _with_normal(whole, shader.normal, context)


def plastic_bsdf(colour_value: Value, roughness: Value, ior: float, context: Context) -> Element:
    """Diffuse reflection below a dielectric interface; one of textured roughness is a layer.

    So is one of a colour attribute, whose mean `roughplastic` would ask for.
    """
    if ior < 1.01:
        return plugin("bsdf", "diffuse", reflectance=context.textures.colour(colour_value))
    if isinstance(roughness, Constant) and not isinstance(colour_value, AttributeValue):
        return _plastic_of(colour_value, roughness.number, ior, context)
    base = plugin("bsdf", "diffuse", reflectance=context.textures.colour(colour_value))
    return layered(base, Constant((1.0,)), ior, roughness, WHITE, context)


def two_sided(bsdf: Element) -> Element:
    """The BSDF, whose opaque parts are seen from both sides."""
    nested = [child for child in bsdf if child.tag == "bsdf"]
    kinds = {element.get("type") for element in bsdf.iter("bsdf")}
    if not kinds & TRANSMITTING:
        return plugin("bsdf", "twosided", bsdf)
    for child in nested:
        index = list(bsdf).index(child)
        bsdf.remove(child)
        bsdf.insert(index, two_sided(child))
    return bsdf


def is_one(value: Value) -> bool:
    """Whether a weight is 1 everywhere."""
    return isinstance(value, Constant) and value.number >= ALMOST


def is_zero(value: Value) -> bool:
    """Whether a weight is 0 everywhere."""
    return isinstance(value, Constant) and value.number <= 1.0 - ALMOST


def _diffuse_lobe(lobe: Lobe, context: Context) -> Element:
    if not is_zero(lobe.roughness):
        what, effect = "the roughness of diffuse reflection is left out", "the surface is Lambertian"
        context.notes.add("approximated", context.owner, lobe.name, what, effect)
    return plugin("bsdf", "diffuse", reflectance=context.textures.colour(lobe.colour))


def _glossy_lobe(lobe: Lobe, context: Context) -> Element:
    return _conductor(lobe.colour, lobe.roughness, {}, context, edge=None)


def _glass_lobe(lobe: Lobe, context: Context) -> Element:
    ior = (
        lobe.ior.number if isinstance(lobe.ior, Constant) else float(np.mean(context.textures.mean(lobe.ior)))
    )
    return _glass(lobe.colour, lobe.colour, lobe.roughness, ior, context)


def _principled_glass(shader: Principled, context: Context) -> Element:
    base = _input(shader, "Base Color", 0.8)
    tint: Value = base
    if isinstance(base, Constant):  # twice through an interface is once through the colour
        tint = Constant(tuple(max(c, 0.0) ** 0.5 for c in base.colour))
    return _glass(
        tint, Constant(WHITE), _input(shader, "Roughness", 0.5), _number(shader, "IOR", 1.45), context
    )


def _glass(transmitted: Value, reflected: Value, roughness: Value, ior: float, context: Context) -> Element:
    ior = ior if abs(ior - 1.0) > 1e-3 else 1.001
    alpha = _alpha(roughness, context)
    scale = 1.0 if not isinstance(alpha, float) else 1.0 / ggx.kept_energy(round(alpha, 3))
    tints: dict[str, Property] = {}
    for name, value in (("specular_transmittance", transmitted), ("specular_reflectance", reflected)):
        tint = colour(value.colour, scale) if isinstance(value, Constant) else context.textures.colour(value)
        if tint != WHITE:
            tints[name] = tint
    if isinstance(alpha, float) and alpha < SMOOTH:
        return plugin("bsdf", "dielectric", int_ior=ior, ext_ior=1.0, **tints)
    return plugin(
        "bsdf", "roughdielectric", distribution="ggx", alpha=alpha, int_ior=ior, ext_ior=1.0, **tints
    )


def _plastic(shader: Principled, context: Context) -> Element:
    ior = mapping.interface_ior(_number(shader, "IOR", 1.45), _number(shader, "Specular IOR Level", 0.5))
    base, roughness = _input(shader, "Base Color", 0.8), _input(shader, "Roughness", 0.5)
    return plastic_bsdf(base, roughness, ior, context)


def _plastic_of(base: Value, roughness: float, ior: float, context: Context) -> Element:
    alpha = roughness * roughness
    if alpha < SMOOTH:
        reflectance = context.textures.colour(base)
        return plugin("bsdf", "plastic", int_ior=ior, ext_ior=1.0, diffuse_reflectance=reflectance)
    alpha = max(alpha, ALPHA_MIN)
    gain = ggx.plastic_gain(round(alpha, 3), round(ior, 3))
    reflectance = context.textures.scaled(base, gain)
    return plugin(
        "bsdf", "roughplastic", distribution="ggx", alpha=alpha, int_ior=ior, ext_ior=1.0,
        diffuse_reflectance=reflectance,
    )  # fmt: skip


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
    return _conductor(base, roughness, extra, context, edge=edge)


def _conductor(
    reflectance: Value, roughness: Value, extra: dict[str, Property], context: Context,
    *, edge: tuple[float, float, float] | None,
) -> Element:  # fmt: skip
    """A metal, whose index of refraction is fitted where there are an edge tint and a constant colour."""
    alpha = _alpha(roughness, context)
    typical = alpha if isinstance(alpha, float) else float(np.mean(context.textures.mean(roughness))) ** 2
    optics: dict[str, Property] = {"material": "none"}
    if isinstance(reflectance, Constant):
        r = np.clip(np.array(reflectance.colour), 0.0, 1.0)
        gain = np.array([ggx.metal_scale(float(c), typical) for c in r])
        if edge is not None:
            eta, k = mapping.conductor_ior(r, np.array(edge))
            optics = {"eta": _unbounded(eta), "k": _unbounded(k), "specular_reflectance": colour(gain)}
        else:
            optics["specular_reflectance"] = colour(r * gain)
    else:
        optics["specular_reflectance"] = context.textures.colour(reflectance)
    if isinstance(alpha, float) and alpha < SMOOTH:
        return plugin("bsdf", "conductor", **optics)
    lobe: dict[str, Property] = extra or {"alpha": alpha}
    return plugin("bsdf", "roughconductor", distribution="ggx", **lobe, **optics)


def _alpha(roughness: Value, context: Context) -> float | Element:
    """GGX alpha: the roughness squared, also of a texture."""
    if isinstance(roughness, Constant):
        alpha = min(max(roughness.number, 0.0), 1.0) ** 2
        return alpha if alpha < SMOOTH else max(alpha, ALPHA_MIN)
    if isinstance(roughness, ImageValue) and context.textures.is_missing(roughness):
        return 0.25
    if isinstance(roughness, ImageValue | Texture):
        squared = np.maximum(context.textures.pixels(roughness).mean(axis=-1, keepdims=True) ** 2, ALPHA_MIN)
        return context.textures.rewritten(roughness, squared, "alpha")
    return 0.25


def layered(
    base: Element,
    weight: Value,
    ior: float,
    roughness: Value,
    tint: tuple[float, float, float],
    context: Context,
) -> Element:
    """A dielectric layer over a BSDF, which is dimmed by what the layer reflects of uniform light.

    A blend weighs the layer by its mean reflectance, which its own reflectance is divided by: the base is
    dimmed by the rest, and no colour of it is scaled.
    """
    alpha = _alpha(roughness, context)
    typical = alpha if isinstance(alpha, float) else float(np.mean(context.textures.mean(roughness))) ** 2
    mean = ggx.mean_reflectance(round(typical, 3), round(ior, 3))
    if is_zero(weight) or mean < 1e-3:
        return base
    optics: dict[str, Property] = {
        "eta": (ior,) * 3,
        "k": (0.0,) * 3,
        "specular_reflectance": colour(tint, 1.0 / mean),
    }
    if isinstance(alpha, float) and alpha < SMOOTH:
        layer = plugin("bsdf", "conductor", **optics)
    else:
        layer = plugin("bsdf", "roughconductor", distribution="ggx", alpha=alpha, **optics)
    return plugin("bsdf", "blendbsdf", base, layer, weight=context.textures.scaled_number(weight, mean))


def _with_normal(bsdf: Element, normal: Normal, context: Context) -> Element:
    """The BSDF inside a normal or bump map, without the shadowing that Cycles has for diffuse lobes alone."""
    if normal is None or (isinstance(normal, NormalMap | Bump) and _is_void(normal, context)):
        return bsdf
    if isinstance(normal, NormalMap):
        return plugin(
            "bsdf",
            "normalmap",
            bsdf,
            normalmap=_normal_texture(normal, context),
            use_shadowing_function=False,
        )
    if isinstance(normal, Bump):
        height = _height(normal, context)
        return plugin("bsdf", "bumpmap", bsdf, height, scale=normal.scale, use_shadowing_function=False)
    raise TypeError("procedural normals are baked before they are written")


def _is_void(normal: NormalMap | Bump, context: Context) -> bool:
    value = normal.image if isinstance(normal, NormalMap) else normal.height
    if isinstance(value, Constant):
        return True
    return isinstance(value, ImageValue) and context.textures.is_missing(value)


def _height(bump: Bump, context: Context) -> Element:
    element = context.textures.number(bump.height)
    if not isinstance(element, Element):
        raise TypeError("a constant height is no bump map")
    return element


def _normal_texture(normal: NormalMap, context: Context) -> Element:
    value = normal.image
    if isinstance(value, ImageValue | Texture) and abs(normal.strength - 1.0) > 1e-3:
        n = context.textures.pixels(value) * 2.0 - 1.0
        n = np.concatenate(
            [n[..., :2] * normal.strength, 1.0 + (n[..., 2:] - 1.0) * normal.strength], axis=-1
        )
        n /= np.maximum(np.linalg.norm(n, axis=-1, keepdims=True), 1e-6)
        return context.textures.rewritten(value, 0.5 * n + 0.5, f"normal {normal.strength:.3g}")
    element = context.textures.colour(value)
    if not isinstance(element, Element):
        raise TypeError("a constant normal is no normal map")
    return element


def _blend(
    weight: Value, first: Callable[[], Element], second: Callable[[], Element], context: Context
) -> Element:
    """Two BSDFs by a weight; a BSDF without any weight is not built."""
    if is_zero(weight):
        return first()
    if is_one(weight):
        return second()
    return plugin("bsdf", "blendbsdf", first(), second(), weight=context.textures.number(weight))


def _unbounded(values: np.ndarray) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


def _input(shader: Principled, name: str, default: float) -> Value:
    return shader.inputs.get(name, Constant((default,)))


def _number(shader: Principled, name: str, default: float) -> float:
    value = _input(shader, name, default)
    return value.number if isinstance(value, Constant) else default


def _note_principled(shader: Principled, context: Context) -> None:
    """Notes on inputs that are not, or not exactly, carried over."""
    effects = {
        "Sheen Weight": ("a rough dielectric layer", "brightness of edges differs a little"),
        "Subsurface Weight": ("diffuse reflection", "light does not spread below the surface"),
        "Thin Film Thickness": ("the thin film is left out", "there are no interference colours"),
        "Diffuse Roughness": ("the roughness of diffuse reflection is left out", "the surface is Lambertian"),
    }
    for name, (what, effect) in effects.items():
        if not is_zero(_input(shader, name, 0.0)):
            context.notes.add("approximated", context.owner, f"{shader.name}: {name}", what, effect)
    for name in ("IOR", "Specular IOR Level"):
        if not isinstance(_input(shader, name, 0.5), Constant):
            effect = "reflections have the same strength everywhere"
            context.notes.add(
                "approximated", context.owner, f"{shader.name}: {name}", "a texture is left out", effect
            )
