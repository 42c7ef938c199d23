# SPDX-License-Identifier: GPL-3.0-or-later
"""A material as read from its nodes: a tree of shaders, whose inputs are values."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

Matrix3 = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
IDENTITY: Matrix3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
WITHOUT_EFFECT = {  # inputs of the Principled BSDF that a weight of 0 leaves without effect
    "Emission Strength": ("Emission Color",),
    "Coat Weight": ("Coat Roughness", "Coat IOR", "Coat Tint"),
    "Sheen Weight": ("Sheen Tint", "Sheen Roughness"),
    "Anisotropic": ("Anisotropic Rotation",),
}
ALMOST = 0.995  # weights above are 1, below the rest 0
LUMINANCE = (0.2126729, 0.7151522, 0.0721749)  # of linear Rec.709, in Cycles
PRINCIPLED = {  # inputs that are read, of which Blender 4.2 has not all; and numbers in place of a texture
    "Base Color": 0.8, "Metallic": 0.0, "Roughness": 0.5, "IOR": 1.45, "Alpha": 1.0, "Diffuse Roughness": 0.0,
    "Subsurface Weight": 0.0, "Specular IOR Level": 0.5, "Specular Tint": 1.0, "Anisotropic": 0.0,
    "Transmission Weight": 0.0, "Coat Weight": 0.0, "Coat Roughness": 0.03, "Coat IOR": 1.5, "Coat Tint": 1.0,
    "Sheen Weight": 0.0, "Sheen Tint": 1.0, "Sheen Roughness": 0.5, "Emission Color": 1.0,
    "Emission Strength": 0.0, "Thin Film Thickness": 0.0, "Anisotropic Rotation": 0.0,
}  # fmt: skip


@dataclass(frozen=True)
class Output:
    """An output socket of a node, and the group nodes that it lies in, outermost first."""

    socket: Any
    groups: tuple[Any, ...] = ()

    @property
    def node(self) -> Any:
        """Node of the socket."""
        return self.socket.node


@dataclass(frozen=True)
class Constant:
    """One number, or three of a linear colour."""

    numbers: tuple[float, ...]

    @property
    def number(self) -> float:
        """The number, or the luminance of the colour, as Blender converts it."""
        if len(self.numbers) == 1:
            return self.numbers[0]
        return sum(weight * c for weight, c in zip(LUMINANCE, self.colour, strict=True))

    @property
    def colour(self) -> tuple[float, float, float]:
        """The colour, or the number three times."""
        r, g, b = self.numbers if len(self.numbers) == 3 else self.numbers * 3
        return r, g, b


@dataclass(frozen=True)
class ImageValue:
    """An output of an image texture that Mitsuba's bitmap can look up.

    Attributes
    ----------
    output
    uv_map : str
        Empty: the active one.
    matrix
        Affine map of texture coordinates, of nodes of the type Mapping.
    node
        The image texture; `output` is one of its own, or one channel of its colours.
    """

    output: Output
    uv_map: str
    matrix: Matrix3
    node: Any

    @property
    def image(self) -> Any:
        """Image of the node."""
        return self.node.image


@dataclass(frozen=True)
class AttributeValue:
    """A colour attribute of the mesh, of a material; an empty name is the active one."""

    output: Output
    name: str
    material: str


@dataclass(frozen=True)
class Procedural:
    """A value of nodes without counterpart, which is baked.

    Attributes
    ----------
    output
    uv_map : str or None
        It depends on nothing but this UV map (empty: the active one): one texture serves all objects. None:
        it depends on more.
    matrix
        Affine map of the UV map's coordinates, to those of a period of 1.
    is_of_view : bool
        It depends on the direction of view or the kind of ray, which a texture does not.
    is_number : bool
        A number is made of it, as Cycles does: the luminance of a colour, the mean of a vector.
    is_exact : bool
        Its slopes count, as those of heights and normals: it is stored with all digits, below 0, too.
    """

    output: Output
    uv_map: str | None = None
    matrix: Matrix3 = IDENTITY
    is_of_view: bool = False
    is_number: bool = False
    is_exact: bool = False


@dataclass(frozen=True, eq=False)
class Texture:
    """A baked value: a file on the mesh's baked or own texture coordinates, with the mean of its texels.

    `matrix` maps the coordinates, before the file is looked up.
    """

    file: str
    uv_map: str
    mean: tuple[float, float, float]
    raw: bool
    matrix: Matrix3 = IDENTITY


Value = Constant | ImageValue | AttributeValue | Procedural | Texture


@dataclass(frozen=True)
class NormalMap:
    """Tangent-space normals of an image: `output` of a node Normal Map; `is_flipped`: green is downwards."""

    image: Value
    strength: float
    output: Output
    is_flipped: bool = False


@dataclass(frozen=True)
class Bump:
    """Heights of an image, scene units for each unit of the image; `output` of a node.

    The normals are mixed with the surface's, by a share `strength` of them.
    """

    image: Value
    scale: float
    output: Output
    strength: float = 1.0


@dataclass(frozen=True)
class ProceduralNormal:
    """Normals of nodes without counterpart, which are baked."""

    output: Output


Normal = NormalMap | Bump | ProceduralNormal | None


@dataclass(frozen=True)
class Principled:
    """Blender's Principled BSDF; `inputs` by their names. For `is_multiple` see :class:`Lobe`."""

    inputs: dict[str, Value]
    normal: Normal
    name: str
    is_multiple: bool = True

    def __getitem__(self, name: str) -> Value:
        """Value of an input."""
        return self.inputs.get(name, Constant((PRINCIPLED[name],)))

    def number(self, name: str) -> float:
        """Number of an input; the default in place of a texture."""
        value = self[name]
        return value.number if isinstance(value, Constant) else PRINCIPLED[name]


