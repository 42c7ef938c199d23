# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes of the scene: a mesh for each object and material slot, with their BSDFs."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from enfilade_blender.evaluate import check_triangles
from enfilade_blender.job import Job
from enfilade_blender.materials.atlas import share_bsdfs
from enfilade_blender.materials.bake import Bakery
from enfilade_blender.materials.bsdfs import Context, is_one
from enfilade_blender.materials.graph import Graph
from enfilade_blender.materials.links import is_of_object, is_of_place
from enfilade_blender.materials.surfaces import Surface, build
from enfilade_blender.materials.textures import Textures, file_stem
from enfilade_blender.materials.values import (
    AttributeValue,
    Bump,
    Constant,
    ImageValue,
    Lobe,
    Shader,
    Texture,
    has_panes,
    normals_of,
    values_of,
)
from enfilade_blender.notes import Notes, report_progress
from enfilade_blender.ply import Mesh, joined, write_ply
from enfilade_blender.records import Placed, Selection, View
from enfilade_blender.scene_xml import LAMP, Element, Identifiers, named, plugin, reference

DEFAULT = Lobe("diffuse", Constant((0.8, 0.8, 0.8)), "no material")
FLAT_TRIANGLES = 8_000_000  # a scene of more has instances
INSTANCED_TRIANGLES = 500_000  # of all copies of a mesh that becomes instances
FEW_INSTANCES = 16  # that a renderer does not expand: rays take 20 % more time with them
MAX_PANE_RATIO = 0.05  # of the mean thickness of a pane to the root of its area
FEW_COPIES = 64  # of an object that are baked one by one
SAMPLED_EYES = 16  # of which backs are looked for
BACK_OFFSET = 4e-5  # of a vertex' largest coordinate plus 1: rays begin at 9e-5, which pass the other side


@dataclass(frozen=True, eq=False)
class _Part:
    """The triangles of one slot of an object."""

    name: str
    mesh: Mesh
    material: Any
    placed: Placed
    slot: int = 0


@dataclass(frozen=True, eq=False)
class _Material:
    """A part's shader without procedural values, and the UV map and attribute of its mesh that it reads."""

    shader: Shader
    part: _Part
    is_own: bool
    uv: str | None
    attribute: str | None
    is_back_seen: bool = False


