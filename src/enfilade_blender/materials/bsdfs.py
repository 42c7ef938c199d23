# SPDX-License-Identifier: GPL-3.0-or-later
"""Mitsuba's BSDFs of lobes, plastics and layers, their blends, and normals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from enfilade_blender.materials import ggx, mapping
from enfilade_blender.materials.context import Context
from enfilade_blender.materials.microfacets import (
    SMOOTH,
    WHITE,
    alpha_of,
    clipped,
    conductor_bsdf,
    glass_bsdf,
    microfacet_bsdf,
)
from enfilade_blender.materials.table import LOBES
from enfilade_blender.materials.values import (
    ALMOST,
    AttributeValue,
    Bump,
    Constant,
    ImageValue,
    Lobe,
    Normal,
    NormalMap,
    ProceduralNormal,
    Texture,
    Value,
    is_one,
    is_zero,
)
from enfilade_blender.scene_xml import Element, colour, plugin

ROUGHEST_PLASTIC = 0.55  # rougher interfaces darken at grazing angles in Mitsuba, not in Blender
MATT = 0.8  # roughness from which a plastic is Lambertian: its reflections can't be told from diffuse ones
FAINT = 0.08  # highlight of rougher plastics, relative to the diffuse radiance, below which they are so, too
NO_INTERFACE = 1.0001  # Mitsuba refuses an index of 1
TRANSMITTING = {
    "principledthin",
    "dielectric",
    "roughdielectric",
    "thindielectric",
    "null",
    "mask",
    "twosided",
}
DIFFUSE = {"diffuse", "plastic", "roughplastic", "blendbsdf"}  # plastics are so for the most part
DELTA = {"conductor", "dielectric", "thindielectric", "null"}  # without rough lobes
ROUGHENED = {"conductor", "dielectric", "plastic"}  # smooth ones that have a rough counterpart


def lobe_bsdf(lobe: Lobe, context: Context) -> Element:
    """BSDF of a closure with one lobe."""
    match lobe.kind:
        case "glossy":
            bsdf = conductor_bsdf(
                lobe.colour, lobe.roughness, {}, context, edge=None, is_multiple=lobe.is_multiple
            )
        case "glass" | "refraction":
            if lobe.kind == "refraction":
                kind = LOBES["BSDF_REFRACTION"]
                context.notes.add("approximated", context.owner, lobe.name, kind.note, kind.effect)
            ior = Constant(context.textures.mean(lobe.ior)).number
            bsdf = glass_bsdf(
                lobe.colour, lobe.colour, lobe.roughness, ior, context, is_multiple=lobe.is_multiple
            )
        case "translucent":  # diffuse transmission alone: the thin principled BSDF without an interface
            thin = {"diff_trans": 2.0, "eta": NO_INTERFACE, "roughness": 0.5}
            bsdf = plugin("bsdf", "principledthin", base_color=context.textures.colour(lobe.colour), **thin)
        case _:
            if not is_zero(lobe.roughness):
                what, effect = "the roughness of diffuse reflection is left out", "the surface is Lambertian"
                context.notes.add("approximated", context.owner, lobe.name, what, effect)
            bsdf = plugin("bsdf", "diffuse", reflectance=context.textures.colour(lobe.colour))
    return with_normal(bsdf, lobe.normal, context)


def plastic_bsdf(base: Value, roughness: Value, ior: float, context: Context) -> Element:
    """Diffuse reflection below a dielectric interface.

    A textured roughness is a blend of two constant ones. A colour attribute is below a layer: `roughplastic`
    would ask for its mean.
    """
    if ior < 1.01:
        return plugin("bsdf", "diffuse", reflectance=context.textures.colour(base))
    if isinstance(base, AttributeValue):
        diffuse = plugin("bsdf", "diffuse", reflectance=context.textures.colour(base))
        return layered(diffuse, Constant((1.0,)), ior, roughness, WHITE, context)
    if isinstance(roughness, Constant):
        return _plastic_of(base, roughness.number, ior, context)
    low, high, weight = _two_roughnesses(roughness, context)
    first, second = (_plastic_of(base, r, ior, context) for r in (low, high))
    return blended(first, second, weight)


def _plastic_of(base: Value, roughness: float, ior: float, context: Context) -> Element:
    roughness = clipped(roughness)
    alpha = min(roughness, ROUGHEST_PLASTIC) ** 2
    is_rougher = roughness > ROUGHEST_PLASTIC
    highlight = ((ior - 1.0) / (ior + 1.0)) ** 2 / (4.0 * max(roughness, ROUGHEST_PLASTIC) ** 4)
    is_faint = highlight < FAINT * _darkest(base, context)
    is_matt = roughness >= MATT or (is_rougher and is_faint)
    if is_rougher and roughness < MATT:
        taken = "diffuse, as they are faint" if is_faint else f"those of {ROUGHEST_PLASTIC}"
        what = f"reflections of roughness {ROUGHEST_PLASTIC} to {MATT} are {taken}"
        effect = "highlights are missing" if is_faint else "highlights are smaller"
        context.notes.add("approximated", context.owner, "Roughness", what, effect)
    if is_matt:
        reflected = ggx.mean_reflectance(round(roughness**2, 3), round(ior, 3))
        return plugin("bsdf", "diffuse", reflectance=context.textures.lightened(base, reflected))
    if alpha < SMOOTH:
        reflectance = context.textures.colour(base)
        return plugin("bsdf", "plastic", int_ior=ior, ext_ior=1.0, diffuse_reflectance=reflectance)
    reflectance = context.textures.scaled(base, ggx.plastic_gain(round(alpha, 3), round(ior, 3)))
    return plugin(
        "bsdf", "roughplastic", distribution="ggx", alpha=alpha, int_ior=ior, ext_ior=1.0,
        diffuse_reflectance=reflectance,
    )  # fmt: skip


def _darkest(value: Value, context: Context) -> float:
    """Luminance of a colour, or of the darkest tenth of an image's pixels."""
    if isinstance(value, ImageValue | Texture) and context.textures.has_pixels(value):
        return float(np.percentile(context.textures.numbers(value), 10.0))
    return Constant(context.textures.mean(value)).number


