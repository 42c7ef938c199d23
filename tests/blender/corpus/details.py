# SPDX-License-Identifier: GPL-3.0-or-later
"""A file of many details that an exporter can miss, each of which a test looks for."""

import bpy
import numpy as np

from corpus.stage import (
    cube,
    fill,
    image,
    light,
    node_of,
    plane,
    principled,
    shader,
    sphere,
    stage,
    tiles,
    world,
)  # fmt: skip


def details(folder):
    scene, _ = stage(lit=False)
    _settings(scene)
    _hidden_world()
    light("AREA", "Portal", (0.0, -2.0, 3.0), 50.0, size=1.0).data.cycles.is_portal = True
    key = light("POINT", "Key", (-2.0, -3.0, 4.0), 100.0, shadow_soft_size=0.0)
    key.light_linking.receiver_collection = bpy.data.collections.new("only these")
    _keyed(key.data, "energy", 100.0, 50.0)
    sphere("Dome", (0.0, 0.0, 0.0), 20.0, shader("dome", "Emission", Strength=0.3)[0])
    sphere("Bulb", (1.5, -1.0, 1.5), 0.1, shader("bulb", "Emission", Strength=9.0)[0])
    cube("material floor", (2.5, 0.0, 0.25), 0.5, principled("plain"))
    cube("cost $5", (-2.5, 0.0, 0.25), 0.5, principled("$5"))
    _procedural_slots()
    _corrected_images()
    _tilted_normals()
    _object_colour()
    _animated_gradient()


def _keyed(data, name, at_first, at_last):
    """Keys of a value at the first and last frame; at frame 1 it is another one, by half."""
    for frame, value in ((1, 0.5 * at_first), (11, at_first), (15, at_last)):
        setattr(data, name, value)
        data.keyframe_insert(name, frame=frame)


def _settings(scene):
    scene.frame_start, scene.frame_end, scene.frame_step = 11, 15, 2
    scene.view_settings.gamma = 1.2
    render = scene.render
    render.resolution_percentage, render.use_border = 25, True
    render.border_max_x = render.border_max_y = 0.2


def _hidden_world():
    """A world of 0.2 at the first frame, which the camera would see as green, and from which it is hidden."""
    value = world((0.0, 1.0, 0.0))
    value.cycles_visibility.camera = False
    _keyed(value.node_tree.nodes["Background"].inputs[1], "default_value", 1.0, 2.0)
    group = bpy.data.node_groups.new("by ray", "ShaderNodeTree")
    group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    ray, end = node_of(group, "LightPath"), group.nodes.new("NodeGroupOutput")
    dusk = bpy.data.images.new("dusk", 1100, 1, float_buffer=True)
    dusk.pixels = 1100 * [0.2, 0.2, 0.2, 1.0]
    dusk.pack()
    mix = node_of(group, "MixRGB", Color1=dusk, Color2=(0.0, 1.0, 0.0, 1.0))
    fill(group, mix, {"Fac": ray.outputs["Is Camera Ray"]})
    fill(group, end, {0: mix})
    node = node_of(value.node_tree, "Group")
    node.node_tree = group
    fill(value.node_tree, value.node_tree.nodes["Background"], {0: node})


def _procedural_slots():
    """One procedural material in two slots, of a mesh with all the UV maps that Blender has."""
    noise, tree, bsdf = shader("noise", "BsdfPrincipled", Roughness=0.9)
    fill(tree, bsdf, {"Base Color": node_of(tree, "TexNoise", Scale=6.0).outputs["Color"]})
    node_of(tree, "Group")  # without a tree
    box = cube("Slots", (0.0, 0.0, 0.5), 0.8, noise)
    box.data.materials.append(noise)
    for polygon in box.data.polygons:
        polygon.material_index = polygon.index % 2
    while box.data.uv_layers.new() is not None:
        pass


def _corrected_images():
    """One inverted image, on UV maps of different names."""
    corrected, tree, bsdf = shader("corrected", "BsdfPrincipled", Roughness=0.9)
    fill(tree, bsdf, {"Base Color": node_of(tree, "Invert", Color=image("tiles", tiles, 64))})
    for x, name in ((-1.0, "UVMap"), (1.0, "another")):
        box = cube(f"corrected {name}", (x, -1.0, 0.2), 0.4, corrected)
        box.data.uv_layers[0].name = name


def _tilted_normals():
    """A normal map tilted along u, on UVs that are turned by 90 degrees, beside a procedural roughness."""
    flat = image("tilt", lambda x, _: np.full((*x.shape, 3), (0.8, 0.5, 0.9)), 16, space="Non-Color")
    tilted, tree, bsdf = shader("tilted", "BsdfPrincipled")
    normal, noise = node_of(tree, "NormalMap", Color=flat), node_of(tree, "TexNoise", Scale=6.0)
    fill(tree, bsdf, {"Normal": normal, "Roughness": noise})
    board = plane("Tilted", (0.0, -1.5, 0.05), 0.5, tilted)
    for loop in board.data.uv_layers[0].uv:
        u, v = loop.vector
        loop.vector = 1.0 - v, u


def _object_colour():
    coloured, tree, node = shader("coloured", "BsdfDiffuse")
    info = node_of(tree, "ObjectInfo")
    fill(tree, node, {"Color": info.outputs["Color"], "Roughness": info.outputs["Random"]})
    cube("Coloured", (2.0, -1.5, 0.2), 0.3, coloured).color = (0.6, 0.1, 0.2, 1.0)


def _animated_gradient():
    """Generated coordinates, scaled by an animated number: no function of the UV map."""
    rising, tree, node = shader("rising", "BsdfDiffuse")
    split = node_of(tree, "SeparateXYZ", Vector=node_of(tree, "TexCoord").outputs["Generated"])
    scaled = node_of(tree, "Math")
    scaled.operation = "MULTIPLY"
    _keyed(scaled.inputs[1], "default_value", 1.0, 0.0)
    fill(tree, scaled, {0: split.outputs["Z"]})
    fill(tree, node, {"Color": scaled})
    cube("Rising", (-2.0, -1.5, 0.2), 0.3, rising)
