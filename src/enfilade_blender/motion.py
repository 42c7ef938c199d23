# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds what moves, deforms or changes: the exported scene is static."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from enfilade_blender.notes import Notes
from enfilade_blender.records import Selection

SAMPLES = 5  # frames at which poses are compared
LISTED = 20  # objects that are named
TOLERANCE = 1e-5
SIZES = ("shadow_soft_size", "size", "size_y", "spot_size", "spot_blend", "angle")  # of lamps
DEFORMING = ("ARMATURE", "MESH_CACHE", "MESH_SEQUENCE_CACHE", "CLOTH", "SOFT_BODY", "OCEAN", "WAVE", "FLUID")
CARRYING = ("CAMERA", "EMPTY", "ARMATURE", "LATTICE", "SPEAKER", "LIGHT_PROBE")  # types without a surface
TARGETS = ("object", "target", "origin", "mirror_object", "offset_object", "texture_coords_object")


def note_motion(selection: Selection, notes: Notes) -> None:
    """Note every object with a surface or light that changes, and animated materials and worlds."""
    first, last = selection.frames
    if first == last:
        return
    frames = sorted({int(frame) for frame in np.linspace(first, last, SAMPLES)})
    poses, lights = zip(*[_state(selection, frame) for frame in frames], strict=True)
    changing = _changing(poses)
    shown = [obj for obj in selection.scene.objects if _is_shown(obj)]
    moving = [obj.name for obj in shown if obj.name in changing]
    deforming = [obj.name for obj in shown if obj.name not in changing and _deforms(obj, changing)]
    effect = f"it stays as in frame {first}"
    for name in moving[:LISTED]:
        notes.add("not-carried", name, "Animation", "its motion is left out", effect)
    for name in deforming[:LISTED]:
        notes.add("not-carried", name, "Animation", "its deformation is left out", effect)
    for name in _changing(lights):
        notes.add("not-carried", name, "Animation", "the change of its light is left out", effect)
    world, lamps = selection.scene.world, [lamp for lamp in bpy.data.lights if lamp.users and lamp.use_nodes]
    used = [material for material in bpy.data.materials if material.users] + ([world] if world else [])
    for data in used + lamps:
        trees = _trees(data.node_tree)
        places = {node.object.name for tree in trees for node in tree.nodes if getattr(node, "object", None)}
        is_animated = any(map(_is_animated, [*([] if data in lamps else [data]), *trees]))
        if is_animated or not places.isdisjoint(changing):
            notes.add("not-carried", data.name, "Animation", "its animation is left out", effect)
    for image in bpy.data.images:
        if image.users and image.source in ("SEQUENCE", "MOVIE"):
            notes.add("not-carried", image.name, "Animation", "its motion is left out", effect)
    rest = max(len(moving) - LISTED, 0) + max(len(deforming) - LISTED, 0)
    if rest:
        notes.add("not-carried", f"{rest} further objects", "Animation", "their motion is left out", effect)
    selection.scene.frame_set(first)


def _state(selection: Selection, frame: int) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Poses and visibility of objects, and power, colour and size of lamps, by name."""
    selection.scene.frame_set(frame)
    objects = selection.scene.objects
    lamps = [obj for obj in objects if obj.type == "LIGHT"]
    lights = {
        obj.name: np.array(
            [obj.data.energy, *obj.data.color, *(float(getattr(obj.data, name, 0.0)) for name in SIZES)]
        )
        for obj in lamps
    }
    return {obj.name: np.append(np.array(obj.matrix_world), obj.hide_render) for obj in objects}, lights


def _is_shown(obj: Any) -> bool:
    """Whether an object has a surface, light or instances, rather than carrying others, or a camera."""
    return obj.type not in CARRYING or obj.instance_type != "NONE"


def _changing(states: tuple[dict[str, np.ndarray], ...]) -> list[str]:
    first, *rest = states
    return [name for name, value in first.items() if any(_differs(value, later.get(name)) for later in rest)]


def _is_animated(data: Any) -> bool:
    animation = getattr(data, "animation_data", None)
    return animation is not None and bool(animation.action or animation.drivers or animation.nla_tracks)


def _trees(tree: Any) -> list[Any]:
    """A node tree and the groups in it."""
    if tree is None:
        return []
    groups = [node.node_tree for node in tree.nodes if node.type == "GROUP" and node.node_tree]
    return [tree, *(inner for group in groups for inner in _trees(group))]


def _differs(pose: np.ndarray, other: Any) -> bool:
    return other is not None and bool(np.abs(pose - other).max() > TOLERANCE)


def _deforms(obj: Any, changing: list[str]) -> bool:
    """Whether the shape of an object changes, by itself or by an object that changes."""
    keys = getattr(obj.data, "shape_keys", None)
    has_keys = keys is not None and keys.animation_data is not None
    modifiers = [modifier for modifier in obj.modifiers if modifier.show_render]
    targets = {getattr(getattr(m, name, None), "name", "") for m in modifiers for name in TARGETS}
    return has_keys or any(m.type in DEFORMING for m in modifiers) or not targets.isdisjoint(changing)
