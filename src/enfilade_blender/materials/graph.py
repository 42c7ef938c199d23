# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads node trees into trees of shaders."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from enfilade_blender.materials import table
from enfilade_blender.materials.links import dependence, follow, image_coordinates, upstream
from enfilade_blender.materials.values import (
    PRINCIPLED,
    WITHOUT_EFFECT,
    Add,
    AttributeValue,
    Bump,
    Constant,
    Emission,
    ImageValue,
    Lobe,
    Mix,
    Normal,
    NormalMap,
    Nothing,
    Output,
    Principled,
    Procedural,
    ProceduralNormal,
    Shader,
    Value,
    bumped,
    is_one,
    is_zero,
    normals_of,
)
from enfilade_blender.notes import Notes

ZERO, WHITE = Constant((0.0,)), Constant((1.0, 1.0, 1.0))
SMOOTH = 0.03  # roughness below which glass is clear
DIELECTRIC_IOR = 1.45
MULTIPLE, OTHER_DISTRIBUTIONS = "MULTI_GGX", ("BECKMANN", "ASHIKHMIN_SHIRLEY")  # of microfacets


class Graph:
    """The node tree of one material.

    Parameters
    ----------
    owner : str
        Name of the material, for notes.
    notes
    """

    def __init__(self, owner: str, notes: Notes) -> None:
        self._owner, self._notes = owner, notes

    def surface(self, material: Any) -> Shader:
        """Shader of a material's output that Cycles takes, with its displacement as bumps."""
        output = material.node_tree.get_output_node("CYCLES")
        if output is None:
            return Nothing()
        if output.inputs["Volume"].is_linked:
            what, effect = "volume is not exported", "the object is without it"
            self._notes.add("not-carried", self._owner, "Volume", what, effect)
            if not output.inputs["Surface"].is_linked:
                return Lobe("transparent", Constant((1.0, 1.0, 1.0)), output.name)
        shader = self.shader(output.inputs["Surface"], ())
        found = follow(output.inputs["Displacement"], ())
        if not isinstance(found, Output):
            return shader
        return self._displaced(shader, found, material.displacement_method)

    def _displaced(self, shader: Shader, found: Output, method: str) -> Shader:
        """A shader with bumps of a displacement where it has no normals of its own."""
        node, bumps, effect = found.node, None, "the surface is smooth"
        if node.type == "DISPLACEMENT" and method != "DISPLACEMENT":
            height, scale = (self.value(node.inputs[name], found.groups) for name in ("Height", "Scale"))
            if isinstance(height, Constant):
                return shader  # moved as a whole, if at all
            bumps = Bump(_exact(height), scale.number, found) if isinstance(scale, Constant) else None
            effect = "the surface has its normals alone"
        if bumps is None or any(normal is not None for normal in normals_of(shader)):
            self._notes.add(
                "not-carried", self._owner, "Displacement", "displacement is not exported", effect
            )
            return shader
        if method == "BOTH":
            what, effect = "displacement is a bump map", "outlines are smooth, and nothing is moved"
            self._notes.add("approximated", self._owner, "Displacement", what, effect)
        return bumped(shader, bumps)

    def shader(self, socket: Any, groups: tuple[Any, ...]) -> Shader:
        """Shader that is linked to an input."""
        found = follow(socket, groups)
        if not isinstance(found, Output):
            return Nothing()
        node, inner = found.node, found.groups
        if node.type == "BSDF_PRINCIPLED":
            return self._principled(node, inner)
        if node.type == "MIX_SHADER":
            return self._mix(node, inner)
        if node.type == "ADD_SHADER":
            return Add(self.shader(node.inputs[0], inner), self.shader(node.inputs[1], inner), node.name)
        if node.type in ("EMISSION", "BACKGROUND"):
            strength = self.value(node.inputs["Strength"], inner)
            is_dark = strength == ZERO
            return Emission(
                strength if is_dark else _baked(self.value(node.inputs["Color"], inner)), strength
            )
        return self._lobe(node, inner)

    def _principled(self, node: Any, groups: tuple[Any, ...]) -> Shader:
        names = [name for name in PRINCIPLED if name in node.inputs]
        for weight, dependent in WITHOUT_EFFECT.items():
            if self.value(node.inputs[weight], groups) == ZERO:
                names = [name for name in names if name not in dependent]
        inputs = {name: self.value(node.inputs[name], groups) for name in names}
        if "Emission Color" in inputs:
            inputs["Emission Color"] = _baked(inputs["Emission Color"])
        self._note_coat_normal(node, groups)
        normal = self.normal(node.inputs["Normal"], groups)
        return Principled(inputs, normal, node.name, node.distribution == MULTIPLE)

    def _mix(self, node: Any, groups: tuple[Any, ...]) -> Shader:
        factor = follow(node.inputs[0], groups)
        if not isinstance(factor, Output) and factor.default_value in (0.0, 1.0):
            return self.shader(node.inputs[1 + int(factor.default_value)], groups)
        first, second = (self.shader(node.inputs[i], groups) for i in (1, 2))
        if (seen := self._seen_side(node, first, second, groups)) is not None:
            return seen
        is_layer = isinstance(second, Lobe) and second.kind == "glossy"
        ior = self._fresnel(node.inputs[0], groups) if is_layer else None
        if ior is not None:
            return Mix(Constant((0.5,)), first, second, ior, node.name)
        return Mix(self.value(node.inputs[0], groups), first, second, None, node.name)

    def value(self, socket: Any, groups: tuple[Any, ...]) -> Value:
        """Value of an input."""
        found, is_number = follow(socket, groups), socket.type == "VALUE"
        if not isinstance(found, Output):
            constant = self._constant(found)
            numbers = constant.numbers
            return Constant((sum(numbers) / 3.0,)) if is_number and found.type == "VECTOR" else constant
        node = found.node
        if node.type in ("RGB", "VALUE"):
            return self._constant(found.socket)
        if node.type in ("LIGHT_PATH", "SHADERTORGB", "LIGHT_FALLOFF"):
            return self._of_light(found, socket)
        if found.socket.name == "Color" and not is_number:
            if node.type == "VERTEX_COLOR":
                return AttributeValue(found, node.layer_name, self._owner)
            if node.type == "ATTRIBUTE" and node.attribute_type == "GEOMETRY":
                return AttributeValue(found, node.attribute_name, self._owner)
        if node.type == "TEX_IMAGE" and node.image is None:
            effect = "a mid grey is in its place"
            self._notes.add("approximated", self._owner, node.name, "there is no image", effect)
            return Constant((0.5, 0.5, 0.5))
        texture = _texture(found)
        if texture and (coordinates := image_coordinates(texture.node, texture.groups)):
            return ImageValue(found, *coordinates, texture.node)
        return Procedural(found, *dependence(found), is_number)

    def normal(self, socket: Any, groups: tuple[Any, ...]) -> Normal:
        """Normal of an input; None for the mesh's."""
        found = follow(socket, groups)
        if not isinstance(found, Output):
            return None
        node, inner = found.node, found.groups
        if node.type == "NORMAL_MAP" and not node.inputs["Color"].is_linked:
            return None  # as the importer of FBX files leaves it: its colour is the flat one
        if node.type == "NORMAL_MAP" and node.space == "TANGENT":
            image = _exact(self.value(node.inputs["Color"], inner))
            strength = self.value(node.inputs["Strength"], inner)
            if isinstance(strength, Constant) and (isinstance(image, ImageValue) or _is_of_uv(image)):
                is_flipped = getattr(node, "convention", "OPENGL") == "DIRECTX"
                return NormalMap(image, strength.number, found, is_flipped)
        if node.type == "BUMP" and not node.inputs["Normal"].is_linked:
            height = _exact(self.value(node.inputs["Height"], inner))
            strength, distance = (self.value(node.inputs[name], inner) for name in ("Strength", "Distance"))
            if isinstance(height, Constant) or strength == ZERO:
                return None
            is_plain = isinstance(height, ImageValue) or _is_of_uv(height)
            if is_plain and isinstance(strength, Constant) and isinstance(distance, Constant):
                scale = distance.number * (-1.0 if node.invert else 1.0)
                return Bump(height, scale, found, strength.number)
        return ProceduralNormal(found)

    def _constant(self, socket: Any) -> Constant:
        """Default of a socket: a number, or the first three of a colour or vector; 0 where not finite."""
        value = getattr(socket, "default_value", 0.0)
        if isinstance(value, int | float):
            value = (value,)
        numbers = [float(number) for number in value][:3] if hasattr(value, "__len__") else [0.0]
        finite = tuple(number if math.isfinite(number) else 0.0 for number in numbers)
        if not all(map(math.isfinite, numbers)):
            what, effect = (
                "a number that is NaN or infinite is taken as 0",
                "the surface or light may be darker",
            )
            self._notes.add("approximated", self._owner, f"{socket.node.name}: {socket.name}", what, effect)
        return Constant(finite)

    def _lobe(self, node: Any, groups: tuple[Any, ...]) -> Shader:
        kind = table.LOBES.get(node.type)
        if kind is None:
            what, effect = "this shader has no counterpart", "its surface is a neutral grey"
            self._notes.add("not-carried", self._owner, f"{node.name} ({node.type})", what, effect)
            return Lobe("diffuse", Constant((0.5, 0.5, 0.5)), node.name)
        if kind.note and kind.lobe != "refraction":  # below a glossy layer it is glass, without a note
            self._notes.add("approximated", self._owner, node.name, kind.note, kind.effect)

        self._note_metal(node)

        def named(name: str, default: tuple[float, ...]) -> Value:
            return self.value(node.inputs[name], groups) if name in node.inputs else Constant(default)

        colour = named("Base Color" if "Base Color" in node.inputs else "Color", (0.8, 0.8, 0.8))
        normal = self.normal(node.inputs["Normal"], groups) if "Normal" in node.inputs else None
        ior, roughness = named("IOR", (DIELECTRIC_IOR,)), named("Roughness", (0.0,))
        distribution = getattr(node, "distribution", MULTIPLE)
        if distribution in OTHER_DISTRIBUTIONS and roughness != ZERO:
            what, effect = f"its distribution {distribution} is GGX", "highlights fade out further away"
            self._notes.add("approximated", self._owner, node.name, what, effect)
        return Lobe(kind.lobe, colour, node.name, roughness, ior, normal, distribution == MULTIPLE)

    def _fresnel(self, socket: Any, groups: tuple[Any, ...]) -> float | None:
        """IOR of a factor that is Fresnel's reflectance."""
        found = follow(socket, groups)
        if not isinstance(found, Output):
            return None
        node = found.node
        if node.type == "FRESNEL":
            return self._even_ior(self.value(node.inputs["IOR"], found.groups), node.name)
        if node.type == "LAYER_WEIGHT" and found.socket.name == "Fresnel":
            blend = self.value(node.inputs["Blend"], found.groups)
            share = blend.number if isinstance(blend, Constant) else 0.5
            return 1.0 / max(1.0 - share, 1e-3)
        return None

    def _even_ior(self, ior: Value, node: str) -> float:
        if isinstance(ior, Constant):
            return ior.number
        what, effect = f"a textured index of refraction is {DIELECTRIC_IOR}", "reflections are even"
        self._notes.add("approximated", self._owner, node, what, effect)
        return DIELECTRIC_IOR

    def _seen_side(self, mix: Any, first: Shader, second: Shader, groups: tuple[Any, ...]) -> Shader | None:
        """The side beside Transparent of a mix by the kind of ray alone; None of other mixes."""
        is_clear, is_second_clear = _is_clear(first), _is_clear(second)
        factor = follow(mix.inputs[0], groups)
        if is_clear == is_second_clear or not isinstance(factor, Output):
            return None
        outputs = list(upstream(factor))
        kinds = {output.node.type for output in outputs}
        if "LIGHT_PATH" not in kinds or not kinds <= table.COLOUR_NODES | {"LIGHT_PATH"}:
            return None
        seen = second if is_clear else first
        if is_second_clear and _is_of_shadow_rays(outputs):
            if isinstance(seen, Mix) and seen.fresnel_ior is not None and _is_clear(seen.first):
                return seen  # thin glass, which shadow rays pass
            if (pane := as_pane(seen, mix.name)) is not None:
                return pane
        what = "a surface that is transparent for some rays is so for none"
        effect = "the surface is seen, lights and casts shadows for all rays"
        self._notes.add("approximated", self._owner, mix.name, what, effect)
        return seen

    def _note_metal(self, node: Any) -> None:
        stretch = node.inputs.get("Anisotropy")
        if stretch is not None and (stretch.is_linked or stretch.default_value != 0.0):
            what, effect = "its anisotropy is left out", "highlights are round"
            self._notes.add("not-carried", self._owner, node.name, what, effect)
        if getattr(node, "fresnel_type", "") == "PHYSICAL_CONDUCTOR":
            what, effect = "its indices of refraction are left out", "the metal has the node's base colour"
            self._notes.add("not-carried", self._owner, node.name, what, effect)

    def _note_coat_normal(self, node: Any, groups: tuple[Any, ...]) -> None:
        weight = node.inputs["Coat Weight"]
        is_coated = weight.is_linked or weight.default_value > 0.0
        if is_coated and isinstance(follow(node.inputs["Coat Normal"], groups), Output):
            what, effect = "the normals of the coat are left out", "its reflections are even"
            self._notes.add("not-carried", self._owner, f"{node.name}: Coat Normal", what, effect)

    def _of_light(self, found: Output, socket: Any) -> Value:
        """What an input takes in place of a kind of ray, of the light on a surface, or of its falloff."""
        node, what = found.node, table.OBJECT_DATA.get(found.node.type, "")
        if node.type == "LIGHT_PATH":
            value: Value = Constant((0.0,))
            what = f"{found.socket.name} is taken as 0"
            effect = "all rays see it as those do in Blender for which that is 0"
        elif node.type == "LIGHT_FALLOFF":
            smooth, value = node.inputs["Smooth"], self.value(node.inputs["Strength"], found.groups)
            if found.socket.name == "Quadratic" and not smooth.is_linked and smooth.default_value == 0.0:
                return value
            effect = "it is brighter near the lamp, and darker far from it"
        else:
            value, effect = self._constant(socket), table.OBJECT_EFFECT
        self._notes.add("approximated", self._owner, node.name, what, effect)
        return value


