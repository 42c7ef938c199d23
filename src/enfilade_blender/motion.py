# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds what moves, deforms or changes: the exported scene is static."""

from __future__ import annotations

import math
from itertools import islice
from typing import Any

import bpy
import numpy as np

from enfilade_blender.evaluate import check_generated, instance_name
from enfilade_blender.job import Limits
from enfilade_blender.lights import SIZES
from enfilade_blender.notes import Notes
from enfilade_blender.records import Selection

BUDGET = 2_000_000  # objects and instances that are compared in all frames: each takes some microseconds
COMPARED = 100_000  # objects and instances of a frame: each takes 500 bytes
LISTED = 20  # objects that are named
TOLERANCE = 1e-5
DEFORMING = ("MESH_CACHE", "MESH_SEQUENCE_CACHE", "CLOTH", "SOFT_BODY", "OCEAN", "WAVE", "FLUID", "BUILD")
CARRYING = ("CAMERA", "EMPTY", "ARMATURE", "LATTICE", "SPEAKER", "LIGHT_PROBE")  # types without a surface
TARGETS = ("object", "target", "origin", "mirror_object", "offset_object", "texture_coords_object")


class Motion:
    """Compares the frames of a scene with the first one.

    Parameters
    ----------
    selection, limits
    """

    def __init__(self, selection: Selection, limits: Limits) -> None:
        self._selection, self._limits = selection, limits
        self._objects = selection.objects()
        self._rendered = set(self._objects)
        self._objects += [obj for obj in selection.scene.objects if obj not in self._rendered]  # as cutters
        self._first: dict[Any, Any] = {}
        self._changed: dict[Any, None] = {}
        self._shown: set[str] = set()
        self._stride = 1
        self._is_cut = False  # instances beyond those that are compared

    def look(self, frame: int) -> None:
        """Compare the frame that the scene is at; all are set in order, which steps simulations.

        Of scenes of many objects some frames are left out.
        """
        first, last = self._selection.frames
        if first == last or ((frame - first) % self._stride and frame != last):
            return
        state = self._state()
        if frame == first:
            self._first = state
            self._stride = math.ceil(len(state) * (last - first) / BUDGET)
        for key in {**self._first, **state}:
            if _differs(self._first.get(key), state.get(key)):
                self._changed[key] = None

    def note(self, notes: Notes) -> None:
        """Note every object with a surface or light that changes, and animated materials and worlds."""
        first, last = self._selection.frames
        if first == last:
            return
        effect = f"it stays as in frame {first}"
        places, shapes, lights, exposures = (self._names(k) for k in ("place", "shape", "light", "exposure"))
        shown = [obj for obj in self._objects if obj.name in self._shown and _is_shown(obj)]
        moving = [obj.name for obj in shown if obj.name in places]
        moving += [name for _, name, owner, *_ in self._copies() if owner not in places]
        deforming = [*shapes, *(obj.name for obj in shown if _deforms(obj, places))]
        changes = dict.fromkeys(moving, "motion")
        changes = {**changes, **{name: "deformation" for name in deforming if name not in changes}}
        for name in list(changes)[:LISTED]:
            notes.add("not-carried", name, "Animation", f"its {changes[name]} is left out", effect)
        if len(changes) > LISTED:
            rest = f"{len(changes) - LISTED} further objects"
            notes.add("not-carried", rest, "Animation", "their motion is left out", effect)
        for name in lights:
            if name in self._shown:
                notes.add("not-carried", name, "Animation", "the change of its light is left out", effect)
        for name in exposures:
            notes.add("not-carried", name, "Exposure", "its animation is left out", effect)
        if self._stride > 1 or self._is_cut:
            what = (
                f"motion is looked for in one of {self._stride} frames, and in {COMPARED} objects and copies"
            )
            notes.add(
                "approximated", self._selection.scene.name, "Animation", what, "other motion is not noted"
            )
        self._note_data(places, effect, notes)

    def _note_data(self, places: dict[str, None], effect: str, notes: Notes) -> None:
        """Note animated materials, worlds, nodes of lamps, and images."""
        world = self._selection.world
        lamps = [lamp for lamp in bpy.data.lights if lamp.users and lamp.use_nodes]
        used = [material for material in bpy.data.materials if material.users] + ([world] if world else [])
        for data in used + lamps:
            inner = trees(data.node_tree)
            read = {
                node.object.name for tree in inner for node in tree.nodes if getattr(node, "object", None)
            }
            is_animated = any(map(_is_animated, [*([] if data in lamps else [data]), *inner]))
            if is_animated or not read.isdisjoint(places):
                notes.add("not-carried", data.name, "Animation", "its animation is left out", effect)
        for image in bpy.data.images:
            if image.users and image.source in ("SEQUENCE", "MOVIE"):
                notes.add("not-carried", image.name, "Animation", "its motion is left out", effect)

    def _names(self, kind: str) -> dict[str, None]:
        return {key[1]: None for key in self._changed if key[0] == kind}

    def _copies(self) -> list[Any]:
        return [key for key in self._changed if key[0] == "copy"]

    def _state(self) -> dict[Any, Any]:
        """Matrices and numbers of the current frame, by a kind and a name.

        Objects have places, of armatures those of their bones; surfaces have bounds, lamps power, colour and
        size.
        """
        graph = bpy.context.evaluated_depsgraph_get()
        check_generated(graph, self._limits)
        scene = self._selection.scene
        exposure = self._selection.colour_management[0].exposure, scene.cycles.film_exposure
        state: dict[Any, Any] = {("exposure", scene.name): ((), exposure)}
        for obj in self._objects:
            bones = [bone.matrix.copy() for bone in obj.pose.bones] if obj.type == "ARMATURE" else ()
            state["place", obj.name] = (obj.matrix_world.copy(), *bones), (float(obj.hide_render),)
            if obj.hide_render or obj not in self._rendered:
                continue
            self._shown.add(obj.name)
            if obj.type == "LIGHT":
                state["light", obj.name] = (), _light_numbers(obj.data)
            elif obj.type not in CARRYING:
                state["shape", obj.name] = _bounds(obj.evaluated_get(graph))
        self._is_cut |= len(graph.object_instances) > COMPARED
        for instance in islice(graph.object_instances, COMPARED):
            if not instance.is_instance or instance.parent.original.hide_render:
                continue
            name, place = instance_name(instance), instance.matrix_world.copy()
            state["copy", name, instance.parent.name, *instance.persistent_id] = (place,), ()
            if ("shape", name) not in state:
                state["shape", name] = _bounds(instance.object)
        return state


