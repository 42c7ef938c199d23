"""Meshes of one material merged into one shape, in the order of the file.

Every launch of a kernel goes through all arrays of all shapes: a scene of 774 shapes costs 30 ms a launch.
Mitsuba's own merging (``optimize``) does not tell which shape of the file a triangle comes from, and its
order may vary.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np

from enfilade.records import U32


@dataclass(frozen=True, eq=False)
class MergedScene:
    """A scene with merged meshes, and the shapes of the file that they come from.

    Attributes
    ----------
    scene : mitsuba.Scene
    names : tuple of str
        Of the shapes of the file, 1, 2, ...
    sources : tuple of (N,) uint32
        For each shape of the scene the index of the file's shape, from 1: of each triangle of a merged mesh,
        or a single one.
    """

    scene: Any
    names: tuple[str, ...]
    sources: tuple[U32, ...]


def merge_meshes(scene: Any) -> MergedScene:
    """Merge the meshes of a scene that share a material.

    Emitters, meshes with attributes of their own and boundaries of media stay as they are. A scene with
    instances is returned as it is: Mitsuba can't build one again from its objects.
    """
    names = tuple(s.id() or f"{s.class_name()} {i}" for i, s in enumerate(scene.shapes(), start=1))
    groups: dict[Any, list[tuple[int, Any]]] = {}
    for index, shape in enumerate(scene.shapes(), start=1):
        groups.setdefault(_key(index, shape), []).append((index, shape))
    has_instances = any(shape.class_name() == "Instance" for shape in scene.shapes())
    if has_instances or len(groups) == len(names):
        return MergedScene(scene, names, tuple(np.array([i], np.uint32) for i in range(1, len(names) + 1)))

    # Replace each group by one shape, in the order of their first members.
    content: dict[str, Any] = {"type": "scene"}
    if scene.integrator() is not None:
        content["integrator"] = scene.integrator()
    content |= {f"sensor {i}": sensor for i, sensor in enumerate(scene.sensors())}
    content |= {f"emitter {i}": e for i, e in enumerate(scene.emitters()) if e.get_shape() is None}
    sources = []
    for number, members in enumerate(groups.values()):
        shapes = [shape for _, shape in members]
        content[f"shape {number}"] = shapes[0] if len(shapes) == 1 else _merged(f"merged {number}", shapes)
        counts = [1] if len(shapes) == 1 else [shape.face_count() for shape in shapes]
        sources.append(np.repeat(np.array([index for index, _ in members], np.uint32), counts))
    return MergedScene(mi.load_dict(content, optimize=False), names, tuple(sources))


def _key(index: int, shape: Any) -> Any:
    """Equal for meshes that can be merged."""
    is_mergeable = (
        shape.is_mesh()
        and not (shape.is_emitter() or shape.is_sensor() or shape.is_medium_transition())
        and not shape.has_mesh_attributes()
    )
    if not is_mergeable:
        return index
    features = shape.has_vertex_normals(), shape.has_vertex_texcoords()
    return shape.bsdf().ptr, *features, shape.has_face_normals(), shape.has_flipped_normals()


def _merged(name: str, shapes: Sequence[Any]) -> Any:
    """One mesh of several, with the material of the first."""
    first = shapes[0]
    properties = mi.Properties()
    properties["bsdf"] = first.bsdf()
    properties["face_normals"] = first.has_face_normals()
    properties["flip_normals"] = first.has_flipped_normals()
    mesh = mi.Mesh(
        name,
        vertex_count=sum(shape.vertex_count() for shape in shapes),
        face_count=sum(shape.face_count() for shape in shapes),
        has_vertex_normals=first.has_vertex_normals(),
        has_vertex_texcoords=first.has_vertex_texcoords(),
        props=properties,
    )
    bases = np.cumsum([0, *(shape.vertex_count() for shape in shapes[:-1])]).astype(np.uint32)
    faces = [np.array(shape.faces_buffer()) + base for shape, base in zip(shapes, bases, strict=True)]
    parameters = mi.traverse(mesh)
    parameters["faces"] = mi.UInt32(np.concatenate(faces))
    buffers = {"vertex_positions": "vertex_positions_buffer"}
    if first.has_vertex_normals():
        buffers["vertex_normals"] = "vertex_normals_buffer"
    if first.has_vertex_texcoords():
        buffers["vertex_texcoords"] = "vertex_texcoords_buffer"
    for key, buffer in buffers.items():
        parameters[key] = mi.Float(np.concatenate([np.array(getattr(shape, buffer)()) for shape in shapes]))
    parameters.update()
    return mesh
