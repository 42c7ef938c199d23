# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of one kind of light each."""

import math

import numpy as np

from corpus.stage import image, light, principled, stage, three, world


def _objects():
    stage(lit=False)
    three([principled(f"grey {i}", **{"Base Color": (0.6, 0.6, 0.6, 1), "Roughness": 0.5}) for i in range(3)])


def point(folder):
    _objects()
    light("POINT", "Small", (-1.5, -2.5, 3.0), 120.0, shadow_soft_size=0.0)
    light("POINT", "Large", (2.0, -2.0, 3.5), 120.0, shadow_soft_size=0.3, color=(1.0, 0.8, 0.5))


def spot(folder):
    _objects()
    light(
        "SPOT",
        "Soft",
        (-1.5, -3.0, 4.0),
        500.0,
        target=(-0.8, 0, 0.3),
        spot_size=0.7,
        spot_blend=0.6,
        shadow_soft_size=0.0,
    )
    light(
        "SPOT",
        "Hard",
        (2.0, -3.0, 4.0),
        500.0,
        target=(1.0, 0, 0.3),
        spot_size=0.5,
        spot_blend=0.1,
        shadow_soft_size=0.0,
        color=(0.5, 0.7, 1.0),
    )


def area(folder):
    _objects()
    light("AREA", "Square", (-2.5, -2.5, 3.5), 60.0, shape="SQUARE", size=0.8)
    light(
        "AREA",
        "Rectangle",
        (-0.8, -3.5, 3.5),
        60.0,
        shape="RECTANGLE",
        size=1.5,
        size_y=0.3,
        color=(1.0, 0.5, 0.4),
    )
    light("AREA", "Disk", (0.8, -3.5, 3.5), 60.0, shape="DISK", size=0.8, color=(0.5, 1.0, 0.5))
    scaled = light(
        "AREA",
        "Ellipse",
        (2.5, -2.5, 3.5),
        60.0,
        shape="ELLIPSE",
        size=0.5,
        size_y=1.2,
        color=(0.5, 0.5, 1.0),
    )
    scaled.scale = (1.5, 1.5, 1.5)


def sun(folder):
    _objects()
    light("SUN", "Sun", (-3.0, -4.0, 6.0), 3.0, angle=math.radians(2.0))
    world((0.2, 0.3, 0.5))


def sun_sharp(folder):
    _objects()
    light("SUN", "Sun", (-3.0, -4.0, 6.0), 3.0, angle=0.0)
    world((0.2, 0.3, 0.5))


def sky(folder):
    _objects()
    value = world((1, 1, 1), 0.02)
    texture = value.node_tree.nodes.new("ShaderNodeTexSky")
    texture.sky_type, texture.sun_elevation, texture.sun_rotation = "NISHITA", 0.6, 2.4
    value.node_tree.links.new(texture.outputs[0], value.node_tree.nodes["Background"].inputs[0])


def hdri(folder):
    _objects()
    value = world((1, 1, 1), 0.8)
    tree = value.node_tree

    def panorama(x, y):
        sky_colour = np.stack([0.3 + 0.3 * y, 0.4 + 0.3 * y, 0.6 + 0.4 * y], -1) * (y > 0.5)[..., None] + 0.1
        lamp = (np.hypot((x - 0.3) * 2.0, y - 0.75) < 0.06)[..., None] * np.array((1.0, 0.9, 0.7))
        return np.clip(sky_colour + lamp, 0.0, 1.0)

    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image("panorama", panorama, 256)
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value = (0.0, 0.0, 1.0)
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
    tree.links.new(texture.outputs[0], tree.nodes["Background"].inputs[0])


def lamps_in_view(folder):
    _objects()
    light("POINT", "Seen", (0.5, 0.0, 1.5), 30.0, shadow_soft_size=0.1)
    light("POINT", "Inside the left sphere", (-1.35, 0.0, 0.61), 30.0, shadow_soft_size=0.1)
    light("POINT", "Behind the camera", (0.0, -6.0, 3.0), 30.0, shadow_soft_size=0.1)


CASES = (point, spot, area, sun, sun_sharp, sky, hdri, lamps_in_view)
