# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes of the scene: a mesh for each object and material slot, with their BSDFs."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from enfilade_blender.copies import arranged, is_instanced, triangle_count
from enfilade_blender.evaluate import check_triangles
from enfilade_blender.job import Job
from enfilade_blender.materials.library import MaterialLibrary, Part, PartMaterial
from enfilade_blender.materials.textures import file_stem
from enfilade_blender.materials.values import has_panes, is_one, normals_of
from enfilade_blender.notes import Notes, report_progress
from enfilade_blender.ply import Mesh, joined, write_ply
from enfilade_blender.records import Placed, Selection, View
from enfilade_blender.scene_xml import LAMP, Element, Identifiers, named, plugin, reference
from enfilade_blender.sides import Sides, back_of

PLASTICS = {"plastic", "roughplastic"}


class Shapes:
    """Writes meshes, and collects elements.

    Parameters
    ----------
    job, selection, notes
    views : list of View

    Attributes
    ----------
    materials : MaterialLibrary
    identifiers : Identifiers
        Of BSDFs, shapes and emitters.
    triangles : int
        Those that are written; of instances once.
    area, plastic_area : float
        Of all surfaces, and of those with plastics.
    has_unseen_lamps : bool
        Whether there are emitters that the camera does not see.
    """

    def __init__(self, job: Job, selection: Selection, views: list[View], notes: Notes) -> None:
        self._out, self._limits, self._notes, self._views = job.out, job.limits, notes, views
        self.identifiers, self._files = Identifiers(), Identifiers()
        self.materials = MaterialLibrary(job, selection, views, notes, self.identifiers)
        self.triangles = 0
        self.area = self.plastic_area = 0.0
        self.has_unseen_lamps = False
        (job.out / "meshes").mkdir(exist_ok=True)

    def write(self, placed: list[Placed]) -> list[Element]:
        """Write all meshes; elements of BSDFs and shapes."""
        shapes: list[Element] = []
        total = triangle_count(placed)
        placed = arranged(placed, self.materials.shader)
        sides = Sides(self._views, placed)
        twins: dict[int, list[Placed]] = {}  # objects by the id of their mesh
        for item in placed:
            twins.setdefault(id(item.mesh), []).append(item)
        for number, item in enumerate(placed):
            if number % 50 == 0:
                report_progress(0.3 + 0.6 * number / len(placed), "materials")
            shapes += self._object(item, twins[id(item.mesh)], sides, has_instances=is_instanced(item, total))
        return [*self.materials.write(shapes), *shapes]

    def _object(
        self, placed: Placed, twins: list[Placed], sides: Sides, *, has_instances: bool
    ) -> list[Element]:
        """Shapes of an object; `twins` are all objects with its mesh, itself among them."""
        parts = list(_parts(placed))
        elements, instanced = [], []
        for part in parts:
            name = (
                part.name
                if len(parts) == 1
                else f"{part.name}: {part.material.name if part.material else 'none'}"
            )
            material, mesh = self.materials.resolve(part, twins)
            has_relief = any(normal is not None for normal in normals_of(material.shader))
            is_back_seen = has_relief and sides.shows_its_back(part.mesh, placed)
            material = replace(material, is_back_seen=is_back_seen)
            identifier, surface = self.materials.surface(material)
            if surface.is_invisible and not surface.emitted:
                continue
            if material.uv is None and any(e.get("name") == "alpha_u" for e in surface.plain().iter()):
                # Highlights are stretched along the UV map.
                material = replace(material, uv=mesh.active_uv or None)
            radiance = self.materials.radiance(identifier)
            mesh = _with_maps(mesh, material.uv, material.attribute)
            is_shared = has_instances and radiance is None
            area = mesh.transformed(placed.matrices[0]).area() * len(placed.matrices)
            self.area += area
            if any(bsdf.get("type") in PLASTICS for bsdf in surface.plain().iter("bsdf")):
                self.plastic_area += area
            self.triangles += len(mesh) * (1 if is_shared else len(placed.matrices))
            check_triangles(self.triangles, self._limits, placed.name)
            if not placed.has_shadow and not (surface.emitted and surface.bsdf is None):
                self._note_shadow(placed, material)
            if is_shared:
                material = replace(material, is_hidden=not placed.is_seen)
                instanced += self._shapes_of(f"{name} mesh", mesh, material, None)
                continue
            mesh = joined([mesh.transformed(matrix) for matrix in placed.matrices])
            if radiance is not None and mesh.area() == 0.0:
                what, effect = "the emission of a surface without area is left out", "it gives no light"
                self._notes.add("not-carried", name, "Emission", what, effect)
                radiance = None
            is_lit = radiance is not None
            has_back = is_lit and not (is_one(surface.opacity) and sides.hides_its_back(part.mesh, placed))
            # A lamp that is not flat would shine through its near side: it is hidden as others are.
            is_lamp = is_lit and surface.bsdf is None and (part.mesh.is_flat() or not has_back)
            material = replace(material, is_hidden=not placed.is_seen and not is_lamp)
            shapes = self._shapes_of(name, mesh, material, radiance)
            if has_back:
                shapes += self._shapes_of(f"{name} back", back_of(mesh), material, radiance)
            if is_lamp and not placed.is_seen:
                self.has_unseen_lamps = True
                what, effect = "a lamp that the camera does not see", "it casts no shadows"
                self._notes.add("approximated", placed.name, "Ray visibility", what, effect)
                shapes = [_as_lamp(shape) for shape in shapes]
            elements += shapes
        return elements + (self._instances(placed, instanced) if instanced else [])

    def _note_shadow(self, placed: Placed, material: PartMaterial) -> None:
        """Note that an object casts a shadow, or is thin glass, where it has no shadow in Blender."""
        if has_panes(material.shader):
            what, effect = (
                "glass without a shadow is a thin pane",
                "nothing is bent; thick objects cast shadows",
            )
            self._notes.add("approximated", placed.name, "Ray visibility", what, effect)
            return
        what, effect = "hidden from shadow rays in Blender", "it casts shadows"
        self._notes.add("not-carried", placed.name, "Ray visibility", what, effect)

    def _instances(self, placed: Placed, shapes: list[Element]) -> list[Element]:
        group = named(plugin("shape", "shapegroup", *shapes), self.identifiers.unique(f"{placed.name} group"))
        copies = []
        names = placed.names or [placed.name] * len(placed.matrices)
        for name, matrix in zip(names, placed.matrices, strict=True):
            copy = plugin("shape", "instance", reference(group.get("id") or ""), to_world=matrix)
            copies.append(named(copy, self.identifiers.unique(name)))
        return [group, *copies]

    def _shapes_of(self, name: str, mesh: Mesh, material: PartMaterial, radiance: Any) -> list[Element]:
        """One shape; two where a normal map lies mirrored on some triangles.

        Blender mirrors a normal map with its UV map, Mitsuba does not: its bitangent is the product of normal
        and tangent.
        """
        identifier, surface = self.materials.surface(material)
        if material.uv is None or not any(e.get("type") == "normalmap" for e in surface.plain().iter("bsdf")):
            return [self._shape(name, mesh, material, identifier, radiance)]
        mirrored = mesh.mirrored(material.uv)
        parts = []
        if not mirrored.all():
            parts.append(self._shape(name, mesh.select(~mirrored), material, identifier, radiance))
        if mirrored.any():
            identifier = self.materials.surface(material, is_mirrored=True)[0]
            name = f"{name} mirrored" if parts else name
            parts.append(self._shape(name, mesh.select(mirrored), material, identifier, radiance))
        return parts

    def _shape(self, name: str, mesh: Mesh, material: PartMaterial, bsdf: str, radiance: Any) -> Element:
        file = f"meshes/{self._files.unique(file_stem(name))}.ply"
        write_ply(self._out / file, mesh, material.uv, material.attribute)
        shape = plugin("shape", "ply", reference(bsdf), filename=file)
        if radiance is not None and mesh.area() > 0.0:
            shape.append(plugin("emitter", "area", radiance=radiance))
        return named(shape, self.identifiers.unique(name))


def _as_lamp(shape: Element) -> Element:
    """An emitter that the camera does not see, as lamps are."""
    of = shape.find("ref")
    assert of is not None  # noqa: S101  (`Shapes._shape`)
    of.set("id", LAMP)
    return shape


def _parts(placed: Placed) -> Any:
    """Parts of an object, in the order of slots."""
    last = max(len(placed.slots) - 1, 0)
    slots = np.clip(placed.mesh.materials, 0, last)
    for slot in np.unique(slots):
        mesh = placed.mesh if (slots == slot).all() else placed.mesh.select(slots == slot)
        yield Part(placed.name, mesh, placed.slots[slot] if placed.slots else None, placed, slot)


def _with_maps(mesh: Mesh, uv: str | None, attribute: str | None) -> Mesh:
    """The mesh with the maps that its material reads; those that it lacks are 0, as in Cycles."""
    uvs, colours = dict(mesh.uvs), dict(mesh.colours)
    if uv is not None:
        uvs.setdefault(uv, np.zeros((len(mesh), 3, 2), np.float32))
    if attribute is not None:
        colours.setdefault(attribute, np.zeros((len(mesh), 3, 4), np.float32))
    return replace(mesh, uvs=uvs, colours=colours)