def _is_clear(shader: Shader) -> bool:
    return isinstance(shader, Lobe) and shader.kind == "transparent"


def _is_of_shadow_rays(outputs: list[Output]) -> bool:
    """Whether a factor is 1 for shadow rays, and 0 for those of the camera: one or several kinds of rays."""
    kinds = {output.socket.name for output in outputs if output.node.type == "LIGHT_PATH"}
    others = [output.node for output in outputs if output.node.type != "LIGHT_PATH"]
    are_sums = all(node.type == "MATH" and node.operation in ("ADD", "MAXIMUM") for node in others)
    return "Is Shadow Ray" in kinds and "Is Camera Ray" not in kinds and are_sums


def as_pane(glass: Shader, node: str) -> Mix | None:
    """Clear glass as thin glass; None of other shaders."""
    if isinstance(glass, Mix) and glass.fresnel_ior is not None and isinstance(glass.first, Lobe):
        glass = replace(
            glass.first, ior=Constant((glass.fresnel_ior,))
        )  # below a layer of its own reflection
    if isinstance(glass, Lobe) and glass.kind in ("glass", "refraction") and _is_smooth(glass.roughness):
        tint, reflected, ior = glass.colour, glass.colour, glass.ior
    elif isinstance(glass, Principled) and _is_plain_glass(glass):
        # Twice through an interface is once through the colour.
        root = tuple(math.sqrt(max(number, 0.0)) for number in glass["Base Color"].colour)
        tint, reflected, ior = Constant(root), WHITE, glass["IOR"]
    else:
        return None
    if not isinstance(ior, Constant):
        return None
    clear, glossy = Lobe("transparent", tint, node), Lobe("glossy", reflected, node, normal=glass.normal)
    return Mix(Constant((0.5,)), clear, glossy, ior.number, node, is_pane=True)


