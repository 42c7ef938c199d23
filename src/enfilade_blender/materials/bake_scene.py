# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene with one mesh, on which Cycles bakes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Literal

import bpy
import numpy as np

from enfilade_blender.image_files import F32
from enfilade_blender.materials.image_pixels import linear_pixels
from enfilade_blender.materials.stand_ins import put_stand_ins
from enfilade_blender.materials.values import IDENTITY, Matrix3, Output
from enfilade_blender.ply import Mesh
from enfilade_blender.records import Placed

BakeKind = Literal["colour", "number", "normal"]
MARGIN_PX = 8
ISLAND_MARGIN = 0.01  # of the square
SMART_ANGLE = 1.15  # radians, Blender's default of 66 degrees
OBJECT_COLOUR = (1.0, 1.0, 1.0, 1.0)
LIT_PX = 8  # of a square in even light
TARGET, GENERATED = "enfilade target", "enfilade generated"
RENAMED = "enfilade own "  # before names of attributes that Blender keeps for its own, such as material_index
TEXTURES = {  # whose coordinates are generated ones where none are linked
    "TEX_GRADIENT", "TEX_NOISE", "TEX_GABOR", "TEX_VORONOI", "TEX_MUSGRAVE", "TEX_WAVE", "TEX_MAGIC",
    "TEX_CHECKER", "TEX_BRICK",
}  # fmt: skip


class BakeScene:
    """The scene; made once for a job.

    Parameters
    ----------
    samples : int
        Of Cycles, for a texel.
    frame : int
        At which animated materials are baked.
    """

    def __init__(self, samples: int, frame: int) -> None:
        scene = bpy.data.scenes.new("enfilade bake")
        scene.frame_set(frame)
        scene.render.engine = "CYCLES"
        scene.cycles.samples, scene.cycles.use_denoising = samples, False
        scene.cycles.use_adaptive_sampling, scene.cycles.light_sampling_threshold = False, 0.0
        scene.render.bake.margin = MARGIN_PX
        scene.render.bake.use_selected_to_active = False
        scene.render.bake.normal_space = "TANGENT"
        self._scene = scene

    @contextmanager
    def mesh(self, mesh: Mesh, placed: Placed) -> Iterator[Canvas]:
        """A copy of a mesh, where its first copy is; the whole object spans its generated coordinates."""
        data = _data(mesh)
        low, high = placed.mesh.positions.min(axis=0), placed.mesh.positions.max(axis=0)
        data.use_auto_texspace = False
        data.texspace_location = 0.5 * (low + high)
        data.texspace_size = np.maximum(0.5 * (high - low), 1e-6)
        if mesh.generated is not None:
            data.attributes.new(GENERATED, "FLOAT_VECTOR", "CORNER").data.foreach_set(
                "vector", np.ascontiguousarray(mesh.generated, np.float32).ravel()
            )
        with self._canvas(data, placed.matrices[0], placed.colour, placed.index) as canvas:
            yield canvas

    @contextmanager
    def square(self, uv_map: str, matrix: Matrix3 = IDENTITY) -> Iterator[Canvas]:
        """The unit square of coordinates that a map makes of a UV map, by its name."""
        corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
        triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
        normals = np.broadcast_to(np.array([0.0, 0.0, 1.0], np.float32), (2, 3, 3))
        uv, inverse = corners[triangles][..., :2], np.linalg.inv(matrix)
        name, slots = uv_map or "UVMap", np.zeros(2, np.int32)
        uvs = {name: uv @ inverse[:2, :2].T + inverse[:2, 2], TARGET: uv}
        data = _data(Mesh(corners, triangles, normals, uvs, {}, slots, name))
        data.uv_layers.active = data.uv_layers[-1]
        with self._canvas(data, np.eye(4)) as canvas:
            yield canvas

    def light_colour(self, light: Any, output: Output) -> tuple[float, float, float]:
        """Value of an output of a light's nodes that is even: a sun of that colour lights a white square."""
        groups = set(bpy.data.node_groups)
        sun = light.copy()
        sun.animation_data_clear()
        name, sun.type = sun.name, "SUN"
        sun = bpy.data.lights[name]  # of another type now
        sun.energy, sun.color, sun.angle = math.pi, (1.0, 1.0, 1.0), 0.0
        if hasattr(sun, "use_temperature"):  # from Blender 4.5 on
            sun.use_temperature, sun.exposure = False, 0.0
        emission = sun.node_tree.nodes.new("ShaderNodeEmission")
        sun.node_tree.links.new(_exposed(sun.node_tree, output.groups, output), emission.inputs["Color"])
        for end in [node for node in sun.node_tree.nodes if node.type == "OUTPUT_LIGHT"]:
            sun.node_tree.links.new(emission.outputs[0], end.inputs["Surface"])
        above = bpy.data.objects.new(name, sun)
        self._scene.collection.objects.link(above)
        with self.square("") as canvas:
            colour = canvas.bake_light()
        bpy.data.objects.remove(above)
        bpy.data.lights.remove(sun)
        bpy.data.batch_remove(set(bpy.data.node_groups) - groups)
        return colour

    @contextmanager
    def _canvas(
        self, data: Any, matrix: np.ndarray, colour: tuple[float, ...] = OBJECT_COLOUR, index: int = 0
    ) -> Iterator[Canvas]:
        obj = bpy.data.objects.new("enfilade bake", data)
        obj.matrix_world = matrix.T.tolist()
        obj.color, obj.pass_index = colour, index
        self._scene.collection.objects.link(obj)
        before = bpy.context.window.scene
        bpy.context.window.scene = self._scene
        layer = self._scene.view_layers[0]
        layer.objects.active = obj
        obj.select_set(True)
        try:
            yield Canvas(obj)
        finally:
            bpy.context.window.scene = before
            bpy.data.objects.remove(obj)
            bpy.data.meshes.remove(data)


