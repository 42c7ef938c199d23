# SPDX-License-Identifier: GPL-3.0-or-later
"""A furnished flat: 510 objects, 2.2 million triangles, 40 materials, of which a third are baked."""

import math
import random

import numpy as np

from corpus.stage import aim, box, camera, fill, image, light, new_file, node_of, shader, sphere, world

ROOMS, ROOM_M, HEIGHT_M = 3, 5.0, 2.7


def flat(folder):
    scene = new_file()
    scene.render.resolution_x, scene.render.resolution_y = 320, 180
    chance = random.Random(1)  # noqa: S311  (of shapes and colours)
    paints = _materials(chance)
    for room in range(ROOMS):
        _room(room * ROOM_M, paints, chance)
    _daylight()
    eye = camera((1.0, -1.2, 1.6), (2.5, 2.5, 1.0), lens=22.0)
    scene.frame_start, scene.frame_end = 1, 48
    for frame, x in ((1, 1.0), (48, ROOMS * ROOM_M - 2.0)):
        eye.location.x = x
        aim(eye, (x + 1.5, 2.5, 1.0))
        eye.keyframe_insert("location", frame=frame)
        eye.keyframe_insert("rotation_euler", frame=frame)


def _materials(chance):
    """40 materials: plastics, metals, images and, a third of them, procedural ones."""
    paints = []
    for i in range(40):
        colour = (*(chance.uniform(0.1, 0.8) for _ in range(3)), 1.0)
        finish = {"Base_Color": colour, "Roughness": chance.uniform(0.15, 0.9)}
        material, tree, node = shader(f"paint {i}", "BsdfPrincipled", **finish)
        if i % 3 == 0:
            noise = node_of(tree, "TexNoise", Scale=chance.uniform(2.0, 9.0))
            ramp = node_of(tree, "ValToRGB", Fac=noise)
            ramp.color_ramp.elements[1].color = colour
            fill(tree, node, {"Base Color": ramp})
        elif i % 3 == 1:
            fill(tree, node, {"Base Color": image(f"print {i}", lambda x, y, k=i: _print(x, y, k), 128)})
        elif i % 2:
            node.inputs["Metallic"].default_value = 1.0
        paints.append(material)
    return paints


def _print(x, y, number):
    wave = 0.5 + 0.4 * np.sin(2.0 * np.pi * (number % 7 + 1) * x) * np.sin(2.0 * np.pi * (number % 5 + 1) * y)
    return np.stack([wave, 0.8 * wave, 0.5 + 0.0 * x], -1)


def _room(x, paints, chance):
    """Floor, ceiling and walls, shelves of books, chairs, and bowls on a table."""
    box("floor", (x + 2.5, 1.0, -0.05), (ROOM_M, 6.0, 0.1), paints[1])
    box("ceiling", (x + 2.5, 1.0, HEIGHT_M), (ROOM_M, 6.0, 0.1), paints[2])
    box("wall", (x + 2.5, 4.0, HEIGHT_M / 2), (ROOM_M, 0.1, HEIGHT_M), paints[5])
    for shelf in range(5):
        box("shelf", (x + 2.5, 3.8, 0.4 + 0.4 * shelf), (3.0, 0.3, 0.03), paints[0])
        for book in range(27):
            size = (chance.uniform(0.03, 0.08), 0.2, chance.uniform(0.2, 0.32))
            place = (x + 1.05 + 0.11 * book, 3.78, 0.42 + 0.4 * shelf + size[2] / 2)
            bevel = box("book", place, size, chance.choice(paints)).modifiers.new("Bevel", "BEVEL")
            bevel.width, bevel.segments = 0.004, 2
    for seat in range(8):
        place = (x + 0.8 + 0.7 * (seat % 4), 0.6 + 1.2 * (seat // 4), 0.3)
        soft = box("chair", place, (0.5, 0.5, 0.6), chance.choice(paints)).modifiers.new("Soft", "SUBSURF")
        soft.levels, soft.render_levels = 1, 6
    for bowl in range(20):
        sphere("bowl", (x + 1.0 + 0.15 * bowl, 1.2, 0.9), 0.09, chance.choice(paints), 128)
    light("POINT", "Bulb", (x + 2.5, 1.0, 2.2), 60.0, shadow_soft_size=0.08)


def _daylight():
    tree = world((1.0, 1.0, 1.0), 1.0).node_tree
    texture = node_of(tree, "TexEnvironment")
    texture.image = image("sky", lambda _x, y: np.stack([0.4 + 0.3 * y, 0.5 + 0.3 * y, 0.7 + 0.3 * y], -1))
    fill(tree, tree.nodes["Background"], {0: texture})
    sun = light("SUN", "Sun", (0.0, -5.0, 6.0), 2.0, angle=math.radians(0.5))
    aim(sun, (3.0, 2.0, 0.0))
