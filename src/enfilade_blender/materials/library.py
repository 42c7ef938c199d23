# SPDX-License-Identifier: GPL-3.0-or-later
"""The materials of a scene: shaders without procedural values, and BSDFs, which parts of objects share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from enfilade_blender.job import Job
from enfilade_blender.materials.atlas import share_bsdfs
from enfilade_blender.materials.bake import Bakery
from enfilade_blender.materials.context import Context
from enfilade_blender.materials.graph import Graph, as_pane
from enfilade_blender.materials.links import is_of_object
from enfilade_blender.materials.surfaces import Surface, build
from enfilade_blender.materials.textures import Textures
from enfilade_blender.materials.values import (
    AttributeValue,
    Bump,
    Constant,
    ImageValue,
    Lobe,
    Shader,
    Texture,
    has_panes,
    is_glassy,
    normals_of,
    values_of,
)
from enfilade_blender.notes import Notes
from enfilade_blender.ply import Mesh
from enfilade_blender.records import Placed, Selection, View
from enfilade_blender.scene_xml import HIDDEN, Element, Identifiers, named

DEFAULT = Lobe("diffuse", Constant((0.8, 0.8, 0.8)), "no material")
SHEET_OPENNESS = 0.15  # of glass without a back: a box without its bottom has 0.17, a tumbler 0.12
MAX_PANE_RATIO = 0.05  # of the mean thickness of a pane to the root of its area


@dataclass(frozen=True, eq=False)
class Part:
    """The triangles of one slot of an object.

    Attributes
    ----------
    name : str
    mesh : Mesh
    material : bpy.types.Material or None
    placed : Placed
        The object.
    slot : int
    """

    name: str
    mesh: Mesh
    material: Any
    placed: Placed
    slot: int = 0


@dataclass(frozen=True, eq=False)
class PartMaterial:
    """The material of a part.

    Attributes
    ----------
    shader : Shader
        Without procedural values.
    part : Part
    is_own : bool
        Whether its textures are baked for this part.
    uv, attribute : str or None
        UV map and colour attribute of the mesh that it reads.
    is_back_seen : bool
        Whether the back needs a BSDF of its own.
    is_hidden : bool
        Whether the camera does not see it.
    """

    shader: Shader
    part: Part
    is_own: bool
    uv: str | None
    attribute: str | None
    is_back_seen: bool = False
    is_hidden: bool = False


class MaterialLibrary:
    """Reads materials, bakes what is procedural, and makes BSDFs: one for all parts that can share it.

    Parameters
    ----------
    job, selection, notes
    views : list of View
        Whose distances choose the resolution of baked textures.
    identifiers
        Of the scene's elements.

    Attributes
    ----------
    textures : Textures
    kinds : set of str
        Plugins of the BSDFs of visible surfaces, nested ones included.
    """

    def __init__(
        self, job: Job, selection: Selection, views: list[View], notes: Notes, identifiers: Identifiers
    ) -> None:
        self._out, self._notes, self._identifiers = job.out, notes, identifiers
        self.textures = Textures(job.out, notes)
        self.kinds: set[str] = set()
        self._bakery = Bakery(job, selection, views, self.textures, notes)
        self._shaders: dict[Any, Shader] = {}
        self._resolved: dict[Any, tuple[PartMaterial, Mesh]] = {}  # by mesh, slot and material
        self._surfaces: dict[Any, tuple[str, Surface]] = {}
        self._radiances: dict[str, Any] = {}  # by the id of the BSDF
        self._bsdfs: list[Element] = []
        self._baked: list[str] = []  # ids of the BSDFs of one object

    def __len__(self) -> int:
        """Number of BSDFs."""
        return len(self._bsdfs)

    def shader(self, material: Any) -> Shader:
        """The shader of a material (bpy), or that of none."""
        if material is None:
            return DEFAULT
        if material.name_full not in self._shaders:
            if material.use_nodes and material.node_tree is not None:
                shader = Graph(material.name, self._notes).surface(material)
            else:
                shader = replace(DEFAULT, colour=Constant(tuple(material.diffuse_color)[:3]))
            self._shaders[material.name_full] = shader
        return self._shaders[material.name_full]

    def resolve(self, part: Part, twins: Sequence[Placed]) -> tuple[PartMaterial, Mesh]:
        """The material of a part, and its mesh, which has a UV map more where textures are baked.

        Parameters
        ----------
        part
        twins
            All objects with its mesh: linked duplicates share what is baked.
        """
        placed, shader = part.placed, self.shader(part.material)
        if not placed.has_shadow and (pane := as_pane(shader, "Ray visibility")) is not None:
            shader = pane
        twins = [placed] if is_of_object(shader) else twins
        key = id(placed.mesh), part.slot, part.material, placed.has_shadow
        if len(twins) > 1 and key in self._resolved:
            return self._resolved[key]
        copies = [matrix for twin in twins for matrix in twin.matrices]
        shader, mesh, is_own = self._bakery.resolve(shader, part.material, part.mesh, placed, copies)
        resolved = PartMaterial(shader, part, is_own, *_maps(shader, mesh)), mesh
        if len(twins) > 1:
            self._resolved[key] = resolved
        return resolved

    def surface(self, of: PartMaterial, *, is_mirrored: bool = False) -> tuple[str, Surface]:
        """Id of a BSDF, and its surface; `is_mirrored` as its normal maps."""
        material, part = of.part.material, of.part.name
        owner = of.part if of.is_own else None
        density = _uv_density(of)
        is_solid = has_panes(of.shader) and _is_solid(of.part)
        is_sheet = is_glassy(of.shader) and of.part.mesh.openness() > SHEET_OPENNESS
        name = material.name_full if material else ""
        has_shadow = of.part.placed.has_shadow
        shape = is_mirrored, density, is_solid, is_sheet
        key = name, of.is_back_seen, of.is_hidden, owner, has_shadow, shape
        if key in self._surfaces:
            return self._surfaces[key]
        context = Context(
            material.name if material else "no material", self.textures, self._notes, is_mirrored
        )
        context = replace(context, uv_density=density, is_solid=is_solid, is_sheet=is_sheet)
        surface = build(of.shader, context)
        back = build(of.shader, replace(context, is_back=True)) if of.is_back_seen else None
        element = surface.element(context, back)
        name = f"material {material.name if material else 'no material'}"
        name = f"{HIDDEN} {name}" if of.is_hidden else name
        identifier = self._identifiers.unique(f"{name}: {part}" if of.is_own else name)
        self._bsdfs.append(named(element, identifier))
        kinds = {nested.get("type") or "" for nested in element.iter("bsdf")}
        if kinds & {"mask", "thindielectric"} and not getattr(material, "use_transparent_shadow", True):
            what, effect = "that they are switched off is left out", "its shadow is lighter where it is clear"
            self._notes.add("not-carried", material.name, "Transparent Shadows", what, effect)
        if not surface.is_invisible:
            self.kinds |= kinds
        if of.is_own:
            self._baked.append(identifier)
        self._surfaces[key] = identifier, surface
        self._radiances[identifier] = surface.radiance(context)
        return identifier, surface

    def radiance(self, identifier: str) -> Any:
        """Radiance that surfaces with a BSDF emit; None for none."""
        return self._radiances[identifier]

    def write(self, shapes: Sequence[Element]) -> list[Element]:
        """Elements of the BSDFs that shapes use; those that are alike become one."""
        used = {element.get("id") for shape in shapes for element in shape.iter("ref")}
        bsdfs = [bsdf for bsdf in self._bsdfs if bsdf.get("id") in used]
        self._bsdfs = share_bsdfs(bsdfs, shapes, self._baked, self.textures, self._out)
        return self._bsdfs


def _maps(shader: Shader, mesh: Mesh) -> tuple[str | None, str | None]:
    """UV map and colour attribute that a shader reads; None for neither."""
    uv = attribute = None
    for value in values_of(shader):
        if isinstance(value, ImageValue | Texture):
            uv = value.uv_map or mesh.active_uv
        if isinstance(value, AttributeValue):
            attribute = value.name or mesh.active_colour
    return uv, attribute


def _is_solid(part: Part) -> bool:
    """Whether a part of an object is closed, and thick for its size; a cube has a ratio of 0.14."""
    mesh = part.mesh.transformed(part.placed.matrices[0])
    area = mesh.area()
    return mesh.is_closed() and 2.0 * abs(mesh.volume()) > MAX_PANE_RATIO * area**1.5


def _uv_density(of: PartMaterial) -> float:
    """Texture coordinates for each scene unit, where bumps depend on it: rounded, as meshes share BSDFs."""
    mesh = of.part.mesh
    is_mixed = any(isinstance(normal, Bump) and normal.strength < 1.0 for normal in normals_of(of.shader))
    if not is_mixed or of.uv not in mesh.uvs:
        return 1.0
    areas = mesh.uv_area(of.uv), mesh.transformed(of.part.placed.matrices[0]).area()
    squared, whole = (max(area, 1e-12) for area in areas)
    return float(2.0 ** (round(2.0 * math.log2(squared / whole)) / 4.0))