@dataclass(frozen=True)
class Lobe:
    """A closure with one lobe.

    Attributes
    ----------
    kind : str
        "diffuse", "glossy", "glass", "refraction", "transparent" or "translucent".
    colour
    name : str
        Of the node.
    roughness, ior, normal
    is_multiple : bool
        Light that is scattered several times between microfacets is not lost.
    """

    kind: str
    colour: Value
    name: str
    roughness: Value = Constant((0.0,))
    ior: Value = Constant((1.0,))
    normal: Normal = None
    is_multiple: bool = True


@dataclass(frozen=True)
class Emission:
    """Emitted radiance: colour times strength."""

    colour: Value
    strength: Value


@dataclass(frozen=True)
class Mix:
    """A share of the second shader, the rest of the first; `fresnel_ior` where the share is Fresnel's.

    `is_pane`: clear glass that shadow rays pass, as thin glass, which it is but on solid objects.
    """

    factor: Value
    first: Shader
    second: Shader
    fresnel_ior: float | None
    name: str
    is_pane: bool = False


@dataclass(frozen=True)
class Add:
    """The sum of two shaders."""

    first: Shader
    second: Shader
    name: str


@dataclass(frozen=True)
class Nothing:
    """An empty socket: black."""


Shader = Principled | Lobe | Emission | Mix | Add | Nothing


def is_one(value: Value) -> bool:
    """Whether a weight is 1 everywhere."""
    return isinstance(value, Constant) and value.number >= ALMOST


def is_zero(value: Value) -> bool:
    """Whether a weight is 0 everywhere."""
    return isinstance(value, Constant) and value.number <= 1.0 - ALMOST


def bumped(shader: Shader, bumps: Bump) -> Shader:
    """A shader, all of whose lobes have bumps."""
    if isinstance(shader, Mix | Add):
        return replace(shader, first=bumped(shader.first, bumps), second=bumped(shader.second, bumps))
    if isinstance(shader, Principled) or (isinstance(shader, Lobe) and shader.kind != "transparent"):
        return replace(shader, normal=bumps)
    return shader


def normals_of(shader: Shader) -> list[Normal]:
    """Normals of the lobes of a shader."""
    if isinstance(shader, Mix | Add):
        return normals_of(shader.first) + normals_of(shader.second)
    return [shader.normal] if isinstance(shader, Principled | Lobe) else []


def has_panes(shader: Shader) -> bool:
    """Whether a part of a shader is glass that shadow rays pass."""
    if isinstance(shader, Mix | Add):
        return getattr(shader, "is_pane", False) or has_panes(shader.first) or has_panes(shader.second)
    return False


def is_glassy(shader: Shader) -> bool:
    """Whether a part of a shader is glass."""
    if isinstance(shader, Mix | Add):
        return is_glassy(shader.first) or is_glassy(shader.second)
    if isinstance(shader, Principled):
        weight = shader["Transmission Weight"]
        return not isinstance(weight, Constant) or weight.number > 0.0
    return isinstance(shader, Lobe) and shader.kind in ("glass", "refraction")


def values_of(shader: Any) -> Iterator[Value | ProceduralNormal]:
    """All values below a shader, those of normals included."""
    if isinstance(shader, Value | ProceduralNormal):
        yield shader
    elif isinstance(shader, dict):
        for value in shader.values():
            yield from values_of(value)
    elif hasattr(shader, "__dataclass_fields__"):
        for field in fields(shader):
            yield from values_of(getattr(shader, field.name))


def replaced(shader: Any, change: Any) -> Any:
    """The tree with every value and procedural normal replaced by ``change(value)``."""
    if isinstance(shader, Value | ProceduralNormal):
        return change(shader)
    if isinstance(shader, dict):
        return {name: replaced(value, change) for name, value in shader.items()}
    if hasattr(shader, "__dataclass_fields__"):
        changed = {field.name: replaced(getattr(shader, field.name), change) for field in fields(shader)}
        return type(shader)(**changed)
    return shader
