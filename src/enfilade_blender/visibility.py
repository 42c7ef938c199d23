# SPDX-License-Identifier: GPL-3.0-or-later
"""What cameras see and do not see in Cycles: the sun, as a part of the environment, and what they clip."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from mathutils import Vector

from enfilade_blender.lights import Sun
from enfilade_blender.notes import Notes
from enfilade_blender.records import Selection, View

SAMPLED_VIEWS = 64
RAYS = 8, 5  # of a view across and down
NEAR = 0.1  # Blender's own, within which nothing is expected
FAR = 1e4  # scene units, to a point in the sun's direction


def note_sun(sun: Sun | None, views: list[View], selection: Selection, notes: Notes) -> None:
    """Note a sun that no object hides from the camera in some view."""
    if sun is None:
        return
    graph = bpy.context.evaluated_depsgraph_get()
    for view in views[:: max(len(views) // SAMPLED_VIEWS, 1)]:
        eye = view.pose[:3, 3]
        ((x, y, depth),) = view.pixels(eye[None] + FAR * sun.direction, selection.size)
        if depth <= 0.0 or not (0.0 <= x <= selection.size[0] and 0.0 <= y <= selection.size[1]):
            continue
        if not selection.scene.ray_cast(graph, Vector(eye), Vector(sun.direction), distance=FAR)[0]:
            what, effect = "the camera sees the sun", "a bright shape where Cycles shows none"
            notes.add("approximated", sun.name, "Sun", what, effect)
            return


def note_clipping(views: list[View], selection: Selection, notes: Notes) -> None:
    """Note cameras that clip surfaces in Blender: here they see all from the eye on."""
    graph, found = bpy.context.evaluated_depsgraph_get(), set()
    boxes = [np.array(obj.matrix_world) @ _homogeneous(obj.bound_box).T for obj in selection.scene.objects]
    corners = np.concatenate([box[:3].T for box in boxes])
    for view in views[:: max(len(views) // SAMPLED_VIEWS, 1)]:
        near, far = (view.projection[2, 3] / (view.projection[2, 2] + sign) for sign in (-1.0, 1.0))
        eye = view.pose[:3, 3]
        is_all_seen = near <= 1.01 * NEAR and np.linalg.norm(corners - eye, axis=1).max() <= far
        if view.name in found or is_all_seen:
            continue
        for direction in _directions(view):  # of unit depth
            length = float(np.linalg.norm(direction))
            is_hit, place, *_ = selection.scene.ray_cast(graph, Vector(eye), Vector(direction))
            depth = np.linalg.norm(np.array(place) - eye) / length if is_hit else near
            if not near <= depth <= far:
                what, effect = "its clipping is left out", "surfaces that it clips are visible"
                notes.add(
                    "not-carried", view.name, "Clip Start" if depth < near else "Clip End", what, effect
                )
                found.add(view.name)
                break


def _homogeneous(points: Any) -> np.ndarray:
    return np.pad(np.array(points), ((0, 0), (0, 1)), constant_values=1.0)


def _directions(view: View) -> list[np.ndarray]:
    """World directions of unit depth, spread over a view."""
    across, down = (2.0 * (np.arange(count) + 0.5) / count - 1.0 for count in RAYS)
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
