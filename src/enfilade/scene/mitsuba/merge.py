"""Meshes of one material merged into one shape, in the order of the file.

Every launch of a kernel goes through all arrays of all shapes: a scene of 774 shapes costs 30 ms a launch.
Instances cost more: the time that Mitsuba takes to record an intersection, of which a kernel has many, grows
with the square of their number, to 10 s for 1000 of them. Mitsuba's own merging (``merge_meshes``) leaves
instances as they are, does not tell which shape of the file a triangle comes from, and its order may vary.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mitsuba as mi
import numpy as np

from enfilade.arrays import lanes
from enfilade.errors import SceneError
from enfilade.records import F32, U32

EXPANDED_TRIANGLES = 50_000_000  # of all instances that become meshes; 7 to 12 GB
FEW_INSTANCES = 16  # that cost little
SINGULAR = 1e-7  # determinant of a matrix with columns of length 1, below which Mitsuba shows nothing
SMALLEST = np.finfo(np.float32).tiny


@dataclass(frozen=True, eq=False)
class MergedScene:
    """A scene with merged meshes, and the shapes of the file that they come from.

    Attributes
    ----------
    scene : mitsuba.Scene
    names : tuple of str
        Of the shapes of the file, 1, 2, ... An instance is a shape.
    sources : tuple of (N,) uint32
        For each shape of the scene the index of the file's shape, from 1: of each triangle of a merged mesh,
        or a single one.
    """

    scene: Any
    names: tuple[str, ...]
    sources: tuple[U32, ...]


@dataclass(frozen=True, eq=False)
class _Placed:
    """A shape at one place or more.

    Attributes
    ----------
    shape : mitsuba.Shape
    indices : tuple of int
        Of the file's shape, or of the instances.
    matrices : (N, 4, 4) float32 or None
        Transforms of the instances.
    """

    shape: Any
    indices: tuple[int, ...]
    matrices: F32 | None = None

    @cached_property
    def buffers(self) -> dict[str, tuple[Any, int]]:
        """What the vertices and triangles of a mesh have: values, and their number for each; by name."""
        mesh = self.shape
        arrays = {
            "vertex_positions": mesh.vertex_positions_buffer(),
            "vertex_normals": mesh.vertex_normals_buffer(),
            "vertex_texcoords": mesh.vertex_texcoords_buffer(),
        }
        arrays |= dict(sorted(_attributes(mesh).items()))
        counts = {True: mesh.vertex_count(), False: mesh.face_count()}
        widths = {name: len(array) // counts[name.startswith("vertex_")] for name, array in arrays.items()}
        return {name: (array, widths[name]) for name, array in arrays.items() if widths[name]}


def merge_meshes(scene: Any) -> MergedScene:
    """Merge the meshes of a scene that share a material, and those of its instances.

    Emitters and boundaries of media stay as they are. So do instances of what can't be merged, and those that
    would have more than :data:`EXPANDED_TRIANGLES`.
    """
    shapes = scene.shapes()
    names = tuple(s.id() or f"{s.class_name()} {i}" for i, s in enumerate(shapes, start=1))
    placed, groups = _expanded(shapes, _shape_groups(scene))
    merged: dict[Any, list[_Placed]] = {}
    for item in placed:
        merged.setdefault(_key(item), []).append(item)
    if len(merged) == len(names) and all(item.matrices is None for item in placed):
        return MergedScene(scene, names, tuple(np.array([i], np.uint32) for i in range(1, len(names) + 1)))

    # Replace each set by one shape, in the order of their first members.
    content: dict[str, Any] = {"type": "scene"}
    if scene.integrator() is not None:
        content["integrator"] = scene.integrator()
    content |= {f"sensor {i}": sensor for i, sensor in enumerate(scene.sensors())}
    content |= {f"emitter {i}": e for i, e in enumerate(scene.emitters()) if e.get_shape() is None}
    content |= {f"group {i}": group for i, group in enumerate(groups)}
    sources = []
    for number, items in enumerate(merged.values()):
        if len(items) == 1 and items[0].matrices is None:
            content[f"shape {number}"] = items[0].shape
            sources.append(np.array(items[0].indices, np.uint32))
        else:
            content[f"shape {number}"] = _merged(f"merged {number}", items)
            counts = [item.shape.face_count() for item in items for _ in item.indices]
            indices = np.array([index for item in items for index in item.indices], np.uint32)
            sources.append(np.repeat(indices, counts))
    return MergedScene(mi.load_dict(content, optimize=False), names, tuple(sources))


def _shape_groups(scene: Any) -> dict[str, tuple[Any, list[Any]]]:
    """Groups of shapes that instances refer to, and their shapes, by identifier."""
    groups: dict[str, tuple[Any, list[Any]]] = {}
    for node, (parent, _) in mi.traverse(scene).hierarchy.items():
        if node.class_name() == "ShapeGroupPlugin":
            groups[node.id()] = node, []
        elif isinstance(node, mi.Shape) and parent.class_name() == "ShapeGroupPlugin":
            groups[parent.id()][1].append(node)
    return groups


def _expanded(
    shapes: Sequence[Any], groups: dict[str, tuple[Any, list[Any]]]
) -> tuple[list[_Placed], list[Any]]:
    """Shapes, with those of a group in place of its instances; and the groups that keep theirs.

    Groups of few triangles are expanded first, until few instances remain.
    """
    instances: dict[str, list[int]] = {name: [] for name in groups}
    group_of = {i: _group_of(s) for i, s in enumerate(shapes, start=1) if s.class_name() == "Instance"}
    for index, name in group_of.items():
        instances[name].append(index)

    # Choose the groups to expand.
    left, remaining = EXPANDED_TRIANGLES, len(group_of)
    kept = set(groups)
    triangles = {name: sum(s.primitive_count() for s in members) for name, (_, members) in groups.items()}
    for name in sorted(groups, key=triangles.__getitem__):
        total = triangles[name] * len(instances[name])
        is_worthwhile = remaining > FEW_INSTANCES and total <= left
        group, members = groups[name]
        is_complete = group.primitive_count() == triangles[name]  # a shape of two groups is found in one
        if is_worthwhile and is_complete and all(_is_mergeable(shape) for shape in members):
            left, remaining = left - total, remaining - len(instances[name])
            kept.remove(name)

    # Put their shapes where their first instance is.
    placed = []
    for index, shape in enumerate(shapes, start=1):
        group = group_of.get(index)
        if group is None or group in kept:
            placed.append(_Placed(shape, (index,)))
        elif index == instances[group][0]:
            matrices = np.stack([_to_world(shapes[i - 1]) for i in instances[group]])
            length = np.linalg.norm(matrices[:, :3, :3], axis=1, keepdims=True)
            linear = matrices[:, :3, :3] / np.maximum(length, SMALLEST)
            is_shown = np.abs(np.linalg.det(linear)) > SINGULAR
            indices = tuple(np.array(instances[group])[is_shown].tolist())
            if indices:
                placed += [_Placed(member, indices, matrices[is_shown]) for member in groups[group][1]]
    return placed, [groups[name][0] for name in groups if name in kept]


def _group_of(instance: Any) -> str:
    """Identifier of an instance's group, which Mitsuba tells in its description alone."""
    found = re.search(r'name = "(.*)",\n', str(instance))
    if found is None:
        raise SceneError(f"this version of Mitsuba describes instances otherwise: {instance}")
    return found[1]


