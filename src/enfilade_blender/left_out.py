# SPDX-License-Identifier: GPL-3.0-or-later
"""Notes what nothing carries: settings of the scene, missing files, limits of light."""

from __future__ import annotations

import math
from itertools import product
from pathlib import Path
from typing import Any

import bpy
from mathutils import Vector

from enfilade_blender.job import Job
from enfilade_blender.notes import Notes
from enfilade_blender.records import Lamp, Selection

PASSED_ON = {"R_LAYERS", "COMPOSITE", "VIEWER", "GROUP_OUTPUT", "REROUTE", "FRAME"}  # compositor nodes
FAST_GI_EFFECTS = {
    "REPLACE": "indirect light is computed, not approximated: it may be brighter or darker",
    "ADD": "indirect light is darker: the approximation adds light of the world",
}
LINEAR = "Linear Rec.709"
SOFT_FALLOFF = 0.1  # least error of the irradiance of the nearest surface that is noted
LEAST_CLAMP = 10.0  # Cycles' own limit of indirect light; a lower one makes pictures darker


def note_settings(job: Job, selection: Selection, notes: Notes) -> None:
    """Note settings of the scene's view, frames, view layers and of what follows the render."""
    scene = selection.scene
    (view, _), render = selection.colour_management, scene.render
    space = getattr(getattr(bpy.data, "colorspace", None), "working_space", LINEAR)  # from Blender 5.0 on
    tones, picture = "the tones of the picture differ", "the picture is as Cycles alone renders it"
    settings = {
        ("Working Space", f"its working space {space}", "colours are taken as Linear Rec.709"): space
        != LINEAR,
        ("Color Management: Gamma", "gamma of the view", tones): abs(view.gamma - 1.0) > 1e-4,
        ("Color Management: Curves", "curves of the view", tones): view.use_curve_mapping,
        ("Color Management: White balance", "white balance of the view", tones): getattr(
            view,
            "use_white_balance",
            False,  # from Blender 4.3 on
        ),
        ("Compositor", "its compositor", picture): render.use_compositing and _has_compositor(scene),
        ("Sequencer", "its video sequencer", picture): render.use_sequencer and _has_strips(scene),
        ("Freestyle", "its lines", picture): render.use_freestyle,
        ("Render Region", "its render region", "the whole frame is rendered"): render.use_border,
        ("Stereoscopy", "its pair of views", "there is one, of the camera itself"): render.use_multiview,
        ("Simplify: Culling", "its culling", "objects that it removes are there"): render.use_simplify
        and (scene.cycles.use_camera_cull or scene.cycles.use_distance_cull),
        ("Metadata", "text in the picture", "the picture is without it"): render.use_stamp,
        ("Frame Step", f"its step of {scene.frame_step}", "every frame is rendered"): scene.frame_step != 1,
    }
    for (name, what, effect), is_used in settings.items():
        if is_used:
            notes.add("not-carried", scene.name, name, f"{what} is left out", effect)
    if render.engine != "CYCLES" and job.source.suffix.lower() == ".blend":
        what = f"the scene is read as Cycles has it, not {render.engine.removeprefix('BLENDER_')}"
        notes.add("approximated", scene.name, "Render Engine", what, "the picture is that of a path tracer")
    (first, last), (start, end) = selection.frames, (scene.frame_start, scene.frame_end)
    if first < start or last > end:
        what = f"frames {first}-{last} reach beyond the range of the scene, {start}-{end}"
        notes.add("approximated", scene.name, "Frame Range", what, "the camera may stand still in these")
    layer = selection.view_layer
    for name in ("material_override", "world_override"):  # Blender 4.2 has none of the world
        if getattr(layer, name, None) is not None:
            what, effect = f"its {name.replace('_', ' ')} is left out", "materials and world are the scene's"
            notes.add("not-carried", layer.name, "Override", what, effect)
    if not layer.use_solid:
        what, effect = "that it leaves out surfaces is left out", "they are visible"
        notes.add("not-carried", layer.name, "Filter", what, effect)
    for other in scene.view_layers:
        if other.use and other != layer and not job.view_layer:
            what = f"of several view layers {layer.name} is used"
            notes.add("not-carried", other.name, "", what, "choose this one by blender.view_layer")


def _has_compositor(scene: Any) -> bool:
    tree = getattr(scene, "compositing_node_group", None)  # from Blender 5.0 on
    if tree is None and getattr(scene, "use_nodes", False):
        tree = getattr(scene, "node_tree", None)
    return tree is not None and any(node.type not in PASSED_ON and not node.mute for node in tree.nodes)