class Shapes:
    """Writes meshes, and collects elements.

    Parameters
    ----------
    job, selection, notes
    views : list of View
        Whose distances choose the resolution of baked textures.

    Attributes
    ----------
    textures : Textures
    identifiers : Identifiers
        Of BSDFs, shapes and emitters.
    triangles : int
        Those that are written; of instances once.
    kinds : set of str
        Plugins of the BSDFs of visible surfaces, nested ones included.
    has_unseen_lamps : bool
        Whether there are emitters that the camera does not see.
    """

    def __init__(self, job: Job, selection: Selection, views: list[View], notes: Notes) -> None:
        self._out, self._limits, self._notes = job.out, job.limits, notes
        self.textures = Textures(job.out, notes)
        self.identifiers, self._files = Identifiers(), Identifiers()
        self._eyes = np.array([view.pose[:3, 3] for view in views]).reshape(-1, 3)
        self._middles, self._owners = np.zeros((0, 3)), np.zeros(0, np.int64)
        self._twins: dict[int, list[Placed]] = {}  # objects by the id of their mesh
        self._shared: dict[Any, tuple[_Material, Mesh]] = {}  # by mesh, slot and material
        self._bakery = Bakery(job, selection, views, self.textures, notes)
        self._shaders: dict[Any, Shader] = {}
        self._surfaces: dict[Any, tuple[str, Surface]] = {}
        self._radiances: dict[str, Any] = {}  # by the id of the BSDF
        self._bsdfs: list[Element] = []
        self._baked: list[str] = []  # ids of the BSDFs of one object
        self.triangles = 0
        self.kinds: set[str] = set()
        self.has_unseen_lamps = False
        (job.out / "meshes").mkdir(exist_ok=True)

    @property
    def material_count(self) -> int:
        """Number of BSDFs."""
        return len(self._bsdfs)

    def write(self, placed: list[Placed]) -> list[Element]:
        """Write all meshes; elements of BSDFs and shapes."""
        shapes: list[Element] = []
        total = sum(len(p.mesh) * len(p.matrices) for p in placed)
        placed = [one for item in self._linked(placed, total) for one in self._apart(item)]
        self._middles = np.concatenate([np.zeros((0, 3)), *map(_middles, placed)])
        self._owners = np.repeat([id(item) for item in placed], [len(item.matrices) for item in placed])
        for item in placed:
            self._twins.setdefault(id(item.mesh), []).append(item)
        for number, item in enumerate(placed):
            if number % 50 == 0:
                report_progress(0.3 + 0.6 * number / len(placed), "materials")
            shapes += self._object(item, is_instanced=_is_instanced(item, total))
        used = {element.get("id") for shape in shapes for element in shape.iter("ref")}
        self._bsdfs = [bsdf for bsdf in self._bsdfs if bsdf.get("id") in used]
        self._bsdfs = share_bsdfs(self._bsdfs, shapes, self._baked, self.textures, self._out)
        return [*self._bsdfs, *shapes]

    def _linked(self, placed: list[Placed], total: int) -> list[Placed]:
        """The objects; linked duplicates that are to be instances are copies of the first.

        Objects whose materials tell them apart stay as they are.
        """
        groups: dict[Any, list[Placed]] = {}
        for item in placed:
            key = id(item.mesh), item.slots, item.colour, item.index, item.is_seen
            groups.setdefault(key, []).append(item)
        result = []
        for items in groups.values():
            copies = [(item.name, matrix) for item in items for matrix in item.matrices]
            names, matrices = zip(*copies, strict=True)
            group = replace(items[0], matrices=list(matrices), names=names)
            are_many = len(matrices) > FEW_INSTANCES and _is_instanced(group, total)
            is_alike = are_many and not any(is_of_object(self._shader(material)) for material in group.slots)
            result += [group] if is_alike else items
        return result

    def _apart(self, placed: Placed) -> list[Placed]:
        """An object; its copies, if they are few, where a material depends on their place in the world."""
        copies = len(placed.matrices)
        if not 1 < copies <= FEW_COPIES or copies * len(placed.mesh) > INSTANCED_TRIANGLES:
            return [placed]
        if not any(is_of_place(self._shader(material)) for material in placed.slots):
            return [placed]
        return [replace(placed, matrices=[matrix]) for matrix in placed.matrices]

    def _object(self, placed: Placed, *, is_instanced: bool) -> list[Element]:
        parts = list(_parts(placed))
        elements, instanced = [], []
        for part in parts:
            name = (
                part.name
                if len(parts) == 1
                else f"{part.name}: {part.material.name if part.material else 'none'}"
            )
            material, mesh = self._resolved(part)
            has_relief = any(normal is not None for normal in normals_of(material.shader))
            is_back_seen = has_relief and self._shows_its_back(part.mesh, placed)
            material = replace(material, is_back_seen=is_back_seen)
            identifier, surface = self._surface(material)
            if surface.is_invisible and not surface.emitted:
                continue
            if material.uv is None and any(e.get("name") == "alpha_u" for e in surface.plain().iter()):
                # Highlights are stretched along the UV map.
                material = replace(material, uv=mesh.active_uv or None)
            radiance = self._radiances[identifier]
            mesh = _with_maps(mesh, material.uv, material.attribute)
            is_shared = is_instanced and radiance is None
            self.triangles += len(mesh) * (1 if is_shared else len(placed.matrices))
            check_triangles(self.triangles, self._limits, placed.name)
            if is_shared:
                instanced += self._shapes_of(f"{name} mesh", mesh, material, None)
                if not placed.is_seen:
                    self._note_unseen(placed, is_lamp=False)
                continue
            mesh = joined([mesh.transformed(matrix) for matrix in placed.matrices])
            if radiance is not None and mesh.area() == 0.0:
                what, effect = "the emission of a surface without area is left out", "it gives no light"
                self._notes.add("not-carried", name, "Emission", what, effect)
                radiance = None
            shapes = self._shapes_of(name, mesh, material, radiance)
            is_lit = radiance is not None
            has_back = is_lit and not (is_one(surface.opacity) and self._hides_its_back(part.mesh, placed))
            if has_back:
                shapes += self._shapes_of(f"{name} back", _back(mesh), material, radiance)
            # One that is not flat would shine through its near side: it stays black.
            if not placed.is_seen:
                is_lamp = is_lit and surface.bsdf is None and (part.mesh.is_flat() or not has_back)
                self._note_unseen(placed, is_lamp=is_lamp)
                shapes = [_as_lamp(shape) for shape in shapes] if is_lamp else shapes
            elements += shapes
        return elements + (self._instances(placed, instanced) if instanced else [])

    def _note_unseen(self, placed: Placed, *, is_lamp: bool) -> None:
        if is_lamp:
            self.has_unseen_lamps = True
            what, effect = "a lamp that the camera does not see", "it casts no shadows"
            self._notes.add("approximated", placed.name, "Ray visibility", what, effect)
            return
        what, effect = "hidden from camera rays in Blender", "it is visible, and may hide what is behind"
        self._notes.add("not-carried", placed.name, "Ray visibility", what, effect)

    def _resolved(self, part: _Part) -> tuple[_Material, Mesh]:
        """A part's shader without procedural values, and its mesh; linked duplicates share what is baked."""
        placed, shader = part.placed, self._shader(part.material)
        twins = [placed] if is_of_object(shader) else self._twins[id(placed.mesh)]
        key = id(placed.mesh), part.slot, part.material
        if len(twins) > 1 and key in self._shared:
            return self._shared[key]
        copies = [matrix for twin in twins for matrix in twin.matrices]
        shader, mesh, is_own = self._bakery.resolve(shader, part.material, part.mesh, placed, copies)
        resolved = _Material(shader, part, is_own, *_maps(shader, mesh)), mesh
        if len(twins) > 1:
            self._shared[key] = resolved
        return resolved

    def _hides_its_back(self, mesh: Mesh, placed: Placed) -> bool:
        """Whether an emitter is closed, faces outward, and has neither a camera nor an object inside."""
        if not mesh.is_closed() or mesh.volume() <= 0.0:
            return False
        points = np.concatenate([self._eyes, self._middles[self._owners != id(placed)]])
        for matrix in placed.matrices:
            copy = mesh.transformed(matrix).positions
            if ((points > copy.min(axis=0)) & (points < copy.max(axis=0))).all(axis=1).any():
                return False
        return True

    def _shows_its_back(self, mesh: Mesh, placed: Placed) -> bool:
        """Whether a mesh is open, and has triangles that face away from a camera."""
        if placed.mesh.is_closed():
            return False
        eyes = self._eyes[:: max(len(self._eyes) // SAMPLED_EYES, 1)]
        for matrix in placed.matrices:
            copy = mesh.transformed(matrix)
            corners = copy.positions[copy.triangles]
            fronts = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            if any((np.einsum("ij,ij->i", fronts, eye - corners[:, 0]) < 0.0).any() for eye in eyes):
                return True
        return False

    def _instances(self, placed: Placed, shapes: list[Element]) -> list[Element]:
        group = named(plugin("shape", "shapegroup", *shapes), self.identifiers.unique(f"{placed.name} group"))
        copies = []
        names = placed.names or [placed.name] * len(placed.matrices)
        for name, matrix in zip(names, placed.matrices, strict=True):
            copy = plugin("shape", "instance", reference(group.get("id") or ""), to_world=matrix)
            copies.append(named(copy, self.identifiers.unique(name)))
        return [group, *copies]

    def _shapes_of(self, name: str, mesh: Mesh, material: _Material, radiance: Any) -> list[Element]:
        """One shape; two where a normal map lies mirrored on some triangles.

        Blender mirrors a normal map with its UV map, Mitsuba does not: its bitangent is the product of normal
        and tangent.
        """
        identifier, surface = self._surface(material)
        if material.uv is None or not any(e.get("type") == "normalmap" for e in surface.plain().iter("bsdf")):
            return [self._shape(name, mesh, material, identifier, radiance)]
        mirrored = mesh.mirrored(material.uv)
        parts = []
        if not mirrored.all():
            parts.append(self._shape(name, mesh.select(~mirrored), material, identifier, radiance))
        if mirrored.any():
            identifier = self._surface(material, is_mirrored=True)[0]
            name = f"{name} mirrored" if parts else name
            parts.append(self._shape(name, mesh.select(mirrored), material, identifier, radiance))
        return parts

    def _shape(self, name: str, mesh: Mesh, material: _Material, bsdf: str, radiance: Any) -> Element:
        file = f"meshes/{self._files.unique(file_stem(name))}.ply"
        write_ply(self._out / file, mesh, material.uv, material.attribute)
        shape = plugin("shape", "ply", reference(bsdf), filename=file)
        if radiance is not None and mesh.area() > 0.0:
            shape.append(plugin("emitter", "area", radiance=radiance))
        return named(shape, self.identifiers.unique(name))

    def _shader(self, material: Any) -> Shader:
        if material is None:
            return DEFAULT
        if material.name_full not in self._shaders:
            if material.use_nodes and material.node_tree is not None:
                shader = Graph(material.name, self._notes).surface(material)
            else:
                shader = replace(DEFAULT, colour=Constant(tuple(material.diffuse_color)[:3]))
            self._shaders[material.name_full] = shader
        return self._shaders[material.name_full]

    def _surface(self, of: _Material, *, is_mirrored: bool = False) -> tuple[str, Surface]:
        """Id of a BSDF, and its surface; `is_mirrored` as its normal maps."""
        material, part = of.part.material, of.part.name
        owner = of.part if of.is_own else None
        density = _uv_density(of)
        is_solid = has_panes(of.shader) and _is_solid(of.part)
        key = material.name_full if material else "", is_mirrored, of.is_back_seen, owner, density, is_solid
        if key in self._surfaces:
            return self._surfaces[key]
        context = self._context(material, is_mirrored=is_mirrored)
        context = replace(context, uv_density=density, is_solid=is_solid)
        surface = build(of.shader, context)
        back = build(of.shader, replace(context, is_back=True)) if of.is_back_seen else None
        element = surface.element(context, back)
        name = f"material {material.name if material else 'no material'}"
        identifier = self.identifiers.unique(f"{name}: {part}" if of.is_own else name)
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

    def _context(self, material: Any, *, is_mirrored: bool = False) -> Context:
        owner = material.name if material else "no material"
        return Context(owner, self.textures, self._notes, is_mirrored)


def _as_lamp(shape: Element) -> Element:
    """An emitter that the camera does not see, as lamps are."""
    of = shape.find("ref")
    assert of is not None  # noqa: S101  (`Shapes._shape`)
    of.set("id", LAMP)
    return shape


def _is_solid(part: _Part) -> bool:
    """Whether a part of an object is closed, and thick for its size; a cube has a ratio of 0.14."""
    mesh = part.mesh.transformed(part.placed.matrices[0])
    area = mesh.area()
    return mesh.is_closed() and 2.0 * abs(mesh.volume()) > MAX_PANE_RATIO * area**1.5


def _is_instanced(placed: Placed, total: int) -> bool:
    """Whether an object's copies become instances, in a scene of a total of triangles."""
    copies = len(placed.matrices)
    return total > FLAT_TRIANGLES and copies > 1 and len(placed.mesh) * copies > INSTANCED_TRIANGLES


def _parts(placed: Placed) -> Any:
    """Parts of an object, in the order of slots."""
    last = max(len(placed.slots) - 1, 0)
    slots = np.clip(placed.mesh.materials, 0, last)
    for slot in np.unique(slots):
        mesh = placed.mesh if (slots == slot).all() else placed.mesh.select(slots == slot)
        yield _Part(placed.name, mesh, placed.slots[slot] if placed.slots else None, placed, slot)


def _middles(placed: Placed) -> np.ndarray:
    """Middles of the boxes of an object's copies, (N, 3)."""
    positions = placed.mesh.positions
    middle = 0.5 * (positions.min(axis=0) + positions.max(axis=0))
    return np.array([matrix[:3, :3] @ middle + matrix[:3, 3] for matrix in placed.matrices]).reshape(-1, 3)


def _maps(shader: Shader, mesh: Mesh) -> tuple[str | None, str | None]:
    """UV map and colour attribute that a shader reads; None for neither."""
    uv = attribute = None
    for value in values_of(shader):
        if isinstance(value, ImageValue | Texture):
            uv = value.uv_map or mesh.active_uv
        if isinstance(value, AttributeValue):
            attribute = value.name or mesh.active_colour
    return uv, attribute


def _uv_density(of: _Material) -> float:
    """Texture coordinates for each scene unit, where bumps depend on it: rounded, as meshes share BSDFs."""
    mesh = of.part.mesh
    is_mixed = any(isinstance(normal, Bump) and normal.strength < 1.0 for normal in normals_of(of.shader))
    if not is_mixed or of.uv not in mesh.uvs:
        return 1.0
    areas = mesh.uv_area(of.uv), mesh.transformed(of.part.placed.matrices[0]).area()
    squared, whole = (max(area, 1e-12) for area in areas)
    return float(2.0 ** (round(2.0 * math.log2(squared / whole)) / 4.0))


def _with_maps(mesh: Mesh, uv: str | None, attribute: str | None) -> Mesh:
    """The mesh with the maps that its material reads; those that it lacks are 0, as in Cycles."""
    uvs, colours = dict(mesh.uvs), dict(mesh.colours)
    if uv is not None:
        uvs.setdefault(uv, np.zeros((len(mesh), 3, 2), np.float32))
    if attribute is not None:
        colours.setdefault(attribute, np.zeros((len(mesh), 3, 4), np.float32))
    return replace(mesh, uvs=uvs, colours=colours)


def _back(mesh: Mesh) -> Mesh:
    """The other side of an emitter, a little behind it."""
    back = mesh.reversed()
    corners = back.positions[back.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    offsets = np.zeros_like(back.positions)
    for corner in range(3):
        np.add.at(offsets, back.triangles[:, corner], normals)
    offsets /= np.maximum(np.linalg.norm(offsets, axis=1, keepdims=True), 1e-30)
    offsets *= BACK_OFFSET * (1.0 + np.abs(back.positions).max(axis=1, keepdims=True))
    return replace(back, positions=back.positions + offsets, normals=-back.normals)
