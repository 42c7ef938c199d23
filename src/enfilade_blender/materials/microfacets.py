# SPDX-License-Identifier: GPL-3.0-or-later
"""Mitsuba's BSDFs of GGX microfacets: glass and metals."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from enfilade_blender.materials import ggx, mapping
from enfilade_blender.materials.context import Context
from enfilade_blender.materials.values import Constant, Value
from enfilade_blender.scene_xml import Element, Property, colour, plugin

SMOOTH = 1e-3  # alpha below which a surface is a mirror; the least of textures
EVEN = 0.01  # difference of gains below which they are one number
ALPHAS = np.linspace(0.0, 1.0, 17)  # at which gains of textured roughness are computed
SHEET_ROUGHNESS = 0.7  # of a thin pane that spreads what passes it as one interface does
WHITE = (1.0, 1.0, 1.0)


def glass_bsdf(
    transmitted: Value | Element, reflected: Value, roughness: Value, ior: float, context: Context,
    *, is_multiple: bool,
) -> Element:  # fmt: skip
    """Glass of two tints; of rough glass, constant ones restore the energy that single scattering loses.

    Without `is_multiple` Blender loses it, too.
    """
    ior = ior if abs(ior - 1.0) > 1e-3 else 1.001
    if context.is_sheet:
        return _sheet_of_glass(transmitted, reflected, roughness, ior, context)
    alpha = alpha_of(roughness, context)
    tints: dict[str, Property] = {}
    values = {"specular_transmittance": transmitted, "specular_reflectance": reflected}
    for number, (name, value) in enumerate(values.items()):
        tint: Property
        if isinstance(value, Constant):
            gain = partial(_glass_gain, ior, number, is_multiple=is_multiple)
            kind = f"{name} {ior:.3g}{' multiple' * is_multiple}"
            tint = _gained(value.colour, gain, alpha, roughness, kind, context)
        else:
            tint = value if isinstance(value, Element) else context.textures.colour(value)
        if tint != WHITE:
            tints[name] = tint
    return microfacet_bsdf("dielectric", alpha, int_ior=ior, ext_ior=1.0, **tints)


def _sheet_of_glass(
    transmitted: Value | Element, reflected: Value, roughness: Value, ior: float, context: Context
) -> Element:
    """Glass with one interface, as thin glass: Mitsuba's interfaces change radiance by the squared index."""
    what, effect = "glass of an open mesh is a thin pane", "nothing is bent behind it, and light passes"
    context.notes.add("approximated", context.owner, "Glass", what, effect)
    through, back = (
        value if isinstance(value, Element) else context.textures.colour(value)
        for value in (transmitted, reflected)
    )
    if isinstance(roughness, Constant) and clipped(roughness.number) ** 2 < SMOOTH:
        tints = {"specular_transmittance": through, "specular_reflectance": back}
        return plugin("bsdf", "thindielectric", int_ior=mapping.thin_ior(ior), ext_ior=1.0, **tints)
    rough = context.textures.scaled_number(roughness, SHEET_ROUGHNESS)
    return plugin(
        "bsdf", "principledthin", base_color=through, roughness=rough, spec_trans=1.0, eta=max(ior, 1.0 / ior)
    )


def _glass_gain(ior: float, number: int, alpha: float, *, is_multiple: bool) -> float:
    return ggx.glass_gains(round(alpha, 3), round(ior, 3))[number] if is_multiple else 1.0


def conductor_bsdf(
    reflectance: Value, roughness: Value, extra: dict[str, Property], context: Context,
    *, edge: tuple[float, float, float] | None, is_multiple: bool,
) -> Element:  # fmt: skip
    """A metal, whose index of refraction is fitted where there are an edge tint and a constant colour.

    Without `is_multiple` it loses light between its microfacets, as in Blender.
    """
    alpha = alpha_of(roughness, context)
    optics: dict[str, Property] = {"material": "none"}
    if isinstance(reflectance, Constant):
        r = np.clip(np.array(reflectance.colour), 0.0, 1.0)
        tint = r
        if edge is not None:
            eta, k = mapping.conductor_ior(r, np.array(edge))
            optics, tint = {"eta": _unbounded(eta), "k": _unbounded(k)}, np.ones(3)

        def gain(alpha: float) -> np.ndarray:
            return np.array([ggx.metal_scale(float(c), alpha) if is_multiple else 1.0 for c in r])

        name = "metal" + "".join(f" {c:.3g}" for c in r) + " multiple" * is_multiple
        optics["specular_reflectance"] = _gained(_unbounded(tint), gain, alpha, roughness, name, context)
    else:
        optics["specular_reflectance"] = context.textures.colour(reflectance)
    return microfacet_bsdf("conductor", alpha, extra, **optics)


def microfacet_bsdf(
    kind: str, alpha: float | Element, extra: dict[str, Property] | None = None, **optics: Property
) -> Element:
    """A smooth BSDF, or a rough one of GGX microfacets, whose `extra` alphas stand in place of the one."""
    if isinstance(alpha, float) and alpha < SMOOTH:
        return plugin("bsdf", kind, **optics)
    return plugin("bsdf", f"rough{kind}", distribution="ggx", **(extra or {"alpha": alpha}), **optics)


def alpha_of(roughness: Value, context: Context) -> float | Element:
    """GGX alpha: the roughness squared, also of a texture."""
    if isinstance(roughness, Constant):
        return clipped(roughness.number) ** 2
    if context.textures.has_pixels(roughness):
        inside = np.clip(context.textures.numbers(roughness), 0.0, 1.0)
        return context.textures.rewritten(roughness, np.maximum(inside**2, SMOOTH), "alpha")
    return 0.25


def _gained(
    tint: tuple[float, float, float], gain: Callable[[float], float | np.ndarray], alpha: float | Element,
    roughness: Value, name: str, context: Context,
) -> Property:  # fmt: skip
    """A reflectance times its gain at an alpha; a texture where the roughness is one."""
    if isinstance(alpha, float) or not context.textures.has_pixels(roughness):
        return colour(np.array(tint) * (gain(alpha) if isinstance(alpha, float) else 1.0))
    gains = np.array([np.broadcast_to(gain(float(a)), 3) for a in ALPHAS])
    alphas = np.clip(context.textures.numbers(roughness)[..., 0], 0.0, 1.0) ** 2
    image = np.stack([np.interp(alphas, ALPHAS, gains[:, c]) for c in range(3)], axis=-1)
    if np.ptp(image, axis=(0, 1)).max() < EVEN:
        return colour(np.array(tint) * image.mean(axis=(0, 1)).round(2))  # of objects that can share it
    name = " ".join([name, *(f"{c:.3g}" for c in tint)])
    return context.textures.rewritten(roughness, image * np.array(tint), name)


def clipped(roughness: float) -> float:
    """Roughness as Blender takes it."""
    return min(max(roughness, 0.0), 1.0)


def _unbounded(values: np.ndarray) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
