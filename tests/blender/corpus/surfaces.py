# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of one kind of material each."""

import bpy
import numpy as np

from corpus.stage import image, light, node_of, plane, principled, shader, stage, three, tiles


def diffuse(folder):
    stage()
    three(
        [
            shader(f"diffuse {i}", "ShaderNodeBsdfDiffuse", Color=(*c, 1))[0]
            for i, c in enumerate([(0.8, 0.2, 0.2), (0.7, 0.7, 0.7), (0.1, 0.5, 0.2)])
        ]
    )


def plastic(folder):
    stage()
    three(
        [
            principled(f"plastic {r}", **{"Base Color": (0.7, 0.15, 0.1, 1), "Roughness": r})
            for r in (0.15, 0.3, 0.6)
        ]
    )


def plastic_smooth(folder):
    stage()
    three(
        [
            principled("red", **{"Base Color": (0.7, 0.15, 0.1, 1), "Roughness": 0.0}),
            principled("white", **{"Base Color": (0.8, 0.8, 0.8, 1), "Roughness": 0.5, "IOR": 1.7}),
            principled(
                "black", **{"Base Color": (0.01, 0.01, 0.01, 1), "Roughness": 0.1, "Specular IOR Level": 1.0}
            ),
        ]
    )


def metal(folder):
    stage()
    three(
        [
            principled(f"metal {r}", **{"Base Color": (0.9, 0.65, 0.3, 1), "Metallic": 1.0, "Roughness": r})
            for r in (0.0, 0.3, 0.7)
        ]
    )


def metal_image(folder):
    stage()
    colours = image("tiles", tiles)
    three(
        [
            principled(f"metal {r}", **{"Base Color": colours, "Metallic": 1.0, "Roughness": r})
            for r in (0.1, 0.3, 0.6)
        ]
    )


def glossy(folder):
    stage()
    three(
        [
            shader(f"glossy {r}", "ShaderNodeBsdfAnisotropic", Color=(0.8, 0.8, 0.7, 1), Roughness=r)[0]
            for r in (0.05, 0.25, 0.6)
        ]
    )