def _has_strips(scene: Any) -> bool:
    editor = scene.sequence_editor
    strips = getattr(editor, "strips", None) or getattr(editor, "sequences", ())  # before Blender 4.4
    return len(strips) > 0


def note_inputs(selection: Selection, notes: Notes) -> None:
    """Note fonts, caches and drivers that are missing or blocked in the evaluated scene."""
    kinds = (
        (bpy.data.fonts, "Font", "Blender's own font stands in"),
        (bpy.data.cache_files, "Cache", "what it moves or deforms stays at rest"),
    )
    for items, node, effect in kinds:
        for item in items:
            is_packed = getattr(item, "packed_file", None) is not None or item.filepath == "<builtin>"
            file = Path(bpy.path.abspath(item.filepath, library=item.library))
            if item.users and not is_packed and not file.is_file():
                notes.add("not-carried", item.name, node, f"its file {file} is missing", effect)
    if bpy.app.autoexec_fail and bpy.app.autoexec_fail_message.startswith("Driver"):
        what = f"drivers that need Python don't run: {bpy.app.autoexec_fail_message}"
        notes.add("not-carried", selection.scene.name, "Drivers", what, "what they drive is 0")


def note_light(selection: Selection, lamps: list[Lamp], notes: Notes, *, has_glass: bool) -> None:
    """Note light that Cycles leaves out by its settings."""
    scene, cycles = selection.scene, selection.scene.cycles
    indirect = cycles.sample_clamp_indirect
    settings = {
        ("Refractive Caustics", "glass passes light, which it blocks in Blender"): (
            has_glass and not cycles.caustics_refractive
        ),
        ("Reflective Caustics", "mirrors and metals throw light"): not cycles.caustics_reflective,
        ("Clamping", "bright paths are brighter"): (
            cycles.sample_clamp_direct > 0.0 or 0.0 < indirect < LEAST_CLAMP
        ),
        ("Fast GI Approximation", FAST_GI_EFFECTS[cycles.fast_gi_method]): cycles.use_fast_gi,
    }
    for (name, effect), is_left_out in settings.items():
        if is_left_out:
            notes.add("not-carried", scene.name, f"Light Paths: {name}", "the setting is left out", effect)
    lights = [(lamp.name, lamp.data.cycles) for lamp in lamps]
    if selection.world is not None:
        lights.append((selection.world.name, selection.world.cycles))
    for name, light in lights:
        if light.max_bounces < cycles.max_bounces:
            what = f"its limit of bounces, {light.max_bounces}, is left out"
            effect = "its light is reflected further, and indirect light is brighter"
            notes.add("not-carried", name, "Max Bounces", what, effect)


def note_falloff(lamps: list[Lamp], selection: Selection, notes: Notes, *, casts: int) -> None:
    """Note lamps of soft falloff that are near surfaces for their radius; the largest, if rays are few.

    In Cycles their light comes from a disc that faces every point that it lights, by I / (d^2 + r^2): of no
    emitter with a place of its own.
    """
    graph = bpy.context.evaluated_depsgraph_get()
    soft = [lamp for lamp in lamps if _is_soft(lamp.data)]
    soft.sort(key=lambda lamp: -lamp.data.shadow_soft_size)
    directions = [Vector(one).normalized() for one in product((-1, 0, 1), repeat=3) if any(one)]
    if casts < len(soft) * (1 + len(directions)):
        directions = [one for one in directions if max(map(abs, one)) == 1.0]
    for lamp in soft[: casts // (1 + len(directions))]:
        data = lamp.data
        reach = data.shadow_soft_size / math.sqrt(SOFT_FALLOFF)
        place, axis = Vector(lamp.matrix[:3, 3]), Vector(-lamp.matrix[:3, 2]).normalized()
        around = directions
        if data.type == "SPOT":
            around = [one for one in around if one.dot(axis) > math.cos(0.5 * data.spot_size)]
        hits = [selection.scene.ray_cast(graph, place, one, distance=reach) for one in (axis, *around)]
        distances = [(hit[1] - place).length for hit in hits if hit[0]]
        if distances:
            excess = (data.shadow_soft_size / max(min(distances), 1e-6)) ** 2
            effect = f"surfaces near it are brighter, at {min(distances):.2g} units by {excess:.0%}"
            notes.add("approximated", lamp.name, "Soft Falloff", "its falloff is quadratic", effect)


def _is_soft(data: Any) -> bool:
    is_soft = data.type in ("POINT", "SPOT") and data.use_soft_falloff and data.energy > 0.0
    return is_soft and data.shadow_soft_size > 0.0