class Canvas:
    """An object to bake on."""

    def __init__(self, obj: Any) -> None:
        self._object = obj

    def unwrap(self) -> F32:
        """New texture coordinates without overlap, (N, 3, 2)."""
        data = self._object.data
        layer = data.uv_layers.new(name="enfilade")
        data.uv_layers.active, name = layer, layer.name
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.uv.smart_project(angle_limit=SMART_ANGLE, island_margin=ISLAND_MARGIN, scale_to_bounds=False)
        bpy.ops.object.mode_set(mode="OBJECT")
        uv: F32 = np.empty(len(data.loops) * 2, np.float32)
        data.uv_layers[name].uv.foreach_get("vector", uv)
        return uv.reshape(-1, 3, 2)

    def bake(
        self, output: Output, material: Any, size: int, kind: BakeKind = "colour"
    ) -> tuple[F32, np.ndarray]:
        """Values of an output (size, size, 3), the first row on top, and the texels that the mesh covers."""
        image = bpy.data.images.new(TARGET, size, size, alpha=True, float_buffer=True)
        image.colorspace_settings.name = "Non-Color"
        image.pixels.foreach_set(np.zeros(size * size * 4, np.float32))  # Blender clears to an alpha of 1
        groups = set(bpy.data.node_groups)
        copy = material.copy()
        put_stand_ins(copy.node_tree)
        _take_attributes(copy.node_tree, self._object.data.attributes)
        _wire(copy.node_tree, output, image, kind)
        self._object.data.materials.clear()
        self._object.data.materials.append(copy)
        bpy.ops.object.bake(type="NORMAL" if kind == "normal" else "EMIT", use_clear=False)
        rgba = linear_pixels(image)
        bpy.data.materials.remove(copy)
        bpy.data.batch_remove(set(bpy.data.node_groups) - groups)
        bpy.data.images.remove(image)
        return rgba[..., :3], rgba[..., 3] > 0.5

    def bake_light(self) -> tuple[float, float, float]:
        """Radiance of the object, were it white and diffuse, in the light of the scene's lamps alone."""
        image = bpy.data.images.new(TARGET, LIT_PX, LIT_PX, alpha=True, float_buffer=True)
        image.colorspace_settings.name = "Non-Color"
        material = bpy.data.materials.new(TARGET)
        material.use_nodes = True
        _aim(material.node_tree, image)
        self._object.data.materials.clear()
        self._object.data.materials.append(material)
        bpy.ops.object.bake(type="DIFFUSE", pass_filter={"DIRECT"}, use_clear=False)
        r, g, b = linear_pixels(image)[..., :3].mean(axis=(0, 1))
        bpy.data.materials.remove(material)
        bpy.data.images.remove(image)
        return float(r), float(g), float(b)


