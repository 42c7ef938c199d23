# SPDX-License-Identifier: GPL-3.0-or-later
"""An office: 704 objects, most of them instances, 3.6 million triangles, 34 materials, 14 of them baked."""

import random

import numpy as np

from corpus.stage import (
    aim,
    box,
    camera,
    fill,
    group,
    image,
    instance,
    light,
    new_file,
    node_of,
    scattering,
    shader,
    sphere,
    world,
)

LENGTH_M, DEPTH_M, HEIGHT_M = 18.0, 8.0, 3.0
PATTERNS = (  # procedural: kind of node, and its scales
    ("TexNoise", {"Scale": 14.0, "Detail": 4.0}),
    ("TexVoronoi", {"Scale": 9.0}),
    ("TexWave", {"Scale": 3.0, "Distortion": 2.0}),
    ("TexBrick", {"Scale": 4.0}),
    ("TexChecker", {"Scale": 10.0}),
    ("TexMagic", {"Scale": 5.0}),
    ("TexGradient", {}),
)


def office(folder):
    scene = new_file()
    scene.render.resolution_x, scene.render.resolution_y = 320, 180
    chance = random.Random(2)  # noqa: S311  (of colours and places)
    paints = _materials(chance)
    _shell(paints)
    _desks(paints, chance)
    _plants(paints)
    _lamps()
    eye = camera((1.5, 1.0, 1.6), (6.0, 5.0, 1.0), lens=22.0)
    scene.frame_start, scene.frame_end = 1, 60
    for frame, x in ((1, 1.5), (60, LENGTH_M - 5.0)):
        eye.location.x = x
        aim(eye, (x + 4.0, 5.5, 0.9))
        eye.keyframe_insert("location", frame=frame)
        eye.keyframe_insert("rotation_euler", frame=frame)


def _materials(chance):
    """Plastics, metals, glass, coats, images, and 14 procedural ones that no image serves for."""
    paints = {"glass": shader("pane", "BsdfPrincipled", Transmission_Weight=1.0, Roughness=0.0, IOR=1.45)[0]}
    screen = image(
        "screen", lambda x, y: np.stack([0.2 + 0.0 * x, 0.4 + 0.3 * np.sin(40.0 * y), 0.6 * x], -1), 128
    )
    material, tree, node = shader("screen", "BsdfPrincipled", Roughness=0.2, Emission_Strength=1.5)
    fill(tree, node, {"Emission Color": screen, "Base Color": (0.02, 0.02, 0.02, 1.0)})
    paints["screen"] = material
    for i in range(38):
        colour = (*(chance.uniform(0.15, 0.75) for _ in range(3)), 1.0)
        rough = {"Roughness": chance.uniform(0.2, 0.9)}
        material, tree, node = shader(f"finish {i}", "BsdfPrincipled", Base_Color=colour, **rough)
        if i < 14:
            kind, scales = PATTERNS[i % len(PATTERNS)]
            ramp = node_of(tree, "ValToRGB", Fac=node_of(tree, kind, **scales))
            ramp.color_ramp.elements[0].color = (*(0.4 * c for c in colour[:3]), 1.0)
            ramp.color_ramp.elements[1].color = colour
            fill(tree, node, {"Base Color": ramp})
        elif i < 22:
            node.inputs["Metallic"].default_value = 1.0
        elif i < 28:
            node.inputs["Coat Weight"].default_value = 1.0
        elif i < 34:
            fill(tree, node, {"Base Color": image(f"cover {i}", lambda x, y, k=i: _cover(x, y, k), 128)})
        paints[i] = material
    return paints


def _cover(x, y, number):
    stripes = 0.5 + 0.4 * np.sign(np.sin(2.0 * np.pi * (number % 5 + 2) * (x + 0.3 * y)))
    return np.stack([stripes, 0.6 * stripes + 0.1, 0.3 + 0.4 * y], -1)


def _shell(paints):
    """Floor, ceiling, walls, a row of windows with frames, and glass between the desks."""
    middle = LENGTH_M / 2
    box("carpet", (middle, 4.0, -0.05), (LENGTH_M, DEPTH_M, 0.1), paints[0])
    box("ceiling", (middle, 4.0, HEIGHT_M), (LENGTH_M, DEPTH_M, 0.1), paints[34])
    box("brick wall", (middle, 0.0, HEIGHT_M / 2), (LENGTH_M, 0.1, HEIGHT_M), paints[3])
    for side, x in enumerate((0.0, LENGTH_M)):
        box("end wall", (x, 4.0, HEIGHT_M / 2), (0.1, DEPTH_M, HEIGHT_M), paints[35 + side])
    box("sill", (middle, DEPTH_M, 0.4), (LENGTH_M, 0.15, 0.8), paints[37])
    for i in range(13):
        box("mullion", (1.5 * i, DEPTH_M, 1.9), (0.08, 0.12, 2.2), paints[14])
    for i in range(3):
        box("partition", (4.5 + 4.5 * i, 5.0, 0.95), (0.02, 3.0, 1.9), paints["glass"])


