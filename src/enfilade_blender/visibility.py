# SPDX-License-Identifier: GPL-3.0-or-later
"""What cameras see and do not see in Cycles: the sun, as a part of the environment, and what they clip."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

from enfilade_blender.camera import RAY_OFFSET
from enfilade_blender.lights import Sun
from enfilade_blender.motion import trees
from enfilade_blender.notes import Notes
from enfilade_blender.records import Selection, View

SAMPLED_VIEWS = 64
RAYS_OF_VIEWS = 8, 5  # of a view across and down
EVERY = 5  # of these rays, where there are too many objects for all
BOXES = 800_000  # of objects that the rays of one kind of note are tested against: 1.2 s
LISTED = 3  # objects that are named
MINIATURE = 0.1  # scene units: Mitsuba moves the origins of rays by a thousandth of it
MOST_LAYERS, STEP = 16, 1e-4  # that a ray passes; of its distance from the origin, from one to the next
TRANSMITTING = ("BSDF_GLASS", "BSDF_REFRACTION", "BSDF_TRANSPARENT", "BSDF_TRANSLUCENT")  # nodes
PASSING = {"Alpha": 1.0, "Transmission Weight": 0.0}  # inputs of `Principled` that let no light pass
FAR = 1e4  # scene units, to a point in the sun's direction


def cast_count(instances: int) -> int:
    """Number of rays that are cast at a scene for a kind of note: Blender tests each against all objects."""
    return max(BOXES // max(instances, 1), math.prod(RAYS_OF_VIEWS) // EVERY)


def note_sun(sun: Sun | None, views: list[View], selection: Selection, notes: Notes, *, casts: int) -> None:
    """Note a sun that no object hides from the camera in some view."""
    if sun is None:
        return
    graph = bpy.context.evaluated_depsgraph_get()
    for view in _spread(views, casts):
        eye = view.pose[:3, 3]
        ((x, y, depth),) = view.pixels(eye[None] + FAR * sun.direction, selection.size)
        if depth <= 0.0 or not (0.0 <= x <= selection.size[0] and 0.0 <= y <= selection.size[1]):
            continue
        if _cast(selection, graph, eye, sun.direction, FAR, through_glass=True) is None:
            what, effect = "the camera sees the sun", "a bright shape where Cycles shows none"
            notes.add("approximated", sun.name, "Sun", what, effect)
            return


def _cast(
    selection: Selection,
    graph: Any,
    eye: np.ndarray,
    direction: np.ndarray,
    reach: float | None = None,
    *,
    through_glass: bool = False,
) -> tuple[np.ndarray, Any] | None:
    """Place and object that the camera sees first in a direction; None if it sees none."""
    place, reaching = Vector(eye), {} if reach is None else {"distance": reach}
    for _ in range(MOST_LAYERS):
        is_hit, place, _, face, obj, _ = selection.scene.ray_cast(graph, place, Vector(direction), **reaching)
        if not is_hit:
            return None
        if obj.visible_camera and not (through_glass and _may_transmit(obj, face)):
            return np.array(place), obj
        place += STEP * max(1.0, place.length) * Vector(direction).normalized()
    return np.array(place), obj


def _may_transmit(obj: Any, face: int) -> bool:
    """Whether the material of an object's face has lobes that light passes."""
    mesh = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    slots = obj.material_slots
    index = mesh.polygons[face].material_index if face < len(getattr(mesh, "polygons", ())) else 0
    material = slots[min(index, len(slots) - 1)].material if slots else None
    for node in (node for tree in trees(material and material.node_tree) for node in tree.nodes):
        inputs = {name: node.inputs[name] for name in PASSING if name in node.inputs}
        passes = (s.is_linked or s.default_value != PASSING[name] for name, s in inputs.items())
        is_used = not node.mute and any(output.is_linked for output in node.outputs)
        if is_used and (node.type in TRANSMITTING or (node.type == "BSDF_PRINCIPLED" and any(passes))):
            return True
    return False


def note_depths(views: list[View], selection: Selection, notes: Notes, *, casts: int) -> None:
    """Note cameras that clip surfaces in Blender, and those as near to all they see as in a miniature.

    Here they see all from the eye on.
    """
    graph = bpy.context.evaluated_depsgraph_get()
    clipped: dict[tuple[str, str], dict[str, None]] = {}  # objects by camera and setting
    rays = math.prod(RAYS_OF_VIEWS)
    step = 1 if casts >= rays * min(len(views), SAMPLED_VIEWS) else EVERY
    for view in _spread(views, casts * step // rays):
        near, far = (view.projection[2, 3] / (view.projection[2, 2] + sign) for sign in (-1.0, 1.0))
        eye, depths = view.pose[:3, 3], []
        for direction in _directions(view)[::step]:  # of unit depth
            if (found := _cast(selection, graph, eye, direction)) is None:
                continue
            place, obj = found
            depth = np.linalg.norm(place - eye) / np.linalg.norm(direction)
            depths.append(depth)
            if not near <= depth <= far:
                setting = "Clip Start" if depth < near else "Clip End"
                clipped.setdefault((view.name, setting), {})[obj.name] = None
        if depths and np.median(depths) < MINIATURE:
            what = f"it is as near to what it sees as in a miniature: within {MINIATURE} units"
            effect = f"shadows are lost within {RAY_OFFSET:.2g} units of contacts: make the scene larger"
            notes.add("approximated", view.name, "Location", what, effect)
    for (name, setting), objects in clipped.items():
        names = ", ".join([*objects][:LISTED]) + (" and others" if len(objects) > LISTED else "")
        effect = f"surfaces that it clips are visible: {names}"
        notes.add("not-carried", name, setting, "its clipping is left out", effect)


def _spread(views: list[View], count: int) -> list[View]:
    """At most a number of views, and of sampled ones, along the path."""
    return views[:: max(math.ceil(len(views) / min(count, SAMPLED_VIEWS)), 1)]


def _directions(view: View) -> list[np.ndarray]:
    """World directions of unit depth, spread over a view."""
    across, down = (2.0 * (np.arange(count) + 0.5) / count - 1.0 for count in RAYS_OF_VIEWS)
    x, y = np.meshgrid(across, down)
    local = np.stack(
        [
            (x + view.projection[0, 2]) / view.projection[0, 0],
            (y + view.projection[1, 2]) / view.projection[1, 1],
            np.full_like(x, -1.0),
        ],
        axis=-1,
    )
    return list(local.reshape(-1, 3) @ view.pose[:3, :3].T)