def _data(mesh: Mesh) -> Any:
    """A mesh of Blender, with normals, texture coordinates and colours."""
    data = bpy.data.meshes.new("enfilade bake")
    count = len(mesh)
    data.vertices.add(len(mesh.positions))
    data.vertices.foreach_set("co", mesh.positions.ravel())
    data.loops.add(3 * count)
    data.loops.foreach_set("vertex_index", mesh.triangles.ravel())
    data.polygons.add(count)
    data.polygons.foreach_set("loop_start", np.arange(0, 3 * count, 3, dtype=np.int32))
    for name, uv in mesh.uvs.items():
        layer = data.uv_layers.new(name=name)
        layer.uv.foreach_set("vector", np.ascontiguousarray(uv, np.float32).ravel())
        layer.active_render = name == mesh.active_uv
    for name, rgba in mesh.colours.items():
        new = data.color_attributes.new
        attribute = new(name, "FLOAT_COLOR", "CORNER") or new(RENAMED + name, "FLOAT_COLOR", "CORNER")
        attribute.data.foreach_set("color", np.ascontiguousarray(rgba, np.float32).ravel())
    if mesh.active_colour:
        data.color_attributes.render_color_index = list(mesh.colours).index(mesh.active_colour)
    data.update(calc_edges=True)
    data.normals_split_custom_set(mesh.normals.reshape(-1, 3))
    return data


def _take_attributes(tree: Any, attributes: Any) -> None:
    """Read generated coordinates, and what is renamed, from attributes, in groups, too, which are copies."""
    ends = [link.to_socket for link in tree.links if _is_generated(link)]
    for node in tree.nodes:
        if node.type == "GROUP" and node.node_tree is not None:
            _take_attributes(node.node_tree, attributes)
        elif node.type in TEXTURES and not node.inputs["Vector"].is_linked:
            ends.append(node.inputs["Vector"])
        elif node.type == "ATTRIBUTE" and RENAMED + node.attribute_name in attributes:
            node.attribute_name = RENAMED + node.attribute_name
    if GENERATED not in attributes:
        return
    attribute = tree.nodes.new("ShaderNodeAttribute")
    attribute.attribute_name = GENERATED
    for end in ends:
        tree.links.new(attribute.outputs["Vector"], end)


def _is_generated(link: Any) -> bool:
    return link.from_node.type == "TEX_COORD" and link.from_socket.name == "Generated"


def _wire(tree: Any, output: Output, image: Any, kind: BakeKind) -> None:
    """Connect an output to the surface, which is baked into an image."""
    source = _exposed(tree, output.groups, output)
    if kind == "number":  # whose conversion is not that of a colour
        number = tree.nodes.new("ShaderNodeMath")
        number.inputs[1].default_value = 0.0
        tree.links.new(source, number.inputs[0])
        source = number.outputs[0]
    if kind == "normal":
        shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
        tree.links.new(source, shader.inputs["Normal"])
    else:
        shader = tree.nodes.new("ShaderNodeEmission")
        tree.links.new(source, shader.inputs["Color"])
    for node in [node for node in tree.nodes if node.type == "OUTPUT_MATERIAL"]:
        tree.nodes.remove(node)
    end = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], end.inputs["Surface"])
    _aim(tree, image)


def _aim(tree: Any, image: Any) -> None:
    """Make an image the target of the bake."""
    target = tree.nodes.new("ShaderNodeTexImage")
    target.image = image
    for node in tree.nodes:
        node.select = node == target
    tree.nodes.active = target


def _exposed(tree: Any, groups: tuple[Any, ...], output: Output) -> Any:
    """The output's twin in a copied tree, led out of groups through new sockets of their copies."""
    if not groups:
        node = tree.nodes[output.node.name]
        return next(socket for socket in node.outputs if socket.identifier == output.socket.identifier)
    group = tree.nodes[groups[0].name]
    group.node_tree = group.node_tree.copy()
    inner = _exposed(group.node_tree, groups[1:], output)
    kind = "NodeSocketVector" if output.socket.type == "VECTOR" else "NodeSocketColor"
    item = group.node_tree.interface.new_socket("enfilade", in_out="OUTPUT", socket_type=kind)
    ends = [node for node in group.node_tree.nodes if node.type == "GROUP_OUTPUT"]
    end = next((node for node in ends if node.is_active_output), ends[0])
    group.node_tree.links.new(inner, next(s for s in end.inputs if s.identifier == item.identifier))
    return next(s for s in group.outputs if s.identifier == item.identifier)
