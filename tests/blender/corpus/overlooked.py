# SPDX-License-Identifier: GPL-3.0-or-later
"""A file of settings, nodes and objects that an exporter can overlook."""

import numpy as np

from corpus.stage import (
    cube,
    fill,
    image,
    light,
    new_file,
    node_of,
    plane,
    principled,
    scattering,
    shader,
    world,
)


def overlooked(_folder):
    scene = new_file()
    _filtered(scene)
    scene.cycles.diffuse_bounces = 1  # of glossy ones there are 4
    scene.render.use_simplify = scene.cycles.use_camera_cull = True
    floor = plane("Floor", (0.0, 0.0, 0.0), 4.0, principled("floor"))
    adaptive = floor.modifiers.new("Subdivision", "SUBSURF")  # has the setting from Blender 5 on
    (
        floor.cycles if hasattr(floor.cycles, "use_adaptive_subdivision") else adaptive
    ).use_adaptive_subdivision = True
    _switched_off(scene)
    _falloffs()
    _of_old_files()
    light("SPOT", "Downlight", (0.0, 0.0, 3.0), 50.0, shadow_soft_size=0.1, use_soft_falloff=False)
    glass = principled("cover", Transmission_Weight=1.0, Roughness=0.0)
    cube("Cover", (0.0, 0.0, 2.9), 0.2, glass)


def _filtered(scene):
    """A view layer that leaves out the world and, says its switch, surfaces."""
    world((5.0, 5.0, 5.0))
    layer = scene.view_layers[0]
    layer.use_sky = layer.use_solid = False


def _switched_off(scene):
    """A screen before the camera, with 10,000 copies of a cube, that renders do not show."""
    eye = scene.camera.location
    screen = plane("Switched off", (eye.x, eye.y + 0.05, eye.z), 1.0, principled("off"))
    screen.rotation_euler.x = 1.57
    tree, _, points, end = scattering("Copies", density=1e4)
    box, copies = tree.nodes.new("GeometryNodeMeshCube"), tree.nodes.new("GeometryNodeInstanceOnPoints")
    tree.links.new(points.outputs["Points"], copies.inputs["Points"])
    tree.links.new(box.outputs["Mesh"], copies.inputs["Instance"])
    tree.links.new(copies.outputs[0], end.inputs[0])
    screen.modifiers.new("Copies", "NODES").node_group = tree
    screen.hide_render, scene.frame_end = True, 2


def _falloffs():
    """Emissive planes of even light: of a strength, and of one that is computed."""
    for x, name in ((-1.5, "even"), (1.5, "doubled")):
        material, tree, emission = shader(name, "Emission")
        strength = node_of(tree, "LightFalloff", Strength=3.0).outputs["Constant"]
        if name == "doubled":
            single, strength = strength, node_of(tree, "Math", Value=2.0)
            strength.operation = "MULTIPLY"
            fill(tree, strength, {1: single})
        fill(tree, emission, {"Strength": strength})
        plane(name, (x, 2.0, 1.0), 0.5, material)


def _of_old_files():
    """A script of OSL, and an image that its own mapping, which Blender shows no more, repeats once."""
    scripted, tree, bsdf = shader("scripted", "BsdfDiffuse")
    fill(tree, bsdf, {"Color": node_of(tree, "Script").outputs.new("NodeSocketColor", "Color")})
    plane("Scripted", (-1.0, 1.0, 0.1), 0.5, scripted)
    halves = image("halves", lambda x, _: np.repeat((x > 0.5)[..., None], 3, -1), 16)
    mapped, tree, bsdf = shader("mapped", "BsdfDiffuse", Color=halves)
    tree.nodes["Image Texture"].texture_mapping.scale.x = 2.0
    plane("Mapped", (1.0, 1.0, 0.1), 0.5, mapped)


def blurred(_folder):
    """A shining square before a grey world, out of focus, on a transparent film, of few samples."""
    scene = new_file()
    scene.render.resolution_percentage = 25
    world((0.25, 0.25, 0.25))
    screen = plane("Screen", (0.0, 0.0, 0.7), 2.0, shader("screen", "Emission", Strength=1.0)[0])
    screen.rotation_euler = scene.camera.rotation_euler
    dof = scene.camera.data.dof
    dof.use_dof, dof.focus_distance, dof.aperture_fstop = True, 0.5, 0.01
    scene.render.film_transparent = True
    scene.view_layers[0].samples = 1
    scene.cycles.time_limit = 1e-6
