# SPDX-License-Identifier: GPL-3.0-or-later
"""Exports a Blender file: scene, meshes, textures, camera path."""

from __future__ import annotations

import math
from typing import Any

import bpy

from enfilade_blender.camera import camera_path, read_views
from enfilade_blender.evaluate import evaluate
from enfilade_blender.failure import ExportError
from enfilade_blender.job import Job
from enfilade_blender.lamp_nodes import LampNodes
from enfilade_blender.left_out import note_falloff, note_inputs, note_light, note_settings
from enfilade_blender.lights import emitters, is_finite, is_portal, needs_passing, note_glass, split_suns
from enfilade_blender.limits import check_size
from enfilade_blender.motion import Motion
from enfilade_blender.notes import Notes, report_progress
from enfilade_blender.open_file import files_used, open_source
from enfilade_blender.records import Selection
from enfilade_blender.run import write_json
from enfilade_blender.scene_xml import LAMP, Element, named, plugin, write_scene
from enfilade_blender.shapes import Shapes
from enfilade_blender.visibility import cast_count, note_depths, note_sun
from enfilade_blender.world import environment

GLASS = {"dielectric", "roughdielectric"}  # which stops shadow rays


def export(job: Job) -> dict[str, Any]:
    """Write the scene's folder; content of ``import.json``.

    Raises
    ------
    ExportError
        The file can't be opened, passes a limit, or has nothing to render.
    """
    notes = Notes()
    report_progress(0.0, "open")
    selection = open_source(job, notes)
    check_size(selection, job.limits)
    report_progress(0.05, "cameras")
    motion = Motion(selection, job.limits)
    views = read_views(selection, motion, notes)
    motion.note(notes)
    note_settings(job, selection, notes)
    if views:
        write_json(job.out / "camera_path.json", camera_path(views, selection))
    report_progress(0.1, "meshes")
    evaluated = evaluate(selection, job.limits, notes)
    if not evaluated.placed:
        raise ExportError(
            "there is nothing to render: no object has a surface that renders show", selection.scene.name,
            "add a mesh to the scene, or choose another scene or view layer",
        )  # fmt: skip
    note_inputs(selection, notes)
    report_progress(0.3, "materials")
    shapes = Shapes(job, selection, views, notes)
    elements = shapes.write(evaluated.placed)
    note_light(selection, evaluated.lamps, notes, has_glass=bool(shapes.materials.kinds & GLASS))
    report_progress(0.9, "lights")
    lamps, nodes = [lamp for lamp in evaluated.lamps if not is_portal(lamp)], LampNodes(job, selection, notes)
    for lamp in lamps:
        lamp.factor = nodes.factor(lamp)
    lamps = [lamp for lamp in lamps if is_finite(lamp, notes)]
    lamps, sun = split_suns(lamps, notes)
    if shapes.materials.kinds & GLASS and selection.scene.cycles.caustics_refractive:
        note_glass(lamps, notes)
    casts = cast_count(evaluated.instances)
    note_sun(sun, views, selection, notes, casts=casts)
    note_depths(views, selection, notes, casts=casts)
    note_falloff(lamps, selection, notes, casts=casts)
    made = [element for lamp in lamps for element in emitters(lamp, shapes.identifiers, notes)]
    elements = [named(plugin("bsdf", "null"), LAMP), *elements, *made]
    is_volumetric = bool(shapes.materials.kinds & {"mask", "thindielectric"}) or shapes.has_unseen_lamps
    is_volumetric = is_volumetric or needs_passing(made, sun)
    elements += environment(selection, sun, job.out, notes)
    if not any(True for element in elements for _ in element.iter("emitter")):
        effect = "every frame would be black: add a lamp, or a world with light"
        notes.add("not-carried", selection.scene.name, "Light", "there is no light", effect)
    shapes.materials.textures.remove_unused(elements)
    integrator = _integrator(selection, shapes, notes, is_volumetric=is_volumetric)
    write_scene(job.out / "scene.xml", [integrator, *elements])
    counts = {
        "objects": len(evaluated.placed),
        "instances": evaluated.instances,
        "triangles": shapes.triangles,
        "materials": len(shapes.materials),
        "textures": len(shapes.materials.textures),
    }
    return {**_facts(job, selection), "counts": counts, "notes": notes.to_list()}


def _facts(job: Job, selection: Selection) -> dict[str, Any]:
    scene = selection.scene
    view, display = selection.colour_management
    return {
        "format": "enfilade-import",
        "version": 1,
        "blender": bpy.app.version_string.split()[0],
        "source": job.source.name,
        "files": files_used(job),
        "scene": scene.name,
        "camera": scene.camera.name if scene.camera else None,
        "fps": scene.render.fps / scene.render.fps_base,
        "frames": list(selection.frames),
        "size": list(selection.size),
        "exposure_ev": view.exposure + math.log2(max(scene.cycles.film_exposure, 1e-6)),
        "view": {
            "display": display.display_device,
            "view_transform": view.view_transform,
            "look": view.look,
        },
    }


def _integrator(selection: Selection, shapes: Shapes, notes: Notes, *, is_volumetric: bool) -> Element:
    """A path tracer with the file's limit of bounces.

    Cycles limits bounces by kind. A path of many diffuse bounces ends by their own limit, which is the
    smaller one; glass needs further bounces, and so do plastics, whose reflections are of another kind.
    Shadow rays of the volumetric path tracer pass cut-outs and lamps, and with it these do not count in the
    depth of paths.
    """
    cycles = selection.scene.cycles
    bounces = min(cycles.max_bounces, max(cycles.diffuse_bounces, cycles.glossy_bounces))
    if shapes.materials.kinds & GLASS:
        bounces = min(cycles.max_bounces, bounces + 2)
        through = min(cycles.max_bounces, cycles.transmission_bounces)
        if through > bounces:
            what = f"paths through glass end after {bounces} bounces, in Blender after {through}"
            effect = "what is seen or lit through several panes is darker"
            notes.add("approximated", selection.scene.name, "Light Paths: Transmission", what, effect)
    if (diffuse := min(cycles.max_bounces, cycles.diffuse_bounces)) < bounces:
        what = f"diffuse paths end after {bounces} bounces, in Blender after {diffuse}"
        notes.add(
            "approximated", selection.scene.name, "Light Paths: Diffuse", what, "indirect light is brighter"
        )
    if shapes.plastic_area > 0.5 * shapes.area:
        bounces = min(cycles.max_bounces, bounces + 1)
    return plugin("integrator", "volpath" if is_volumetric else "path", max_depth=bounces + 2)