def _desks(paints, chance):
    """24 instances of a collection of 26 objects, and shelves along the brick wall."""
    parts = [
        box("top", (0.0, 0.0, 0.74), (1.4, 0.7, 0.03), paints[2]),
        box("monitor", (0.0, 0.22, 1.1), (0.6, 0.03, 0.36), paints[22]),
        box("screen", (0.0, 0.2, 1.1), (0.56, 0.012, 0.32), paints["screen"]),
        box("foot", (0.0, 0.22, 0.84), (0.08, 0.08, 0.18), paints[15]),
        *(
            box("leg", (0.65 * (-1) ** i, 0.3 * (-1) ** (i // 2), 0.37), (0.05, 0.05, 0.72), paints[16])
            for i in range(4)
        ),
        *(
            box("paper", (-0.5 + 0.03 * i, -0.1, 0.76 + 0.006 * i), (0.2, 0.28, 0.005), paints[28 + i % 6])
            for i in range(10)
        ),
        *(
            sphere(
                "sweet", (0.42 + 0.05 * (i % 3), -0.1 + 0.05 * (i // 3), 0.79), 0.03, paints[4 + i % 10], 48
            )
            for i in range(6)
        ),
    ]
    seat = box("seat", (0.0, -0.55, 0.48), (0.48, 0.48, 0.14), paints[1])
    back = box("back", (0.0, -0.78, 0.85), (0.44, 0.1, 0.6), paints[5])
    for cushion in (seat, back):
        soft = cushion.modifiers.new("Soft", "SUBSURF")
        soft.levels, soft.render_levels = 1, 6
    desk = group("Desk", [*parts, seat, back])
    for i in range(24):
        place = (1.2 + 1.5 * (i % 12), 3.4 + 2.6 * (i // 12), 0.0)
        instance(f"desk {i}", desk, place, chance.uniform(-0.2, 0.2))
    for i in range(40):
        size = (chance.uniform(0.04, 0.3), 0.24, chance.uniform(0.15, 0.32))
        place = (1.0 + 0.4 * i, 0.22, 1.2 + size[2] / 2 + 0.5 * (i % 2))
        bevel = box("binder", place, size, paints[chance.randrange(38)]).modifiers.new("Bevel", "BEVEL")
        bevel.width, bevel.segments = 0.01, 3
    for height in (1.19, 1.69):
        box("shelf", (LENGTH_M / 2, 0.22, height), (LENGTH_M - 1.0, 0.3, 0.02), paints[9])


def _plants(paints):
    """Eight pots; leaves are scattered over a sphere by geometry nodes."""
    leaf = sphere("leaf", (0.0, 0.0, -5.0), 0.06, paints[23], 48)
    leaf.scale, leaf.hide_render = (1.0, 0.5, 0.1), True
    for i in range(8):
        x = 2.0 + 2.1 * i
        box("pot", (x, 7.4, 0.2), (0.35, 0.35, 0.4), paints[6 + i])
        crown = sphere("crown", (x, 7.4, 0.85), 0.4, paints[24], 48)
        crown.modifiers.new("Leaves", "NODES").node_group = _scatter(leaf)


def _scatter(leaf):
    """Instances of an object on the points of a surface, in place of the surface."""
    tree, _, points, end = scattering("Leaves", density=20.0)
    info, copies = (tree.nodes.new(f"GeometryNode{kind}") for kind in ("ObjectInfo", "InstanceOnPoints"))
    info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = leaf, True
    tree.links.new(points.outputs["Points"], copies.inputs["Points"])
    tree.links.new(points.outputs["Rotation"], copies.inputs["Rotation"])
    tree.links.new(info.outputs["Geometry"], copies.inputs["Instance"])
    tree.links.new(copies.outputs[0], end.inputs[0])
    return tree


def _lamps():
    """Twelve panels in the ceiling, two spots, and a sky with a bright part."""
    for i in range(12):
        panel = light(
            "AREA", f"Panel {i}", (1.5 + 3.0 * (i % 6), 2.5 + 3.0 * (i // 6), 2.9), 25.0, shape="RECTANGLE"
        )
        panel.data.size, panel.data.size_y, panel.rotation_euler = 1.2, 0.3, (0.0, 0.0, 0.0)
    for i in range(2):
        place = (6.0 + 6.0 * i, 1.5, 2.8)
        light("SPOT", f"Spot {i}", place, 80.0, (place[0], 0.0, 1.4), spot_size=0.9, shadow_soft_size=0.03)
    tree = world((1.0, 1.0, 1.0), 1.2).node_tree
    texture = node_of(tree, "TexEnvironment")
    texture.image = image(
        "sky",
        lambda x, y: (
            (0.3 + 0.5 * y + 2.0 * ((x - 0.5) ** 2 + (y - 0.6) ** 2 < 0.01))[..., None] * (0.8, 0.9, 1.0)
        ),
    )
    fill(tree, tree.nodes["Background"], {0: texture})
