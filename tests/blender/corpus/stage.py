# SPDX-License-Identifier: GPL-3.0-or-later
"""The stage of the files: a floor with tiles, a wall, a camera, an area light and a world of one colour."""

import math
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

SIZE = 128, 96


def new_file():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.frame_start = scene.frame_end = 1
    scene.view_settings.view_transform = "Standard"
    camera((0.0, -5.2, 2.0), (0.0, 0.0, 0.7))
    return scene


def stage(*, lit=True):
    scene = new_file()
    matt = {"Roughness": 1.0, "Specular_IOR_Level": 0.0}
    floor = plane("Floor", (0.0, 0.0, 0.0), 8.0, principled("floor", (0.45, 0.42, 0.4, 1), **matt))
    wall = plane("Wall", (0.0, 3.0, 2.0), 8.0, principled("wall", (0.3, 0.45, 0.6, 1), **matt))
    wall.rotation_euler = (math.pi / 2, 0.0, 0.0)
    if lit:
        light("AREA", "Key", (-2.0, -3.0, 4.0), 150.0, target=(0, 0, 0.5), size=1.5)
        world((0.3, 0.35, 0.4))
    return scene, floor


def camera(eye, target, lens=35.0):
    data = bpy.data.cameras.new("Camera")
    data.lens = lens
    obj = add("Camera", data, eye)
    aim(obj, target)
    bpy.context.scene.camera = obj
    return obj


def aim(obj, target):
    obj.rotation_euler = (Vector(target) - obj.location).to_track_quat("-Z", "Y").to_euler()


def add(name, data, location=(0.0, 0.0, 0.0)):
    obj = bpy.data.objects.new(name, data)
    obj.location = location
    bpy.context.scene.collection.objects.link(obj)
    return obj


def group(name, objects):
    """A collection of objects, which leave the scene."""
    value = bpy.data.collections.new(name)
    for obj in objects:
        bpy.context.scene.collection.objects.unlink(obj)
        value.objects.link(obj)
    return value


def instance(name, collection, location, turn):
    """An instance of a collection, turned about z."""
    empty = add(name, None, location)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    empty.rotation_euler = (0.0, 0.0, turn)
    return empty


def scattering(name, density):
    """A tree of geometry nodes that distributes points on a surface; its input, points and output."""
    tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
    for side in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=side, socket_type="NodeSocketGeometry")
    start, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    points = tree.nodes.new("GeometryNodeDistributePointsOnFaces")
    points.inputs["Density"].default_value = density
    tree.links.new(start.outputs[0], points.inputs["Mesh"])
    return tree, start, points, end


def light(kind, name, location, energy, target=(0.0, 0.0, 0.0), **settings):
    data = bpy.data.lights.new(name, kind)
    data.energy = energy
    for key, value in settings.items():
        setattr(data, key, value)
    obj = add(name, data, location)
    aim(obj, target)
    return obj


def world(colour, strength=1.0):
    value = bpy.data.worlds.new("World")
    value.use_nodes = True
    background = value.node_tree.nodes["Background"]
    background.inputs[0].default_value = (*colour, 1.0)
    background.inputs[1].default_value = strength
    bpy.context.scene.world = value
    return value


def plane(name, location, size, material):
    bpy.ops.mesh.primitive_plane_add(size=size, location=location)
    return finish(name, material)


def cube(name, location, size, material):
    bpy.ops.mesh.primitive_cube_add(size=size, location=location)
    return finish(name, material)


def box(name, location, size, material):
    """A cuboid of a size along each axis, whose object has no scale."""
    obj = cube(name, location, 1.0, material)
    obj.scale = size
    bpy.ops.object.transform_apply(location=False, rotation=False, scale=True)
    return obj


def sphere(name, location, radius, material, segments=64):
    bpy.ops.mesh.primitive_uv_sphere_add(
        radius=radius, location=location, segments=segments, ring_count=segments // 2
    )
    obj = finish(name, material)
    bpy.ops.object.shade_smooth()
    return obj


def finish(name, material):
    obj = bpy.context.object
    obj.name = name
    obj.data.materials.append(material)
    return obj


def three(first, second, third):
    """Three objects of three materials in a row: a sphere, a cube, and a sphere."""
    sphere("Left", (-1.35, 0.0, 0.61), 0.6, first)
    cube("Middle", (0.0, 0.2, 0.46), 0.9, second).rotation_euler = (0.0, 0.0, 0.5)
    sphere("Right", (1.35, 0.0, 0.61), 0.6, third)


def principled(name, colour=(0.8, 0.8, 0.8, 1), **inputs):
    """A material of one Principled BSDF, see :func:`node_of`."""
    return shader(name, "BsdfPrincipled", Base_Color=colour, **inputs)[0]


def shader(name, kind, **inputs):
    """A material of one shader node, see :func:`node_of`; its tree and that node."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.remove(tree.nodes["Principled BSDF"])
    node = node_of(tree, kind, **inputs)
    fill(tree, tree.nodes["Material Output"], {"Surface": node})
    return material, tree, node


def node_of(tree, kind, **inputs):
    """A node of a kind of shader nodes; `_` in the name of an input is a space, see :func:`fill`."""
    node = tree.nodes.new(f"ShaderNode{kind}")
    fill(tree, node, {key.replace("_", " "): value for key, value in inputs.items()})
    return node


def fill(tree, node, inputs):
    """Set inputs of a node, by name or number: to a value, an image, a node's first output, or an output."""
    for key, value in inputs.items():
        source = picture(tree, value) if isinstance(value, bpy.types.Image) else value
        source = source.outputs[0] if isinstance(source, bpy.types.Node) else source
        if isinstance(source, bpy.types.NodeSocket):
            tree.links.new(source, node.inputs[key])
        else:
            node.inputs[key].default_value = value


def picture(tree, of):
    """An Image Texture."""
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = of
    return texture


def image(name, function, size=256, *, space="sRGB", alpha=None, is_float=False):
    """An image of ``function(x, y)`` -> (H, W, 3), x and y in 0..1 with y up, packed into the file."""
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size
    rgba = np.ones((size, size, 4), np.float32)
    rgba[..., :3] = function(x, y)
    if alpha is not None:
        rgba[..., 3] = alpha(x, y)
    value = bpy.data.images.new(name, size, size, alpha=alpha is not None, float_buffer=is_float)
    value.colorspace_settings.name = space
    value.pixels.foreach_set(rgba.ravel())
    value.update()
    value.pack()
    return value


def tiles(x, y, n=8, dark=(0.1, 0.1, 0.3), bright=(0.9, 0.8, 0.6)):
    """Tiles; the lower left one is red, so that a turned image is seen."""
    odd = ((np.floor(x * n) + np.floor(y * n)) % 2)[..., None]
    colour = odd * np.array(bright) + (1.0 - odd) * np.array(dark)
    corner = ((x < 2.0 / n) & (y < 1.0 / n))[..., None]
    return np.where(corner, np.array((0.9, 0.1, 0.1)), colour)


def save(folder, name):
    file = Path(folder) / f"{name}.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file), compress=True, relative_remap=False)
    return file