def _is_plain_glass(shader: Principled) -> bool:
    """Whether it is clear glass of one colour, and nothing else."""
    rest = ("Metallic", "Emission Strength", "Coat Weight", "Sheen Weight")
    return (
        is_one(shader["Transmission Weight"])
        and is_one(shader["Alpha"])
        and _is_smooth(shader["Roughness"])
        and isinstance(shader["Base Color"], Constant)
        and all(is_zero(shader[name]) for name in rest)
    )


def _is_smooth(roughness: Value) -> bool:
    return isinstance(roughness, Constant) and roughness.number < SMOOTH


def _texture(found: Output) -> Output | None:
    """The output of an image texture that an output is, or is a channel of; None for others."""
    if found.node.type in table.SPLITTING and getattr(found.node, "mode", "RGB") == "RGB":
        colour = follow(found.node.inputs[0], found.groups)
        is_split = isinstance(colour, Output) and colour.socket.name == "Color"
        found = colour if is_split else found
    return found if found.node.type == "TEX_IMAGE" else None


def _is_of_uv(value: Value) -> bool:
    return isinstance(value, Procedural) and value.uv_map is not None


def _baked(value: Value) -> Value:
    """The value of an emission: Mitsuba doesn't sample emitters by attributes of their mesh."""
    return Procedural(value.output) if isinstance(value, AttributeValue) else value


def _exact(value: Value) -> Value:
    """The value with all digits, where it is baked."""
    return replace(value, is_exact=True) if isinstance(value, Procedural) else value
