# SPDX-License-Identifier: GPL-3.0-or-later
"""A file with the settings of production files: an output with a view of its own, glass without shadows."""

import math

import bpy

from corpus.stage import fill, image, light, new_file, picture, plane, principled, shader, tiles, world


def production(folder):
    scene = new_file()
    scene.frame_start, scene.frame_end = 1, 6
    world((0.2, 0.2, 0.2))
    _output(scene)
    _camera_that_jumps(scene.camera)
    _lights(scene)
    _without_shadows()
    _hidden()
    _tiled(folder)
    plane("Satin", (0.0, 2.0, 0.0), 1.0, principled("satin", (0.2, 0.2, 0.2, 1), Roughness=0.7))
    plane(
        "Lacquer",
        (2.0, 2.0, 0.0),
        1.0,
        principled("lacquer", Coat_Weight=1.0, Coat_IOR=image("iors", tiles, 16)),
    )


def _output(scene):
    """A view of the output, and text that is burnt into it."""
    output = scene.render.image_settings
    output.color_management = "OVERRIDE"
    output.view_settings.view_transform, output.view_settings.exposure = "Filmic", 1.5
    scene.render.use_stamp = True


def _camera_that_jumps(camera):
    """Looks along +y, and jumps to the side in frame 4."""
    camera.rotation_euler = (math.pi / 2, 0.0, 0.0)
    for frame, x in ((1, 0.0), (4, 40.0)):
        camera.location = (x, -5.0, 1.0)
        camera.keyframe_insert("location", frame=frame)
    curves = getattr(camera.animation_data.action, "fcurves", None)
    if curves is None:  # from Blender 5 on
        curves = camera.animation_data.action.layers[0].strips[0].channelbags[0].fcurves
    for curve in curves:
        for key in curve.keyframe_points:
            key.interpolation = "CONSTANT"


def _lights(scene):
    """A sun before the camera, behind glass; lamps that change."""
    sun = light("SUN", "Sun", (0.0, 0.0, 5.0), 3.0, angle=0.05, use_shadow=False)
    sun.rotation_euler = (math.radians(-84.0), 0.0, 0.0)
    for x, name, attribute, value in (
        (-3.0, "Shadowless", "use_shadow", False),
        (3.0, "Dimmed", "exposure", -2.0),
    ):
        lamp = light("POINT", name, (x, 0.0, 3.0), 50.0).data
        if hasattr(lamp, attribute):  # exposure is from Blender 4.5 on
            lamp.keyframe_insert(attribute, frame=1)
            setattr(lamp, attribute, value)
            lamp.keyframe_insert(attribute, frame=6)
    scene.frame_set(1)
    _profile()


def _profile():
    """A lamp with an IES profile, the same in all directions, which doubles its light."""
    lamp = light("POINT", "Downlight", (0.0, 8.0, 3.0), 10.0, shadow_soft_size=0.0).data
    lamp.use_nodes = True
    text = bpy.data.texts.new("profile")
    candela = 2.0 * 177.83 / (4.0 * math.pi)
    text.write(f"IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 2 1 1 2 0 0 0\n1 1 50\n0 180\n0\n{candela} {candela}\n")
    profile = lamp.node_tree.nodes.new("ShaderNodeTexIES")
    profile.ies = text
    lamp.node_tree.links.new(profile.outputs[0], lamp.node_tree.nodes["Emission"].inputs["Strength"])


def _without_shadows():
    glass = principled("glass", (1.0, 1.0, 1.0, 1), Transmission_Weight=1.0, Roughness=0.0)
    for name, y, material in (("Window", 0.0, glass), ("Board", 1.0, principled("board"))):
        pane = plane(name, (0.0, y, 1.0), 4.0, material)
        pane.rotation_euler = (math.pi / 2, 0.0, 0.0)
        pane.visible_shadow = False
    pane.location.x = 10.0  # the board, out of the sun's way


def _hidden():
    """A wall that the camera does not see, and one of the same material."""
    plaster = principled("plaster", (0.9, 0.8, 0.7, 1))
    for name, y in (("Front wall", 20.0), ("Back wall", 24.0)):
        plane(name, (0.0, y, 0.0), 4.0, plaster).visible_camera = name == "Back wall"


def _tiled(folder):
    """An image of two tiles."""
    material, tree, bsdf = shader("tiled", "BsdfDiffuse")
    for number in (1001, 1002):
        one = image(f"tile {number}", tiles, 16)
        one.filepath_raw, one.file_format = str(folder / f"tile.{number}.png"), "PNG"
        one.save()
    whole = bpy.data.images.load(str(folder / "tile.1001.png"))
    whole.source = "TILED"
    whole.tiles.new(1002)
    whole.filepath = str(folder / "tile.<UDIM>.png")
    fill(tree, bsdf, {"Color": picture(tree, whole)})
    plane("Tiled", (-2.0, 2.0, 0.0), 1.0, material)
