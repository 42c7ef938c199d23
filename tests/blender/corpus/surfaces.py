# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of one kind of material each."""

import bpy
import numpy as np

from corpus.stage import fill, image, light, node_of, picture, plane, principled, shader, stage, three, tiles


def diffuse(folder):
    stage()
    colours = (0.8, 0.2, 0.2, 1), (0.7, 0.7, 0.7, 1), (0.1, 0.5, 0.2, 1)
    three(*(shader(f"diffuse {i}", "BsdfDiffuse", Color=c)[0] for i, c in enumerate(colours)))


def plastic(folder):
    stage()
    three(*(principled(f"plastic {r}", (0.7, 0.15, 0.1, 1), Roughness=r) for r in (0.15, 0.3, 0.6)))


def plastic_smooth(folder):
    stage()
    three(
        principled("red", (0.7, 0.15, 0.1, 1), Roughness=0.0),
        principled("white", Roughness=0.5, IOR=1.7),
        principled("black", (0.01, 0.01, 0.01, 1), Roughness=0.1, Specular_IOR_Level=1.0),
    )


def metal(folder):
    stage()
    gold = {"colour": (0.9, 0.65, 0.3, 1), "Metallic": 1.0}
    three(*(principled(f"metal {r}", **gold, Roughness=r) for r in (0.0, 0.3, 0.7)))


def metal_image(folder):
    stage()
    printed = {"colour": image("tiles", tiles), "Metallic": 1.0}
    three(*(principled(f"metal {r}", **printed, Roughness=r) for r in (0.1, 0.3, 0.6)))


def glossy(folder):
    stage()
    grey = {"Color": (0.8, 0.8, 0.7, 1)}
    three(*(shader(f"glossy {r}", "BsdfAnisotropic", **grey, Roughness=r)[0] for r in (0.05, 0.25, 0.6)))


def glass(folder):
    stage()
    clear = {"Transmission_Weight": 1.0, "Roughness": 0.0, "IOR": 1.45}
    three(
        principled("clear", (1, 1, 1, 1), **clear),
        principled("green", (0.5, 0.9, 0.6, 1), **clear),
        shader("glass", "BsdfGlass", Roughness=0.0, IOR=1.5)[0],
    )


def glass_rough(folder):
    stage()
    clear = {"colour": (1, 1, 1, 1), "Transmission_Weight": 1.0}
    three(*(principled(f"rough {r}", **clear, Roughness=r) for r in (0.1, 0.3, 0.5)))


def coat(folder):
    stage()
    red, blue, yellow = (0.6, 0.05, 0.05, 1), (0.2, 0.3, 0.7, 1), (0.6, 0.5, 0.05, 1)
    three(
        principled("coated plastic", red, Roughness=0.8, Coat_Weight=1.0, Coat_Roughness=0.05),
        principled("coated metal", blue, Metallic=1.0, Roughness=0.5, Coat_Weight=1.0),
        principled("half a coat", yellow, Roughness=0.5, Coat_Weight=0.5),
    )


def sheen(folder):
    stage()
    cloth = {"colour": (0.1, 0.12, 0.3, 1), "Roughness": 0.9}
    three(*(principled(f"cloth {w}", **cloth, Sheen_Weight=w) for w in (0.3, 0.6, 1.0)))


def emission(folder):
    stage()
    bpy.data.objects["Key"].data.energy = 20.0
    orange, shown = (1, 0.6, 0.3, 1), image("tiles", tiles)
    three(
        principled("glow", (0, 0, 0, 1), Emission_Color=orange, Emission_Strength=3.0),
        shader("emission", "Emission", Color=(0.2, 0.5, 1, 1), Strength=2.0)[0],
        principled("picture", (0.1, 0.1, 0.1, 1), Emission_Color=shown, Emission_Strength=1.0),
    )
    white = shader("screen", "Emission", Color=(1, 1, 1, 1), Strength=1.5)[0]
    screen = plane("Screen", (0.0, 2.0, 1.9), 1.2, white)
    screen.rotation_euler = (-1.57, 0.0, 0.0)  # turned away: its back is seen