def _two_roughnesses(roughness: Value, context: Context) -> tuple[float, float, Element | float]:
    """Two roughnesses, and the share of the second; alpha is linear in between."""
    if not context.textures.has_pixels(roughness):
        return 0.5, 0.5, 0.5
    pixels = np.clip(context.textures.numbers(roughness), 0.0, 1.0)
    low, high = (float(x) for x in np.percentile(pixels, (1.0, 99.0)))
    if high - low < 1e-2:
        return low, high, 0.5
    share = np.clip((pixels**2 - low**2) / (high**2 - low**2), 0.0, 1.0)
    return low, high, context.textures.rewritten(roughness, share, "roughness")


def two_sided(bsdf: Element, back: Element | None = None) -> Element:
    """The BSDF, whose opaque parts are seen from both sides; the back may have other textures."""
    if bsdf.get("type") == "twosided":
        return bsdf
    nested = [child for child in bsdf if child.tag == "bsdf"]
    kinds = {element.get("type") for element in bsdf.iter("bsdf")}
    if not kinds & TRANSMITTING:
        return plugin("bsdf", "twosided", bsdf, *([] if back is None else [back]))
    for child in nested:
        index = list(bsdf).index(child)
        bsdf.remove(child)
        bsdf.insert(index, two_sided(child, None if back is None else back[index]))
    return bsdf


def _typical(alpha: float | Element, roughness: Value, context: Context) -> float:
    """An alpha; that of the mean roughness of a texture."""
    if isinstance(alpha, float):
        return alpha
    return clipped(Constant(context.textures.mean(roughness)).number) ** 2


def layered(
    base: Element,
    weight: Value,
    ior: float,
    roughness: Value,
    tint: tuple[float, float, float],
    context: Context,
    *,
    mean: float | None = None,
) -> Element:
    """A dielectric layer over a BSDF, which is dimmed by what the layer reflects of uniform light.

    A blend weighs the layer by its mean reflectance, which its own reflectance is divided by: the base is
    dimmed by the rest, and no colour of it is scaled. Another `mean` scales the layer.
    """
    alpha = alpha_of(roughness, context)
    own = ggx.mean_reflectance(round(_typical(alpha, roughness, context), 3), round(ior, 3))
    mean = own if mean is None else mean
    if is_zero(weight) or mean < 1e-3:
        return base
    reflectance = colour(tint, 1.0 / own)
    layer = microfacet_bsdf(
        "conductor", alpha, eta=(ior,) * 3, k=(0.0,) * 3, specular_reflectance=reflectance
    )
    return blended(base, layer, context.textures.scaled_number(weight, mean))