def glass(folder):
    stage()
    clear = {"Transmission Weight": 1.0, "Roughness": 0.0, "IOR": 1.45}
    three(
        [
            principled("clear", **clear, **{"Base Color": (1, 1, 1, 1)}),
            principled("green", **clear, **{"Base Color": (0.5, 0.9, 0.6, 1)}),
            shader("glass", "ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.5)[0],
        ]
    )


def glass_rough(folder):
    stage()
    three(
        [
            principled(
                f"rough {r}", **{"Base Color": (1, 1, 1, 1), "Transmission Weight": 1.0, "Roughness": r}
            )
            for r in (0.1, 0.3, 0.5)
        ]
    )


def coat(folder):
    stage()
    three(
        [
            principled(
                "coated plastic",
                **{
                    "Base Color": (0.6, 0.05, 0.05, 1),
                    "Roughness": 0.8,
                    "Coat Weight": 1.0,
                    "Coat Roughness": 0.05,
                },
            ),
            principled(
                "coated metal",
                **{"Base Color": (0.2, 0.3, 0.7, 1), "Metallic": 1.0, "Roughness": 0.5, "Coat Weight": 1.0},
            ),
            principled(
                "half a coat", **{"Base Color": (0.6, 0.5, 0.05, 1), "Roughness": 0.5, "Coat Weight": 0.5}
            ),
        ]
    )


def sheen(folder):
    stage()
    three(
        [
            principled(
                f"cloth {w}", **{"Base Color": (0.1, 0.12, 0.3, 1), "Roughness": 0.9, "Sheen Weight": w}
            )
            for w in (0.3, 0.6, 1.0)
        ]
    )


def emission(folder):
    stage()
    bpy.data.objects["Key"].data.energy = 20.0
    three(
        [
            principled(
                "glow",
                **{"Base Color": (0, 0, 0, 1), "Emission Color": (1, 0.6, 0.3, 1), "Emission Strength": 3.0},
            ),
            shader("emission", "ShaderNodeEmission", Color=(0.2, 0.5, 1, 1), Strength=2.0)[0],
            principled(
                "picture",
                **{
                    "Base Color": (0.1, 0.1, 0.1, 1),
                    "Emission Color": image("tiles", tiles),
                    "Emission Strength": 1.0,
                },
            ),
        ]
    )
    screen = plane(
        "Screen",
        (0.0, 2.0, 1.9),
        1.2,
        shader("screen", "ShaderNodeEmission", Color=(1, 1, 1, 1), Strength=1.5)[0],
    )
    screen.rotation_euler = (-1.57, 0.0, 0.0)  # turned away: its back is seen


def alpha(folder):
    stage()
    leaf = image(
        "leaf", tiles, alpha=lambda x, y: ((x - 0.5) ** 2 + (y - 0.5) ** 2 < 0.16).astype(np.float32)
    )
    cut = principled("cut out", Roughness=0.9)
    tree = cut.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = leaf
    node = tree.nodes["Principled BSDF"]
    tree.links.new(texture.outputs["Color"], node.inputs["Base Color"])
    tree.links.new(texture.outputs["Alpha"], node.inputs["Alpha"])
    mixed, tree, mix = shader("mixed", "ShaderNodeMixShader")
    tree.links.new(node_of(tree, "ShaderNodeBsdfTransparent").outputs[0], mix.inputs[1])
    tree.links.new(node_of(tree, "ShaderNodeBsdfDiffuse", Color=(0.8, 0.3, 0.1, 1)).outputs[0], mix.inputs[2])
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = leaf
    tree.links.new(texture.outputs["Alpha"], mix.inputs[0])
    three([principled("half", Alpha=0.5, Roughness=0.9), cut, mixed])


def normal_map(folder):
    stage()

    def waves(x, y):
        slope = 0.3 * np.sin(2 * np.pi * 6 * x)
        normal = np.stack([-slope, 0.3 * np.sin(2 * np.pi * 4 * y), np.ones_like(x)], -1)
        return normal / np.linalg.norm(normal, axis=-1, keepdims=True) * 0.5 + 0.5

    normals = image("normals", waves, 256, space="Non-Color")
    materials = []
    for name, strength, inputs in (
        ("full", 1.0, {"Roughness": 0.4}),
        ("half", 0.5, {"Roughness": 0.9}),
        ("metal", 1.0, {"Metallic": 1.0, "Roughness": 0.2}),
    ):
        material = principled(name, **inputs)
        tree = material.node_tree
        texture = tree.nodes.new("ShaderNodeTexImage")
        texture.image = normals
        node = node_of(tree, "ShaderNodeNormalMap", Strength=strength)
        tree.links.new(texture.outputs["Color"], node.inputs["Color"])
        tree.links.new(node.outputs["Normal"], tree.nodes["Principled BSDF"].inputs["Normal"])
        materials.append(material)
    three(materials)


def bump(folder):
    stage()
    heights = image(
        "heights",
        lambda x, y: np.repeat((0.5 + 0.5 * np.sin(40 * x) * np.sin(30 * y))[..., None], 3, -1),
        256,
        space="Non-Color",
    )
    materials = []
    for name, strength, distance in (("low", 1.0, 0.02), ("half", 0.5, 0.05), ("high", 1.0, 0.05)):
        material = principled(name, Roughness=0.5)
        tree = material.node_tree
        texture = tree.nodes.new("ShaderNodeTexImage")
        texture.image = heights
        node = node_of(tree, "ShaderNodeBump", Strength=strength, Distance=distance)
        tree.links.new(texture.outputs["Color"], node.inputs["Height"])
        tree.links.new(node.outputs["Normal"], tree.nodes["Principled BSDF"].inputs["Normal"])
        materials.append(material)
    three(materials)


def roughness_image(folder):
    stage()
    stripes = image(
        "stripes",
        lambda _x, y: np.repeat((0.15 + 0.5 * (np.sin(30 * y) > 0))[..., None], 3, -1),
        space="Non-Color",
    )
    ramp = image("ramp", lambda x, _y: np.repeat((0.1 + 0.7 * x)[..., None], 3, -1), space="Non-Color")
    three(
        [
            principled("stripes", **{"Base Color": (0.1, 0.3, 0.35, 1), "Roughness": stripes}),
            principled("ramp", **{"Base Color": (0.3, 0.3, 0.3, 1), "Roughness": ramp}),
            principled("metal", **{"Base Color": (0.8, 0.8, 0.8, 1), "Metallic": 1.0, "Roughness": stripes}),
        ]
    )


def metallic_image(folder):
    stage()
    spots = image(
        "spots",
        lambda x, y: np.repeat((np.sin(30 * x) * np.sin(30 * y) > 0).astype(float)[..., None], 3, -1),
        space="Non-Color",
    )
    three(
        [
            principled("spots", **{"Base Color": (0.8, 0.5, 0.2, 1), "Roughness": 0.3, "Metallic": spots}),
            principled("half", **{"Base Color": (0.8, 0.5, 0.2, 1), "Roughness": 0.3, "Metallic": 0.5}),
            principled(
                "tinted",
                **{
                    "Base Color": (0.8, 0.5, 0.2, 1),
                    "Roughness": 0.3,
                    "Metallic": 1.0,
                    "Specular Tint": (0.2, 0.2, 0.2, 1),
                },
            ),
        ]
    )


def mixes(folder):
    stage()
    plain, tree, mix = shader("plain", "ShaderNodeMixShader", Fac=0.3)
    tree.links.new(node_of(tree, "ShaderNodeBsdfDiffuse", Color=(0.8, 0.2, 0.1, 1)).outputs[0], mix.inputs[1])
    tree.links.new(
        node_of(tree, "ShaderNodeBsdfAnisotropic", Color=(1, 1, 1, 1), Roughness=0.3).outputs[0],
        mix.inputs[2],
    )
    fresnel, tree, mix = shader("fresnel", "ShaderNodeMixShader")
    tree.links.new(node_of(tree, "ShaderNodeFresnel", IOR=1.5).outputs[0], mix.inputs[0])
    tree.links.new(node_of(tree, "ShaderNodeBsdfDiffuse", Color=(0.1, 0.2, 0.6, 1)).outputs[0], mix.inputs[1])
    tree.links.new(
        node_of(tree, "ShaderNodeBsdfAnisotropic", Color=(1, 1, 1, 1), Roughness=0.2).outputs[0],
        mix.inputs[2],
    )
    glow, tree, total = shader("sum", "ShaderNodeAddShader")
    tree.links.new(
        node_of(tree, "ShaderNodeBsdfDiffuse", Color=(0.2, 0.6, 0.2, 1)).outputs[0], total.inputs[0]
    )
    tree.links.new(
        node_of(tree, "ShaderNodeEmission", Color=(1, 0.5, 0.2, 1), Strength=0.3).outputs[0], total.inputs[1]
    )
    three([plain, fresnel, glow])


def translucent(folder):
    stage()
    half, tree, mix = shader("half", "ShaderNodeMixShader", Fac=0.5)
    front = node_of(tree, "ShaderNodeBsdfDiffuse", Color=(0.8, 0.8, 0.6, 1))
    through = node_of(tree, "ShaderNodeBsdfTranslucent", Color=(0.8, 0.3, 0.2, 1))
    tree.links.new(front.outputs[0], mix.inputs[1])
    tree.links.new(through.outputs[0], mix.inputs[2])
    whole, _, _ = shader("curtain", "ShaderNodeBsdfTranslucent", Color=(0.3, 0.7, 0.4, 1))
    light("POINT", "Bulb", (0.9, 1.2, 1.0), 60.0, shadow_soft_size=0.1)
    for x, material in ((-1.0, half), (0.9, whole)):
        curtain = plane("Curtain", (x, 0.0, 1.0), 1.6, material)
        curtain.rotation_euler = (1.57, 0.0, 0.2)


def vertex_colours(folder):
    stage()
    material = principled("painted", Roughness=0.8)
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeVertexColor")
    node.layer_name = "Paint"
    tree.links.new(node.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    three([material] * 3)
    for name in ("Left", "Middle", "Right"):
        data = bpy.data.objects[name].data
        paint = data.color_attributes.new("Paint", "FLOAT_COLOR", "POINT")
        for vertex, colour in zip(data.vertices, paint.data, strict=True):
            colour.color = (*(0.5 + 0.45 * np.sin(5.0 * np.array(vertex.co))), 1.0)


def mapped_images(folder):
    _, floor = stage()
    colours = image("tiles", tiles)
    materials = []
    for name, kind, extension, location, angle, scale in (
        ("repeat", "POINT", "REPEAT", (0.1, 0.2, 0), 0.5, (2, 3, 1)),
        ("texture", "TEXTURE", "MIRROR", (0.3, 0.0, 0), -0.3, (0.5, 0.5, 1)),
        ("extend", "POINT", "EXTEND", (-0.5, -0.5, 0), 0.0, (2, 2, 1)),
    ):
        material = principled(name, **{"Base Color": colours, "Roughness": 0.8})
        tree = material.node_tree
        texture = next(node for node in tree.nodes if node.type == "TEX_IMAGE")
        texture.extension = extension
        mapping = node_of(tree, "ShaderNodeMapping", Location=location, Rotation=(0, 0, angle), Scale=scale)
        mapping.vector_type = kind
        coordinates = tree.nodes.new("ShaderNodeTexCoord")
        tree.links.new(coordinates.outputs["UV"], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
        materials.append(material)
    three(materials)
    floor.data.materials[0] = principled("tiled floor", **{"Base Color": colours, "Roughness": 0.7})


def procedural(folder):
    stage()
    noise = principled("noise", Roughness=0.7)
    tree = noise.node_tree
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].color = (0.5, 0.1, 0.05, 1)
    ramp.color_ramp.elements[1].color = (0.9, 0.8, 0.5, 1)
    tree.links.new(node_of(tree, "ShaderNodeTexNoise", Scale=4.0).outputs[0], ramp.inputs[0])
    tree.links.new(ramp.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
    voronoi = principled("voronoi", **{"Base Color": (0.2, 0.4, 0.6, 1)})
    tree = voronoi.node_tree
    cells = node_of(tree, "ShaderNodeTexVoronoi", Scale=6.0)
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Object"], cells.inputs["Vector"])
    bumps = node_of(tree, "ShaderNodeBump", Strength=0.6, Distance=0.05)
    tree.links.new(cells.outputs["Distance"], bumps.inputs["Height"])
    tree.links.new(bumps.outputs[0], tree.nodes["Principled BSDF"].inputs["Normal"])
    checker = principled("checker", Roughness=0.8)
    tree = checker.node_tree
    tree.links.new(
        node_of(tree, "ShaderNodeTexChecker", Scale=7.0).outputs[0],
        tree.nodes["Principled BSDF"].inputs["Base Color"],
    )
    three([noise, voronoi, checker])


def corrected_images(folder):
    stage()
    colours = image("tiles", tiles)
    hue = principled("hue", Roughness=0.8)
    tree = hue.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = colours
    turn = node_of(tree, "ShaderNodeHueSaturation", Hue=0.7, Saturation=1.2, Value=0.8)
    tree.links.new(texture.outputs[0], turn.inputs["Color"])
    tree.links.new(turn.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
    packed = principled("occlusion roughness metallic")
    tree = packed.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image(
        "orm",
        lambda x, y: np.stack([np.ones_like(x), 0.2 + 0.6 * x, (y > 0.5).astype(float)], -1),
        space="Non-Color",
    )
    parts = tree.nodes.new("ShaderNodeSeparateColor")
    tree.links.new(texture.outputs[0], parts.inputs[0])
    tree.links.new(parts.outputs[1], tree.nodes["Principled BSDF"].inputs["Roughness"])
    tree.links.new(parts.outputs[2], tree.nodes["Principled BSDF"].inputs["Metallic"])
    three([hue, packed, grouped(colours)])


def grouped(colours):
    """A group that mixes an image with a colour by a factor of its own."""
    group = bpy.data.node_groups.new("Tint", "ShaderNodeTree")
    group.interface.new_socket("Colour", in_out="INPUT", socket_type="NodeSocketColor")
    group.interface.new_socket("Result", in_out="OUTPUT", socket_type="NodeSocketColor")
    start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    mix = group.nodes.new("ShaderNodeMixRGB")
    mix.blend_type = "MULTIPLY"
    mix.inputs[0].default_value = 1.0
    mix.inputs[2].default_value = (0.4, 0.9, 0.5, 1.0)
    group.links.new(start.outputs[0], mix.inputs[1])
    group.links.new(mix.outputs[0], end.inputs[0])
    material = principled("group", Roughness=0.6)
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = colours
    tree.links.new(texture.outputs[0], node.inputs[0])
    tree.links.new(node.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
    return material


CASES = (
    diffuse,
    plastic,
    plastic_smooth,
    metal,
    metal_image,
    glossy,
    glass,
    glass_rough,
    coat,
    sheen,
    emission,
    alpha,
    normal_map,
    bump,
    roughness_image,
    metallic_image,
    mixes,
    translucent,
    vertex_colours,
    mapped_images,
    procedural,
    corrected_images,
)