def alpha(folder):
    stage()
    leaf = image(
        "leaf", tiles, alpha=lambda x, y: ((x - 0.5) ** 2 + (y - 0.5) ** 2 < 0.16).astype(np.float32)
    )
    cut, tree, node = shader("cut out", "BsdfPrincipled", Roughness=0.9)
    texture = picture(tree, leaf)
    fill(tree, node, {"Base Color": texture, "Alpha": texture.outputs["Alpha"]})
    mixed, tree, mix = shader("mixed", "MixShader")
    clear, paint = node_of(tree, "BsdfTransparent"), node_of(tree, "BsdfDiffuse", Color=(0.8, 0.3, 0.1, 1))
    fill(tree, mix, {1: clear, 2: paint, 0: picture(tree, leaf).outputs["Alpha"]})
    three(principled("half", Alpha=0.5, Roughness=0.9), cut, mixed)


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
        material, tree, node = shader(name, "BsdfPrincipled", **inputs)
        fill(tree, node, {"Normal": node_of(tree, "NormalMap", Strength=strength, Color=normals)})
        materials.append(material)
    three(*materials)


def bump(folder):
    stage()
    heights = image(
        "heights", _grey(lambda x, y: 0.5 + 0.5 * np.sin(40 * x) * np.sin(30 * y)), space="Non-Color"
    )
    materials = []
    for name, strength, distance in (("low", 1.0, 0.02), ("half", 0.5, 0.05), ("high", 1.0, 0.05)):
        material, tree, node = shader(name, "BsdfPrincipled", Roughness=0.5)
        bumps = node_of(tree, "Bump", Strength=strength, Distance=distance, Height=heights)
        fill(tree, node, {"Normal": bumps})
        materials.append(material)
    three(*materials)


def roughness_image(folder):
    stage()
    stripes = image("stripes", _grey(lambda _x, y: 0.15 + 0.5 * (np.sin(30 * y) > 0)), space="Non-Color")
    ramp = image("ramp", _grey(lambda x, _y: 0.1 + 0.7 * x), space="Non-Color")
    three(
        principled("stripes", (0.1, 0.3, 0.35, 1), Roughness=stripes),
        principled("ramp", (0.3, 0.3, 0.3, 1), Roughness=ramp),
        principled("metal", Metallic=1.0, Roughness=stripes),
    )


def metallic_image(folder):
    stage()
    spots = image(
        "spots", _grey(lambda x, y: (np.sin(30 * x) * np.sin(30 * y) > 0).astype(float)), space="Non-Color"
    )
    bronze = {"colour": (0.8, 0.5, 0.2, 1), "Roughness": 0.3}
    three(
        principled("spots", **bronze, Metallic=spots),
        principled("half", **bronze, Metallic=0.5),
        principled("tinted", **bronze, Metallic=1.0, Specular_Tint=(0.2, 0.2, 0.2, 1)),
    )


def mixes(folder):
    stage()
    plain, tree, mix = shader("plain", "MixShader", Fac=0.3)
    fill(tree, mix, {
        1: node_of(tree, "BsdfDiffuse", Color=(0.8, 0.2, 0.1, 1)),
        2: node_of(tree, "BsdfAnisotropic", Color=(1, 1, 1, 1), Roughness=0.3),
    })  # fmt: skip
    fresnel, tree, mix = shader("fresnel", "MixShader")
    fill(tree, mix, {
        0: node_of(tree, "Fresnel", IOR=1.5),
        1: node_of(tree, "BsdfDiffuse", Color=(0.1, 0.2, 0.6, 1)),
        2: node_of(tree, "BsdfAnisotropic", Color=(1, 1, 1, 1), Roughness=0.2),
    })  # fmt: skip
    glow, tree, total = shader("sum", "AddShader")
    fill(tree, total, {
        0: node_of(tree, "BsdfDiffuse", Color=(0.2, 0.6, 0.2, 1)),
        1: node_of(tree, "Emission", Color=(1, 0.5, 0.2, 1), Strength=0.3),
    })  # fmt: skip
    three(plain, fresnel, glow)


def translucent(folder):
    stage()
    half, tree, mix = shader("half", "MixShader", Fac=0.5)
    front = node_of(tree, "BsdfDiffuse", Color=(0.8, 0.8, 0.6, 1))
    through = node_of(tree, "BsdfTranslucent", Color=(0.8, 0.3, 0.2, 1))
    fill(tree, mix, {1: front, 2: through})
    whole = shader("curtain", "BsdfTranslucent", Color=(0.3, 0.7, 0.4, 1))[0]
    light("POINT", "Bulb", (0.9, 1.2, 1.0), 60.0, shadow_soft_size=0.1)
    for x, material in ((-1.0, half), (0.9, whole)):
        curtain = plane("Curtain", (x, 0.0, 1.0), 1.6, material)
        curtain.rotation_euler = (1.57, 0.0, 0.2)