def with_normal(bsdf: Element, normal: Normal, context: Context) -> Element:
    """The BSDF inside a normal or bump map, with the shadowing that Cycles has for diffuse lobes alone."""
    if isinstance(normal, ProceduralNormal):
        raise TypeError("procedural normals are baked before they are written")
    if context.is_back and isinstance(normal, Bump):
        normal = replace(normal, scale=-normal.scale)
    if normal is None or _is_void(normal.image, context):
        return bsdf
    is_diffuse = {element.get("type") for element in bsdf.iter("bsdf")} <= DIFFUSE
    if isinstance(normal, NormalMap):
        texture = _normal_texture(normal, context)
        return plugin("bsdf", "normalmap", bsdf, normalmap=texture, use_shadowing_function=is_diffuse)
    height, scale = context.textures.number(normal.image), normal.scale * _kept_slope(normal, context)
    return plugin("bsdf", "bumpmap", bsdf, height, scale=scale, use_shadowing_function=is_diffuse)


def _kept_slope(normal: Bump, context: Context) -> float:
    """Share of the slopes of bumps that their strength leaves, on average over the image."""
    image, strength = normal.image, normal.strength
    if strength >= ALMOST or not isinstance(image, ImageValue | Texture):
        return strength
    heights = context.textures.numbers(image)[..., 0] * normal.scale * context.uv_density
    heights = heights * abs(np.linalg.det(np.array(image.matrix)[:2, :2])) ** 0.5
    across, down = np.diff(heights, axis=1)[1:], np.diff(heights, axis=0)[:, 1:]  # for each texel
    share = mapping.mixed_slope(np.hypot(across * heights.shape[1], down * heights.shape[0]), strength)
    if share < 0.95 * strength:
        what, effect = f"slopes of bumps are scaled alike, by {share:.2g}", "steep ones are too steep"
        node = normal.output.node.name
        context.notes.add("approximated", context.owner, node, what, effect + ", and flat ones too flat")
    return share


def _is_void(value: Value, context: Context) -> bool:
    return isinstance(value, Constant) or (
        isinstance(value, ImageValue) and context.textures.is_missing(value)
    )


def _normal_texture(normal: NormalMap, context: Context) -> Element:
    value, is_turned = normal.image, context.is_back and normal.output.node.type == "NORMAL_MAP"
    is_flipped = context.is_mirrored != normal.is_flipped
    is_as_is = abs(normal.strength - 1.0) < 1e-3 and not is_flipped and not is_turned
    if is_as_is or not isinstance(value, ImageValue | Texture):
        return context.textures.colour(value)
    n = context.textures.pixels(value) * 2.0 - 1.0
    n = n * np.array([1.0, -1.0 if is_flipped else 1.0, 1.0])
    n = n * (np.array([-1.0, -1.0, 1.0]) if is_turned else 1.0)  # Cycles negates all of it on a back
    share = min(max(normal.strength, 0.0), 1.0)  # of z, as in Cycles; x and y may grow
    n = np.concatenate([n[..., :2] * normal.strength, 1.0 + (n[..., 2:] - 1.0) * share], axis=-1)
    n /= np.maximum(np.linalg.norm(n, axis=-1, keepdims=True), 1e-6)
    name = f"normal {normal.strength:.3g}{' flipped' * is_flipped}{' back' * is_turned}"
    return context.textures.rewritten(value, 0.5 * n + 0.5, name)


def blend(
    weight: Value, first: Callable[[], Element], second: Callable[[], Element], context: Context
) -> Element:
    """Two BSDFs by a weight; a BSDF without any weight is not built."""
    if is_zero(weight):
        return first()
    if is_one(weight):
        return second()
    return blended(first(), second(), context.textures.number(weight))


def blended(first: Element, second: Element, weight: Element | float) -> Element:
    """Two BSDFs by a weight; beside rough ones, smooth ones have a roughness that is not seen.

    Mitsuba's ``blendbsdf`` mixes the density of rough parts into samples of smooth ones: a coat over a black
    surface lost half of its reflections.
    """
    nested = [bsdf for part in (first, second) for bsdf in part.iter("bsdf")]
    if not {bsdf.get("type") for bsdf in nested if bsdf.find("bsdf") is None} <= DELTA:
        for bsdf in nested:
            if bsdf.get("type") in ROUGHENED:
                bsdf.set("type", f"rough{bsdf.get('type')}")
                bsdf.extend(plugin("bsdf", "", distribution="ggx", alpha=SMOOTH))
    return plugin("bsdf", "blendbsdf", first, second, weight=weight)
