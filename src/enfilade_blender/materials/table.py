# SPDX-License-Identifier: GPL-3.0-or-later
"""What the exporter knows of nodes and sockets, by their types and names."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class LobeKind:
    """A shader node that has one lobe.

    Attributes
    ----------
    lobe : str
        See :class:`enfilade_blender.materials.values.Lobe`.
    note, effect : str
        What is approximated, and what that means; empty where nothing is.
    """

    lobe: str
    note: str = ""
    effect: str = ""


LOBES = {
    "BSDF_DIFFUSE": LobeKind("diffuse"),
    "BSDF_GLOSSY": LobeKind("glossy"),
    "BSDF_METALLIC": LobeKind("glossy", "the edge tint is left out", "metal is darker at grazing angles"),
    "BSDF_GLASS": LobeKind("glass"),
    "BSDF_REFRACTION": LobeKind("refraction", "glass, which also reflects", "the surface has reflections"),
    "BSDF_TRANSPARENT": LobeKind("transparent"),
    "BSDF_TRANSLUCENT": LobeKind("translucent"),
    "SUBSURFACE_SCATTERING": LobeKind(
        "diffuse", "diffuse reflection", "light does not spread below the surface"
    ),
    "BSDF_SHEEN": LobeKind("diffuse", "diffuse reflection", "edges are not brighter than the middle"),
    "BSDF_TOON": LobeKind("diffuse", "diffuse reflection", "light has no steps"),
    "BSDF_HAIR": LobeKind("glossy", "a glossy surface", "highlights of hair differ"),
    "BSDF_HAIR_PRINCIPLED": LobeKind("diffuse", "diffuse reflection", "highlights of hair are missing"),
}
COLOUR_NODES = {  # functions of their inputs alone
    "RGB", "VALUE", "MATH", "VECT_MATH", "MIX", "MIX_RGB", "VALTORGB", "CURVE_RGB", "CURVE_FLOAT",
    "CURVE_VEC", "GAMMA", "BRIGHTCONTRAST", "HUE_SAT", "INVERT", "SEPRGB", "COMBRGB", "SEPARATE_COLOR",
    "COMBINE_COLOR", "SEPXYZ", "COMBXYZ", "CLAMP", "MAP_RANGE", "RGBTOBW", "BLACKBODY", "WAVELENGTH",
}  # fmt: skip
CHANNELS = {"Red": 0, "Green": 1, "Blue": 2, "R": 0, "G": 1, "B": 2, "X": 0, "Y": 1, "Z": 2}  # of outputs
SPLITTING = ("SEPARATE_COLOR", "SEPRGB", "SEPXYZ")  # nodes of such outputs
VIEW_NODES = {"FRESNEL", "LAYER_WEIGHT", "LIGHT_PATH", "CAMERA", "TEX_IES"}
VIEW_SOCKETS = {"TEX_COORD": ("Camera", "Window", "Reflection"), "NEW_GEOMETRY": ("Incoming", "Backfacing")}
PLACE_SOCKETS = {  # in the space of the world
    "NEW_GEOMETRY": ("Position", "Normal", "True Normal", "Tangent"),
    "OBJECT_INFO": ("Location",),
}
OBJECT_DATA = {  # nodes that a bake on a copy of the object does not evaluate as Cycles does, and how it does
    "PARTICLE_INFO": "data of particles are taken as 0",
    "HAIR_INFO": "data of hairs are taken as 0",
    "POINT_INFO": "data of points are taken as 0",
    "AMBIENT_OCCLUSION": "other objects and slots do not occlude",
    "SCRIPT": "scripts of OSL are not run, and their outputs are taken as 0",
    "LIGHT_FALLOFF": "its falloff is quadratic",
    "SHADERTORGB": "the light on a surface is no colour in Cycles, where the input's own value holds",
}
OBJECT_EFFECT = "the surface differs where it depends on that"