def vertex_colours(folder):
    stage()
    material, tree, bsdf = shader("painted", "BsdfPrincipled", Roughness=0.8)
    node = node_of(tree, "VertexColor")
    node.layer_name = "Paint"
    fill(tree, bsdf, {"Base Color": node})
    three(material, material, material)
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
        material, tree, node = shader(name, "BsdfPrincipled", Roughness=0.8)
        texture = picture(tree, colours)
        texture.extension = extension
        mapping = node_of(tree, "Mapping", Location=location, Rotation=(0, 0, angle), Scale=scale)
        mapping.vector_type = kind
        fill(tree, mapping, {"Vector": node_of(tree, "TexCoord").outputs["UV"]})
        fill(tree, texture, {"Vector": mapping})
        fill(tree, node, {"Base Color": texture})
        materials.append(material)
    three(*materials)
    floor.data.materials[0] = principled("tiled floor", colours, Roughness=0.7)


def procedural(folder):
    stage()
    noise, tree, node = shader("noise", "BsdfPrincipled", Roughness=0.5)
    ramp = node_of(tree, "ValToRGB", Fac=node_of(tree, "TexNoise", Scale=4.0))
    ramp.color_ramp.elements[0].color = (0.5, 0.1, 0.05, 1)
    ramp.color_ramp.elements[1].color = (0.9, 0.8, 0.5, 1)
    fill(tree, node, {"Base Color": ramp})
    voronoi, tree, node = shader("voronoi", "BsdfPrincipled", Base_Color=(0.2, 0.4, 0.6, 1))
    cells = node_of(tree, "TexVoronoi", Scale=6.0, Vector=node_of(tree, "TexCoord").outputs["Object"])
    fill(tree, node, {"Normal": node_of(tree, "Bump", Strength=0.6, Distance=0.05, Height=cells)})
    checker, tree, node = shader("checker", "BsdfPrincipled", Roughness=0.8)
    fill(tree, node, {"Base Color": node_of(tree, "TexChecker", Scale=7.0)})
    three(noise, voronoi, checker)


def corrected_images(folder):
    stage()
    colours = image("tiles", tiles)
    hue, tree, node = shader("hue", "BsdfPrincipled", Roughness=0.8)
    turn = node_of(tree, "HueSaturation", Hue=0.7, Saturation=1.2, Value=0.8, Color=colours)
    fill(tree, node, {"Base Color": turn})
    packed, tree, node = shader("occlusion roughness metallic", "BsdfPrincipled")
    layers = image(
        "orm",
        lambda x, y: np.stack([np.ones_like(x), 0.2 + 0.6 * x, (y > 0.5).astype(float)], -1),
        space="Non-Color",
    )
    parts = node_of(tree, "SeparateColor", Color=layers)
    fill(tree, node, {"Roughness": parts.outputs[1], "Metallic": parts.outputs[2]})
    three(hue, packed, _grouped(colours))


def _grouped(colours):
    """A group that mixes an image with a colour by a factor of its own."""
    group = bpy.data.node_groups.new("Tint", "ShaderNodeTree")
    group.interface.new_socket("Colour", in_out="INPUT", socket_type="NodeSocketColor")
    group.interface.new_socket("Result", in_out="OUTPUT", socket_type="NodeSocketColor")
    start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    mix = node_of(group, "MixRGB", Fac=1.0, Color1=start, Color2=(0.4, 0.9, 0.5, 1.0))
    mix.blend_type = "MULTIPLY"
    fill(group, end, {0: mix})
    material, tree, bsdf = shader("group", "BsdfPrincipled", Roughness=0.6)
    node = node_of(tree, "Group")
    node.node_tree = group
    fill(tree, node, {0: colours})
    fill(tree, bsdf, {"Base Color": node})
    return material


def _grey(function):
    """A function of x and y as an image's three channels."""
    return lambda x, y: np.repeat(function(x, y)[..., None], 3, -1)
