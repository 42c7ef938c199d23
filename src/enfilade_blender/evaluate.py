# SPDX-License-Identifier: GPL-3.0-or-later
"""The evaluated scene as a renderer sees it: meshes after modifiers, with all their instances.

Blender hands the scene of a render, rather than that of its viewport, to render engines only. This module
is one which renders nothing: visibility, modifiers and levels of subdivision are those of renders.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np

from enfilade_blender.failure import ExportError
from enfilade_blender.job import Limits
from enfilade_blender.mesh_data import AttributeNames, read_mesh
from enfilade_blender.notes import Notes
from enfilade_blender.ply import Mesh
from enfilade_blender.records import Evaluated, Lamp, Placed, Selection, rendered_particles

ENGINE = "ENFILADE_EXPORT"
NOT_CARRIED = {
    "CURVES": "hair curves",
    "POINTCLOUD": "a point cloud",
    "VOLUME": "a volume",
    "GREASEPENCIL": "grease pencil",
    "GPENCIL": "grease pencil",
}
SETTINGS = {  # of a render of nothing
    "engine": ENGINE,
    "resolution_x": 8,
    "resolution_y": 8,
    "resolution_percentage": 100,
    "use_border": False,
    "use_multiview": False,
    "use_compositing": False,
    "use_sequencer": False,
    "use_freestyle": False,  # it draws with EEVEE, and its modules run scripts
}
UV_NODES = ("UVMAP", "NORMAL_MAP", "TANGENT")  # that name a UV map
RAYS_OF_OBJECTS = ("diffuse", "glossy", "transmission")
RAYS_OF_LAMPS = ("diffuse", "glossy", "transmission")


class _Engine(bpy.types.RenderEngine):  # type: ignore[misc]
    bl_idname = ENGINE
    bl_label = "enfilade export"
    bl_use_preview = False
    visit: Callable[[Any], None] | None = None
    error: Exception | None = None
    is_done = False

    def render(self, depsgraph: Any) -> None:
        """Visit the scene; Blender swallows errors of engines, so they are kept."""
        try:
            if _Engine.visit is not None:
                _Engine.visit(depsgraph)
                _Engine.is_done = True
        except (ExportError, MemoryError) as error:
            _Engine.error = error


def evaluate(selection: Selection, limits: Limits, notes: Notes) -> Evaluated:
    """Evaluate the selection at its first frame.

    Raises
    ------
    ExportError
        There are more instances or triangles than the limits allow.
    """
    selection.scene.frame_set(selection.frames[0])
    result = Evaluated()
    _Engine.visit = lambda graph: _read(graph, result, limits, notes)
    _Engine.error, _Engine.is_done = None, False
    bpy.utils.register_class(_Engine)
    try:
        _render(selection)
    finally:
        bpy.utils.unregister_class(_Engine)
    if _Engine.error is not None:
        raise _Engine.error
    if not _Engine.is_done:
        raise RuntimeError("the evaluated scene was not read; the error is printed above")
    return result


def _render(selection: Selection) -> None:
    """Render nothing, in 8x8 pixels, by a camera of our own where there is none."""
    scene, render = selection.scene, selection.scene.render
    before = {name: getattr(render, name) for name in SETTINGS}
    camera, own = scene.camera, None
    if camera is None:
        own = bpy.data.objects.new("enfilade camera", bpy.data.cameras.new("enfilade camera"))
        scene.collection.objects.link(own)
        scene.camera = own
    for name, value in SETTINGS.items():
        setattr(render, name, value)
    for layer in scene.view_layers:
        layer.use = layer == selection.view_layer
    bpy.ops.render.render(scene=scene.name)
    for name, value in before.items():
        setattr(render, name, value)
    scene.camera = camera
    if own is not None:
        bpy.data.objects.remove(own)


def _read(graph: Any, result: Evaluated, limits: Limits, notes: Notes) -> None:
    check_generated(graph, limits)
    by_key: dict[Any, Placed | None] = {}
    meshes: dict[int, Mesh] = {}
    names, triangles = _attributes_of_materials(), 0  # of different meshes
    for instance in graph.object_instances:
        obj = instance.object
        result.instances += 1
        if result.instances > limits.instances:
            raise _too_many(limits, instance.parent.name if instance.parent else obj.name)
        _note_hair(obj, notes)
        if not instance.show_self:
            continue
        matrix = np.array(instance.matrix_world, np.float64)
        if not np.isfinite(matrix).all():
            what = "an object whose place, rotation or scale is NaN or infinite is left out"
            notes.add(
                "not-carried", instance_name(instance), "Transform", what, "it is missing from the picture"
            )
        elif obj.type == "LIGHT":
            _note_linking(obj, notes)
            note_rays(obj.name, obj, RAYS_OF_LAMPS, "it lights all surfaces", notes)
            lamp = Lamp(instance_name(instance), obj.data.original, matrix, is_visible=obj.visible_camera)
            result.lamps.append(lamp)
        elif obj.type in NOT_CARRIED:
            what = f"{NOT_CARRIED[obj.type]} can't be exported"
            notes.add("not-carried", obj.name, "Object", what, "it is missing from the picture")
        elif isinstance(obj.data, bpy.types.Mesh):  # text, curves and metaballs have an instance of one
            key = (instance_name(instance), obj.name_full, obj.data.as_pointer())
            if key not in by_key:
                read = len(meshes)
                by_key[key] = _place(instance, meshes, notes, names)
                if len(meshes) > read:
                    triangles += len(meshes[obj.data.as_pointer()])
                    check_triangles(triangles, limits, obj.name)
            placed = by_key[key]
            if placed is not None:
                placed.matrices.append(matrix)
    result.placed = [placed for placed in by_key.values() if placed is not None]


def check_triangles(count: int, limits: Limits, name: str) -> None:
    """Refuse a scene of more triangles than the limits allow."""
    if count > limits.triangles:
        what = f"the scene has more than {limits.triangles} triangles"
        advice = "lower its levels of subdivision or its number of copies, or raise the limit"
        raise ExportError(what, name, advice)


def check_generated(graph: Any, limits: Limits) -> None:
    """Refuse too many instances of geometry nodes before Blender lists them, which takes 400 bytes each."""
    total = 0
    for obj in graph.objects:
        if not hasattr(obj, "evaluated_geometry") or all(m.type != "NODES" for m in obj.modifiers):
            continue
        geometry = obj.evaluated_geometry()  # owns the points
        points = geometry.instances_pointcloud()
        total += len(points.points) if points is not None else 0
        if total > limits.instances:
            raise _too_many(limits, obj.name)


def _too_many(limits: Limits, name: str) -> ExportError:
    what, advice = (
        f"the scene has more than {limits.instances} instances",
        "reduce its scattered objects, or raise the limit",
    )
    return ExportError(what, name, advice)


def _attributes_of_materials() -> AttributeNames:
    """Names of the attributes of meshes that nodes read."""
    trees = [*(material.node_tree for material in bpy.data.materials), *bpy.data.node_groups]
    nodes = [node for tree in trees if tree is not None for node in tree.nodes]
    colours = {n.attribute_name for n in nodes if n.type == "ATTRIBUTE" and n.attribute_type == "GEOMETRY"}
    colours |= {node.layer_name for node in nodes if node.type == "VERTEX_COLOR"}
    return AttributeNames(frozenset(colours), frozenset(n.uv_map for n in nodes if n.type in UV_NODES))


def _place(instance: Any, meshes: dict[int, Mesh], notes: Notes, names: AttributeNames) -> Placed | None:
    obj, pointer = instance.object, instance.object.data.as_pointer()
    _note_object(instance, notes)
    if pointer not in meshes:
        meshes[pointer] = read_mesh(obj.data, obj.name, notes, names)
    mesh = meshes[pointer]
    if len(mesh) == 0:
        return None
    slots = tuple(slot.material and slot.material.original for slot in obj.material_slots)
    return Placed(
        instance_name(instance),
        mesh,
        slots,
        colour=tuple(obj.color),
        index=obj.pass_index,
        is_seen=obj.visible_camera and (instance.parent or obj).visible_camera,
        has_shadow=obj.visible_shadow and (instance.parent or obj).visible_shadow,
    )


def instance_name(instance: Any) -> str:
    """Name of an object; of an instance of another, with that of its instancer."""
    obj, parent = instance.object, instance.parent
    is_part = instance.is_instance and parent is not None and parent.name != obj.name
    return f"{parent.name}: {obj.name}" if is_part else str(obj.name)


def _note_linking(obj: Any, notes: Notes) -> None:
    """Note light linking and shadow linking, of lamps and of emitters."""
    linking = obj.light_linking
    if linking.receiver_collection is not None:
        what, effect = "light linking is left out", "it lights all objects"
        notes.add("not-carried", obj.name, "Light linking", what, effect)
    if linking.blocker_collection is not None:
        what, effect = "shadow linking is left out", "all objects cast shadows in its light"
        notes.add("not-carried", obj.name, "Shadow linking", what, effect)


def note_rays(
    name: str, of: Any, rays: tuple[str, ...], effect: str, notes: Notes, prefix: str = "visible_"
) -> None:
    """Note the rays of which settings with a prefix say that they miss an object, lamp or world."""
    hidden = [ray for ray in rays if not getattr(of, f"{prefix}{ray}", True)]
    if hidden:
        what = f"hidden from {', '.join(hidden)} rays in Blender"
        notes.add("not-carried", name, "Ray visibility", what, effect)


def _note_object(instance: Any, notes: Notes) -> None:
    obj, placed = instance.object, instance.parent or instance.object  # an instancer's visibility counts
    _note_linking(obj, notes)
    note_rays(obj.name, obj, RAYS_OF_OBJECTS, "it is visible to all rays", notes)
    if placed != obj:
        note_rays(placed.name, placed, RAYS_OF_OBJECTS, "its instances are visible to all rays", notes)
    if any(getattr(of, "use_adaptive_subdivision", False) for of in (obj.cycles, *obj.modifiers)):
        what, effect = "its levels are those of the modifier", "it may be coarser, or of more triangles"
        notes.add("approximated", obj.name, "Adaptive Subdivision", what, effect)
    layer, original = bpy.context.view_layer, placed.original
    catches = getattr(obj, "is_shadow_catcher", False) or getattr(obj, "is_holdout", False)
    if catches or original.holdout_get(view_layer=layer) or original.indirect_only_get(view_layer=layer):
        what = "Shadow catcher, holdout or indirect only"
        notes.add("not-carried", placed.name, what, "an ordinary object", "it is visible")


def _note_hair(obj: Any, notes: Notes) -> None:
    for system in rendered_particles(obj):
        if system.settings.type == "HAIR" and system.settings.render_type == "PATH":
            what = "hair can't be exported"
            notes.add(
                "not-carried", obj.name, f"Particles {system.name}", what, "it is missing from the picture"
            )
