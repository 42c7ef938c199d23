# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps that the camera would see: Cycles does not show lamps to the camera, Mitsuba does."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from mathutils import Vector

from enfilade_blender.lights import Sun, faces_camera, points_of
from enfilade_blender.records import Lamp, Selection, View

SAMPLED_VIEWS = 64
NEAR = 0.98  # of the distance to a lamp: a surface behind that does not hide it


def seen_lamps(lamps: list[Lamp], sun: Sun | None, views: list[View], selection: Selection) -> set[str]:
    """Names of lamps, and of the sun, that no object hides from the camera in some view."""
    graph = bpy.context.evaluated_depsgraph_get()
    sampled = views[:: max(len(views) // SAMPLED_VIEWS, 1)]
    seen = set()
    for lamp in lamps:
        points = points_of(lamp)
        if any(_sees(view, points, selection, graph) for view in sampled if faces_camera(lamp, view)):
            seen.add(lamp.name)
    for view in sampled if sun is not None else ():
        if sun is not None and _sees(view, view.pose[None, :3, 3] + 1e4 * sun.direction, selection, graph):
            seen.add(sun.name)
    return seen


def _sees(view: View, points: np.ndarray, selection: Selection, graph: Any) -> bool:
    eye = view.pose[:3, 3]
    for point, (x, y, depth) in zip(points, view.pixels(points, selection.size), strict=True):
        if depth <= 0.0 or not (0.0 <= x <= selection.size[0] and 0.0 <= y <= selection.size[1]):
            continue
        distance = float(np.linalg.norm(point - eye))
        toward = Vector((point - eye) / distance)
        is_hidden = selection.scene.ray_cast(graph, Vector(eye), toward, distance=NEAR * distance)[0]
        if not is_hidden:
            return True
    return False