def _to_world(instance: Any) -> F32:
    return np.array(mi.traverse(instance)["to_world"].matrix, np.float32)[..., 0]


def _is_mergeable(shape: Any) -> bool:
    """Whether a shape is a mesh without a role of its own, or textures that its material looks up."""
    has_role = shape.is_emitter() or shape.is_sensor() or shape.is_medium_transition()
    return shape.is_mesh() and not (has_role or any("." in name for name in _attributes(shape)))


def _key(item: _Placed) -> Any:
    """Equal for meshes that can be merged."""
    shape = item.shape
    if not _is_mergeable(shape):
        return item.indices
    widths = tuple((name, width) for name, (_, width) in item.buffers.items())
    return shape.bsdf().ptr, widths, shape.has_face_normals(), shape.has_flipped_normals()


def _attributes(shape: Any) -> dict[str, Any]:
    """What the vertices and triangles of a shape have, as far as it can be set."""
    parameters = mi.traverse(shape)
    names = (name for name in parameters.keys() if name.startswith(("vertex_", "face_")))  # noqa: SIM118
    return {name: parameters[name] for name in names}


def _merged(name: str, items: Sequence[_Placed]) -> Any:
    """One mesh of several, with the material of the first."""
    first = items[0].shape
    properties = mi.Properties()
    properties["bsdf"] = first.bsdf()
    properties["face_normals"] = first.has_face_normals()
    properties["flip_normals"] = first.has_flipped_normals()
    mesh = mi.Mesh(
        name,
        vertex_count=sum(item.shape.vertex_count() * len(item.indices) for item in items),
        face_count=sum(item.shape.face_count() * len(item.indices) for item in items),
        has_vertex_normals=first.has_vertex_normals(),
        has_vertex_texcoords=first.has_vertex_texcoords(),
        props=properties,
    )
    counts = [item.shape.vertex_count() for item in items for _ in item.indices]
    bases = np.cumsum([0, *counts[:-1]]).astype(np.uint32)
    parameters = mi.traverse(mesh)
    for key, (_, width) in items[0].buffers.items():
        values = lanes(np.concatenate([_values(item, key).ravel() for item in items]))
        if key in parameters:
            parameters[key] = values
        else:
            mesh.add_attribute(key, width, values)
    ends = np.cumsum([len(item.indices) for item in items])[:-1]
    faces = zip(items, np.split(bases, ends), strict=True)
    parameters["faces"] = lanes(
        np.concatenate([(_faces(item) + b[:, None, None]).ravel() for item, b in faces])
    )
    parameters.update()
    return mesh


def _faces(item: _Placed) -> U32:
    """Vertices of the triangles of all copies; (N, T, 3)."""
    faces = np.array(item.shape.faces_buffer()).reshape(1, -1, 3)
    if item.matrices is None:
        return faces
    is_mirrored = np.linalg.det(item.matrices[:, :3, :3]) < 0.0
    return np.where(is_mirrored[:, None, None], faces[:, :, ::-1], faces)


def _values(item: _Placed, name: str) -> F32:
    """What the vertices or triangles of all copies have; (N, V, width)."""
    buffer, width = item.buffers[name]
    values = np.array(buffer, np.float32).reshape(1, -1, width)
    if item.matrices is None:
        return values
    linear = item.matrices[:, :3, :3]
    if name == "vertex_positions":
        positions: F32 = values @ linear.transpose(0, 2, 1) + item.matrices[:, None, :3, 3]
        return positions
    if name == "vertex_normals":
        # By the cofactors, which are the inverse transpose times the determinant. Mitsuba normalizes what it
        # interpolates.
        a, b, c = linear.transpose(1, 0, 2)
        cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=2)
        scale = np.sign(np.linalg.det(linear)) / np.maximum(np.abs(cofactors).max(axis=(1, 2)), SMALLEST)
        normals: F32 = values @ (cofactors * scale[:, None, None])
        return normals
    return np.tile(values, (len(linear), 1, 1))