def trees(tree: Any) -> list[Any]:
    """A node tree and the groups in it."""
    if tree is None:
        return []
    groups = [node.node_tree for node in tree.nodes if node.type == "GROUP" and node.node_tree]
    return [tree, *(inner for group in groups for inner in trees(group))]


def _light_numbers(data: Any) -> tuple[float, ...]:
    """Power, colour, size, exposure, temperature and shadow of a lamp; some are from Blender 4.5 on."""
    sizes = (getattr(data, name, 0.0) for name in SIZES)
    temperature = data.temperature if getattr(data, "use_temperature", False) else 0.0
    others = getattr(data, "exposure", 0.0), temperature, float(data.use_shadow)
    return data.energy, *data.color, *sizes, *others


def _bounds(evaluated: Any) -> tuple[tuple[()], tuple[float, ...]]:
    """Lowest and highest corner of an evaluated object, and its number of vertices."""
    box, count = evaluated.bound_box, len(getattr(evaluated.data, "vertices", ()))
    return (), (*box[0], *box[6], count)


def _is_shown(obj: Any) -> bool:
    """Whether an object has a surface, light or instances, rather than carrying others, or a camera."""
    return obj.type not in CARRYING or obj.instance_type != "NONE"


def _is_animated(data: Any) -> bool:
    animation = getattr(data, "animation_data", None)
    return animation is not None and bool(animation.action or animation.drivers or animation.nla_tracks)


def _differs(value: Any, other: Any) -> bool:
    if value is None or other is None or len(value[0]) != len(other[0]):
        return value is not other
    if value == other:
        return False
    (places, numbers), (others, later) = value, other
    pairs = [*zip(places, others, strict=True), (numbers, later)]
    return any(np.abs(np.subtract(a, b)).max(initial=0.0) > TOLERANCE for a, b in pairs)


def _deforms(obj: Any, places: dict[str, None]) -> bool:
    """Whether the shape of an object changes, by itself or by an object that changes, by its settings."""
    modifiers = [modifier for modifier in obj.modifiers if modifier.show_render]
    targets = {getattr(getattr(m, name, None), "name", "") for m in modifiers for name in TARGETS}
    data = [obj.data if obj.type != "LIGHT" else None, getattr(obj.data, "shape_keys", None)]
    is_deformed = any(m.type in DEFORMING for m in modifiers) or not targets.isdisjoint(places)
    return is_deformed or any(map(_is_animated, data))
