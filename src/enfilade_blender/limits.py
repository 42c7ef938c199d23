# SPDX-License-Identifier: GPL-3.0-or-later
"""Bounds of a scene's instances and triangles, estimated before Blender makes them.

Instances of geometry nodes can't be counted before they exist; they are counted when they are read.
"""

from __future__ import annotations

from typing import Any

from enfilade_blender.failure import ExportError
from enfilade_blender.job import Limits
from enfilade_blender.records import Selection, rendered_particles

MAX_LEVELS = 12  # of subdivision: a cube has 2e8 triangles


def check_size(selection: Selection, limits: Limits) -> None:
    """Refuse a scene whose instances or triangles pass the limits by its settings alone.

    Raises
    ------
    ExportError
    """
    counts: dict[str, int] = {}
    objects = selection.objects()
    total = sum(_of_object(obj, counts, ()) for obj in objects)
    if total > limits.instances:
        most = max(objects, key=lambda obj: _of_object(obj, counts, ()))
        raise ExportError(
            f"the scene has {total} instances, more than {limits.instances}", most.name,
            "reduce its copies, or raise the limit",
        )  # fmt: skip
    for obj in objects:
        triangles = estimated_triangles(obj, selection.scene.render)
        if triangles > limits.triangles:
            raise ExportError(
                f"it has {triangles} triangles after its modifiers, more than {limits.triangles}", obj.name,
                "lower its levels of subdivision or its array, or raise the limit",
            )  # fmt: skip


def estimated_triangles(obj: Any, render: Any) -> int:
    """Triangles of a mesh after the modifiers that multiply them, and the scene's Simplify."""
    if obj.type != "MESH" or obj.hide_render:
        return 0
    most = min(render.simplify_subdivision_render, MAX_LEVELS) if render.use_simplify else MAX_LEVELS
    count = 2 * len(obj.data.polygons)
    for modifier in obj.modifiers:
        if not modifier.show_render:
            continue
        if modifier.type in ("SUBSURF", "MULTIRES"):
            count *= 4 ** min(modifier.render_levels, most)
        elif modifier.type == "ARRAY" and modifier.fit_type == "FIXED_COUNT":
            count *= modifier.count
    return count


def _instances(collection: Any, counts: dict[str, int], inside: tuple[str, ...]) -> int:
    """Objects that an instanced collection becomes, instances included; a cycle counts once."""
    name = collection.name_full
    if name in inside:
        return 0
    if name not in counts:
        counts[name] = sum(_of_object(obj, counts, (*inside, name)) for obj in collection.all_objects)
    return counts[name]


def _of_object(obj: Any, counts: dict[str, int], inside: tuple[str, ...]) -> int:
    if obj.hide_render:
        return 0
    total = 1
    if obj.instance_type == "COLLECTION" and obj.instance_collection is not None:
        total += _instances(obj.instance_collection, counts, inside)
    if obj.instance_type in ("VERTS", "FACES") and obj.type == "MESH":
        points = obj.data.vertices if obj.instance_type == "VERTS" else obj.data.polygons
        total += len(points) * len(obj.children)
    for system in rendered_particles(obj):
        settings = system.settings
        if settings.render_type in ("OBJECT", "COLLECTION"):
            copies = settings.count * (
                1 + (settings.rendered_child_count if settings.child_type != "NONE" else 0)
            )
            total += copies
    return total
