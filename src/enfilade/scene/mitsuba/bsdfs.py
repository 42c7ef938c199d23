"""What a Mitsuba BSDF is: its classes, the BSDFs nested in it, interfaces, and lobes that show images."""

from __future__ import annotations

import math
from typing import Any

import mitsuba as mi
import numpy as np

from enfilade.scene.mitsuba.shapes import has_lobe

MAPS = {"BumpMap", "NormalMap"}
WRAPPERS = {"MaskBSDF", *MAPS}  # their albedo is that of the BSDF nested in them
GLASS = {"spec_trans": 1.0, "metallic": 0.0, "clearcoat": 0.0}  # parameters of a `principled` interface
# Largest roughness (alpha) of a lobe that shows images: it blurs them by 0.3 degrees.
IMAGING_ALPHA = 0.0025


def classes(bsdf: Any) -> set[str]:
    """Mitsuba's classes of a BSDF and of those nested in it."""
    return {n.class_name() for n in mi.traverse(bsdf).hierarchy if isinstance(n, mi.BSDF)}


def nested(bsdf: Any) -> list[Any]:
    """BSDFs nested directly in a BSDF."""
    hierarchy = mi.traverse(bsdf).hierarchy.items()
    return [node for node, (_, depth) in hierarchy if depth == 1 and isinstance(node, mi.BSDF)]


def constant(bsdf: Any, name: str) -> float:
    """A parameter that is the same at all points; not a number if it is not, or if there is none."""
    value = np.unique(np.array(mi.traverse(bsdf).get(f"{name}.value", [])))
    return float(value[0]) if len(value) == 1 else math.nan


def below_maps(bsdf: Any) -> Any:
    """The BSDF below bump and normal maps."""
    return below_maps(nested(bsdf)[0]) if bsdf.class_name() in MAPS else bsdf


def is_solid(bsdf: Any) -> bool:
    """Whether a BSDF is an interface with a refractive medium on its inner side."""
    of = below_maps(bsdf)
    return of.class_name() == "SmoothDielectric" or rough_ior(of) > 0.0


def rough_ior(bsdf: Any) -> float:
    """Relative index of refraction of a rough interface; 0 of other BSDFs."""
    is_glass = all(constant(bsdf, name) == value for name, value in GLASS.items())
    if not is_glass and bsdf.class_name() != "RoughDielectric":
        return 0.0
    parameters = mi.traverse(bsdf)
    if "specular" in parameters:
        return float(2.0 / (1.0 - math.sqrt(0.08 * parameters["specular"][0])) - 1.0)
    return float(parameters["eta"][0])


def is_narrow(bsdf: Any) -> bool:
    """Whether a BSDF is a metal or an interface with lobes that are narrow enough to show images."""
    if bsdf.class_name() == "TwoSidedBRDF":
        return all(map(is_narrow, nested(bsdf)))
    if bsdf.class_name() == "Principled":
        is_metal = constant(bsdf, "metallic") == 1.0 and constant(bsdf, "clearcoat") == 0.0
        alpha = constant(bsdf, "roughness") ** 2
        return (is_metal or rough_ior(bsdf) > 0.0) and alpha <= IMAGING_ALPHA
    if bsdf.class_name() not in {"RoughConductor", "RoughDielectric"}:
        return False
    return any(
        all(constant(bsdf, name) <= IMAGING_ALPHA for name in names)
        for names in (("alpha",), ("alpha_u", "alpha_v"))
    )


def is_textured(bsdf: Any, name: str) -> bool:
    """Whether a parameter of a BSDF is a texture."""
    return any(key.startswith(f"{name}.") and key != f"{name}.value" for key, _ in mi.traverse(bsdf))


def is_textured_metal(bsdf: Any) -> bool:
    """Whether a texture colours the reflection of a metal, without a coat, on both sides."""
    match bsdf.class_name():
        case "Principled":
            is_bare = all(constant(bsdf, name) == 0.0 for name in ("clearcoat", "spec_trans"))
            is_coloured = any(is_textured(bsdf, name) for name in ("base_color", "metallic"))
            return is_bare and is_coloured and constant(bsdf, "metallic") != 0.0
        case "SmoothConductor" | "RoughConductor":
            return is_textured(bsdf, "specular_reflectance")
        case "TwoSidedBRDF" | "MaskBSDF" | "BumpMap" | "NormalMap":
            return all(map(is_textured_metal, nested(bsdf)))
    return False


def mixes_delta_lobes(bsdf: Any) -> bool:
    """Whether a BSDF is or contains a blend of BSDFs, and has delta lobes."""
    return "BlendBSDF" in classes(bsdf) and has_lobe(bsdf.flags(), "Delta")


def is_turned(bsdf: Any) -> bool:
    """Whether the base of a BSDF is below a two-sided BSDF, which turns directions to the front."""
    if bsdf.class_name() in WRAPPERS:
        return is_turned(nested(bsdf)[0])
    is_two_sided = bsdf.class_name() == "TwoSidedBRDF"
    return is_two_sided and any(side.class_name() in WRAPPERS for side in nested(bsdf))


def base(bsdf: Any, *, is_front: bool) -> Any:
    """The BSDF below masks and maps, and below a two-sided BSDF outside of these, on a side."""
    if bsdf.class_name() in WRAPPERS:
        return base(nested(bsdf)[0], is_front=is_front)
    if is_turned(bsdf):
        return base(nested(bsdf)[0 if is_front else -1], is_front=True)
    return bsdf


def is_diffuse_on(bsdf: Any, side: Any) -> bool:
    """Whether a BSDF has a diffuse lobe on a side of the surface."""
    parts = [bsdf.flags(i) for i in range(bsdf.component_count())]
    return any(
        has_lobe(part, "DiffuseReflection", "DiffuseTransmission") and part & int(side) for part in parts
    )


def why_opaque(scene: Any) -> str:
    """Reason why a cut-out would look opaque: Mitsuba's maps do not tell what passes it. Empty if none."""
    for node in mi.traverse(scene).hierarchy:
        if node.class_name() in MAPS and not {"MaskBSDF", "Null"}.isdisjoint(classes(node)):
            return f"the {node.class_name()} {node.id()} contains a cut-out: let the cut-out contain the map"
    return ""
