# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays of Blender's meshes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from enfilade_blender.notes import Notes
from enfilade_blender.ply import F32, Mesh

KINDS = {  # attributes that nodes read: name, type and number of their values
    "FLOAT_COLOR": ("color", np.float32, 4),
    "BYTE_COLOR": ("color", np.float32, 4),
    "FLOAT": ("value", np.float32, 1),
    "INT": ("value", np.int32, 1),
    "BOOLEAN": ("value", np.bool_, 1),
    "FLOAT2": ("vector", np.float32, 2),
    "FLOAT_VECTOR": ("vector", np.float32, 3),
}


class AttributeNames(NamedTuple):
    """Names of attributes that materials read as colours, and as UV maps."""

    colours: frozenset[str] = frozenset()
    uvs: frozenset[str] = frozenset()


def read_mesh(data: Any, owner: str, notes: Notes, names: AttributeNames) -> Mesh:
    """Triangles of an evaluated mesh, with normals, UV maps, colours and other attributes.

    Triangles with a vertex that is not finite, which Mitsuba refuses, are left out with a note.

    Parameters
    ----------
    data : bpy.types.Mesh
    owner : str
        Name of its object, for notes.
    notes
    names
        Of the attributes that materials read. UV maps are read in any case, unless they have another domain
        or type than Blender's own, as those of geometry nodes may.
    """
    data.calc_loop_triangles()
    count = len(data.loop_triangles)
    loops = _get(data.loop_triangles, "loops", np.int32, count * 3)
    polygons = _get(data.loop_triangles, "polygon_index", np.int32, count)
    slots = _get(data.polygons, "material_index", np.int32, len(data.polygons))
    positions = _get(data.vertices, "co", np.float32, len(data.vertices) * 3).reshape(-1, 3)
    normals = _get(data.corner_normals, "vector", np.float32, len(data.loops) * 3).reshape(-1, 3)
    corners = _get(data.loops, "vertex_index", np.int32, len(data.loops))
    uvs = {}
    for layer in data.uv_layers:
        uvs[layer.name] = _get(layer.uv, "vector", np.float32, len(data.loops) * 2).reshape(-1, 2)[loops]
    colours = {}
    for attribute in data.color_attributes:
        per_corner = attribute.domain == "CORNER"
        size = len(data.loops) if per_corner else len(data.vertices)
        colour = _get(attribute.data, "color", np.float32, size * 4).reshape(-1, 4)
        colours[attribute.name] = colour[loops if per_corner else corners[loops]].reshape(-1, 3, 4)
    # Read other attributes. Nodes show a number as a grey, and a vector as a colour.
    others = {}
    at = {"POINT": corners[loops], "CORNER": loops, "FACE": polygons.repeat(3)}
    for attribute in data.attributes:
        name, kind = attribute.name, KINDS.get(attribute.data_type)
        if name in uvs or name in colours or not kind or attribute.domain not in at:
            continue
        value, dtype, axes = kind
        if name in names.colours or (name in names.uvs and value == "vector"):
            values = _get(attribute.data, value, dtype, len(attribute.data) * axes).reshape(-1, axes)
            corner = at[attribute.domain]
            if name in names.uvs and value == "vector":
                uvs[name] = values[corner, :2]
            if name in names.colours:
                colour = np.tile(np.float32([0.0, 0.0, 0.0, 1.0]), (len(values), 1))
                colour[:, : 3 if axes == 1 else axes] = values
                others[name] = colour[corner].reshape(-1, 3, 4)
    active_uv = next((layer.name for layer in data.uv_layers if layer.active_render), "")
    active_colour = data.color_attributes.render_color_index if colours else -1
    triangles = corners[loops].reshape(-1, 3)
    mesh = Mesh(
        positions=positions,
        triangles=triangles,
        normals=normals[loops].reshape(-1, 3, 3),
        uvs={name: uv.reshape(-1, 3, 2) for name, uv in uvs.items()},
        colours=colours | others,
        materials=slots[polygons],
        active_uv=active_uv,
        active_colour=list(colours)[active_colour] if 0 <= active_colour < len(colours) else "",
        generated=_generated(data, positions, triangles),
    )
    is_finite = np.isfinite(positions).all(axis=1)
    return mesh if is_finite.all() else _without_broken(mesh, is_finite[triangles].all(axis=1), owner, notes)


def _without_broken(mesh: Mesh, is_finite: Any, owner: str, notes: Notes) -> Mesh:
    """The triangles whose positions are finite; normals that others have made void are those of triangles."""
    if count := np.count_nonzero(~is_finite):
        what = f"triangles with a vertex that is NaN or infinite are left out: {count} of {len(mesh)}"
        notes.add("not-carried", owner, "Mesh", what, "they are missing from the picture")
    mesh = mesh.select(is_finite)
    generated = mesh.generated
    if generated is not None and not np.isfinite(generated).all():
        generated = None
    return replace(mesh, generated=generated).with_normals()


def _generated(data: Any, positions: F32, triangles: Any) -> F32 | None:
    """Coordinates of corners in the texture space of the mesh before modifiers, 0..1, as Cycles has them."""
    if not len(positions):
        return None
    undeformed = _get(data.vertices, "undeformed_co", np.float32, len(positions) * 3).reshape(-1, 3)
    place, size = np.float32(data.texspace_location), np.float32(data.texspace_size)
    found: F32 = 0.5 + 0.5 * (undeformed - place) / np.where(size == 0.0, np.float32(1.0), size)
    low, high = positions.min(axis=0), positions.max(axis=0)
    if np.allclose(found, (positions - low) / np.maximum(high - low, 1e-6), atol=1e-4):
        return None
    return found[triangles]


def _get(items: Any, name: str, kind: Any, size: int) -> Any:
    values: F32 = np.empty(size, kind)
    items.foreach_get(name, values)
    return values
