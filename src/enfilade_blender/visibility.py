# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the camera sees the sun: Cycles does not show it, Mitsuba does, as a part of the environment."""

from __future__ import annotations

import bpy
from mathutils import Vector

from enfilade_blender.lights import Sun
from enfilade_blender.notes import Notes
from enfilade_blender.records import Selection, View

SAMPLED_VIEWS = 64
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
