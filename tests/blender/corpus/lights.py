# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of one kind of light each."""

import math

import numpy as np

from corpus.stage import fill, image, light, node_of, principled, stage, three, world


def _objects():
    stage(lit=False)
    three(*(principled(f"grey {i}", (0.6, 0.6, 0.6, 1), Roughness=0.5) for i in range(3)))


def point(folder):
    _objects()
    light("POINT", "Small", (-1.5, -2.5, 3.0), 120.0, shadow_soft_size=0.0)
    light("POINT", "Large", (2.0, -2.0, 3.5), 120.0, shadow_soft_size=0.3, color=(1.0, 0.8, 0.5))


def spot(folder):
    _objects()
    terms = {"shadow_soft_size": 0.0, "energy": 500.0}
    soft, hard = {"spot_size": 0.7, "spot_blend": 0.6}, {"spot_size": 0.5, "spot_blend": 0.1}
    light("SPOT", "Soft", (-1.5, -3.0, 4.0), target=(-0.8, 0, 0.3), **soft, **terms)
    light("SPOT", "Hard", (2.0, -3.0, 4.0), target=(1.0, 0, 0.3), color=(0.5, 0.7, 1.0), **hard, **terms)


def area(folder):
    _objects()
    long, tall = {"size": 1.5, "size_y": 0.3}, {"size": 0.5, "size_y": 1.2}
    red, green, blue = (1.0, 0.5, 0.4), (0.5, 1.0, 0.5), (0.5, 0.5, 1.0)
    light("AREA", "Square", (-2.5, -2.5, 3.5), 60.0, shape="SQUARE", size=0.8)
    light("AREA", "Rectangle", (-0.8, -3.5, 3.5), 60.0, shape="RECTANGLE", **long, color=red)
    light("AREA", "Disk", (0.8, -3.5, 3.5), 60.0, shape="DISK", size=0.8, color=green)
    scaled = light("AREA", "Ellipse", (2.5, -2.5, 3.5), 60.0, shape="ELLIPSE", **tall, color=blue)
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
    tree = world((1, 1, 1), 0.02).node_tree
    texture = node_of(tree, "TexSky")
    texture.sky_type, texture.sun_elevation, texture.sun_rotation = "NISHITA", 0.6, 2.4
    fill(tree, tree.nodes["Background"], {0: texture})


def hdri(folder):
    _objects()
    tree = world((1, 1, 1), 0.8).node_tree

    def panorama(x, y):
        sky_colour = np.stack([0.3 + 0.3 * y, 0.4 + 0.3 * y, 0.6 + 0.4 * y], -1) * (y > 0.5)[..., None] + 0.1
        lamp = (np.hypot((x - 0.3) * 2.0, y - 0.75) < 0.06)[..., None] * np.array((1.0, 0.9, 0.7))
        return np.clip(sky_colour + lamp, 0.0, 1.0)

    coordinates = node_of(tree, "TexCoord").outputs["Generated"]
    turned = node_of(tree, "Mapping", Rotation=(0.0, 0.0, 1.0), Vector=coordinates)
    texture = node_of(tree, "TexEnvironment", Vector=turned)
    texture.image = image("panorama", panorama, 256)
    fill(tree, tree.nodes["Background"], {0: texture})


def lamps_in_view(folder):
    _objects()
    light("POINT", "Seen", (0.5, 0.0, 1.5), 30.0, shadow_soft_size=0.1)
    light("POINT", "Inside the left sphere", (-1.35, 0.0, 0.61), 30.0, shadow_soft_size=0.1)
    light("POINT", "Behind the camera", (0.0, -6.0, 3.0), 30.0, shadow_soft_size=0.1)
