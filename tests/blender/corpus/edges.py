# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials that are easily lost: one plane of each."""

import math
import shutil
from pathlib import Path

import bpy
import numpy as np

from corpus.stage import (
    add,
    box,
    cube,
    fill,
    finish,
    group,
    image,
    instance,
    light,
    new_file,
    node_of,
    picture,
    plane,
    principled,
    shader,
    sphere,
    tiles,
    world,
)


def uncommon_materials(folder):
    new_file()
    half = image("half", _grey, 16, alpha=lambda x, _y: np.where(x < 0.5, 1.0, 0.5))
    (folder / "picture.png").write_bytes(half.packed_file.data)
    kinds = _cut_out, _see_through, _sheer_gloss, _bumpy_plastic, _pixelated, _bright, _decal, _scaled
    materials = [make(half) for make in kinds]
    materials += [
        principled("premultiplied", half, Metallic=1.0),
        principled("brushed", Metallic=1.0, Anisotropic=0.8, Anisotropic_Rotation=0.25),
        principled("brushed by image", Metallic=1.0, Anisotropic=half),
        principled("green mirror", Metallic=1.0, Roughness=image("green", _green, 16, space="Non-Color")),
        principled("plated", (0.8, 0.6, 0.3, 1), Metallic=1.0, Transmission_Weight=1.0, Roughness=0.05),
        principled("faint glow", Emission_Color=(1, 1, 1, 1), Emission_Strength=4.0, Alpha=0.25),
        principled("varnished", Roughness=0.5, Coat_Weight=1.0, Coat_Roughness=0.1),
        principled("picture", bpy.data.images.load(str(folder / "picture.png"))),
    ]
    for number, material in enumerate(materials):
        plane(material.name, (2.0 * number, 0.0, 0.0), 1.5, material)
    stained = principled("stained glass", half, Transmission_Weight=1.0, Roughness=0.0)
    cube("stained glass", (0.0, 6.0, 0.0), 1.5, stained)
    sphere("Ghost", (0.0, 60.0, 0.0), 50.0, bpy.data.materials["faint glow"])


def kinds_of_rays(folder):
    """Materials that depend on Light Path."""
    new_file()
    unlit, tree, mix = shader("unlit", "MixShader")
    is_camera = node_of(tree, "LightPath").outputs["Is Camera Ray"]
    clear, glow = node_of(tree, "BsdfTransparent"), node_of(tree, "Emission", Color=(1, 0.5, 0.2, 1))
    fill(tree, mix, {0: is_camera, 1: clear, 2: glow})
    shadowless, tree, mix = shader("shadowless", "MixShader")
    path, most = node_of(tree, "LightPath"), node_of(tree, "Math")
    most.operation = "MAXIMUM"
    fill(tree, most, {0: path.outputs["Is Shadow Ray"], 1: path.outputs["Is Camera Ray"]})
    fill(tree, mix, {0: most, 1: node_of(tree, "BsdfDiffuse"), 2: node_of(tree, "BsdfTransparent")})
    by_ray, tree, node = shader("by ray", "BsdfDiffuse")
    scaled = node_of(tree, "Math", Value=0.5)
    scaled.operation = "ADD"
    fill(tree, scaled, {1: node_of(tree, "LightPath").outputs["Is Camera Ray"]})
    fill(tree, node, {"Color": scaled})
    by_number, tree, node = shader("by number", "BsdfDiffuse")
    fill(tree, node, {"Roughness": node_of(tree, "LightPath").outputs["Is Diffuse Ray"]})
    for number, material in enumerate((unlit, shadowless, by_ray, by_number)):
        plane(material.name, (2.0 * number, 0.0, 0.0), 1.5, material)


def missing_images(folder):
    """Images without a file: of the world, in a group, below a colour correction, of a sequence's frame."""
    new_file()
    lost = bpy.data.images.new("lost", 4, 4)
    lost.source, lost.filepath = "FILE", "//gone/lost.png"
    group = bpy.data.node_groups.new("panorama", "ShaderNodeTree")
    group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    sky = node_of(group, "TexEnvironment")
    sky.image = lost
    fill(group, group.nodes.new("NodeGroupOutput"), {0: sky})
    tree = world((1.0, 1.0, 1.0)).node_tree
    node = node_of(tree, "Group")
    node.node_tree = group
    fill(tree, tree.nodes["Background"], {0: node})
    corrected, tree, node = shader("corrected", "BsdfDiffuse")
    fill(tree, node, {"Color": node_of(tree, "Invert", Color=lost)})
    plane("Corrected", (0.0, 0.0, 0.0), 1.5, corrected)
    reel = image("reel", tiles, 16)
    reel.filepath_raw, reel.file_format = str(folder / "reel0002.png"), "PNG"
    reel.save()
    reel.source = "SEQUENCE"
    for number, (name, offset) in enumerate({"late": 0, "shown": 1}.items()):
        material, tree, node = shader(name, "BsdfDiffuse")
        fill(tree, node, {"Color": reel})
        tree.nodes["Image Texture"].image_user.frame_offset = offset
        plane(name, (2.0 + 2.0 * number, 0.0, 0.0), 1.5, material)


def picture_files(folder):
    """A plane of each picture of the name foreign in the folder, in the dark, for a camera without a path."""
    new_file().camera.data.type = "ORTHO"
    for number, file in enumerate(sorted(folder.glob("foreign.*"))):
        material = principled(file.name, bpy.data.images.load(str(file)), Metallic=1.0)
        plane(file.name, (2.0 * number, 0.0, 0.0), 1.5, material)


def mirrored_camera(_folder):
    scene = new_file()
    scene.camera.scale = (1.0, -2.0, 1.0)
    scene.camera.location.x += 5000.0
    plane("Floor", (0.0, 0.0, 0.0), 4.0, principled("floor"))


def miniature(_folder):
    """A coin of millimetres, nearer than Blender's Clip Start; the camera's parent has an uneven scale."""
    scene = new_file()
    light("POINT", "Lamp", (0.0, 0.0, 0.02), 1e-4, shadow_soft_size=0.0)
    plane("Coin", (0.0, 0.0, 0.0), 0.01, principled("coin"))
    eye = scene.camera
    eye.location, eye.rotation_euler = (0.0, -0.0225, 0.0065), (math.radians(60.0), 0.0, 0.0)
    eye.parent = rig = add("Rig", None)
    rig.scale, rig.rotation_euler = (1.0, 1.0, 2.0), (0.0, 0.0, 0.5)


def mirrored_normals(_folder):
    """Mirrors of a tilted normal map: as it is, with u or v mirrored, of scale -1, and with a reflection.

    Then this one and a bump map seen from behind; the closed cube has no back. One more has the tangents of
    another UV map than its image's, on which v is along x.
    """
    new_file()
    tilted = image("tilt", lambda x, _: np.full((*x.shape, 3), (0.5, 0.8, 0.9)), 16, space="Non-Color")
    material, tree, bsdf = shader("tilted", "BsdfAnisotropic", Roughness=0.0)
    fill(tree, bsdf, {"Normal": node_of(tree, "NormalMap", Color=tilted)})
    for number, name in enumerate(("plain", "u", "v", "scale")):
        board = plane(name, (2.0 * number, 0.0, 0.0), 1.0, material)
        board.scale.x = -1.0 if name == "scale" else 1.0
        for loop in board.data.uv_layers[0].uv:
            u, v = loop.vector
            loop.vector = (1.0 - u if name == "u" else u), (1.0 - v if name == "v" else v)
    pair = plane("pair", (8.0, 0.0, 0.0), 1.0, material)
    for vertex in pair.data.vertices:
        vertex.co.x += 0.5
    pair.modifiers.new("Mirror", "MIRROR")
    bumpy, tree, bsdf = shader("bumpy", "BsdfAnisotropic", Roughness=0.0)
    slope = image(
        "slope", lambda _, y: np.repeat(np.floor(y * 17)[..., None] / 17, 3, -1), 17, space="Non-Color"
    )
    fill(tree, bsdf, {"Normal": node_of(tree, "Bump", Strength=1.0, Distance=0.75, Height=slope)})
    for number, behind in enumerate((material, bumpy)):
        plane("behind", (10.0 + 2.0 * number, 0.0, 0.0), 1.0, behind).rotation_euler.y = math.pi
    cube("closed", (14.0, 0.0, 0.0), 1.0, bumpy)
    turned, tree, bsdf = shader("turned", "BsdfAnisotropic", Roughness=0.0)
    normal = node_of(tree, "NormalMap", Color=tilted)
    normal.uv_map = "Turned"
    fill(tree, bsdf, {"Normal": normal})
    maps = plane("turned", (-2.0, 0.0, 0.0), 1.0, turned).data.uv_layers
    for loop, shown in zip(maps.new(name="Turned").uv, maps[0].uv, strict=True):
        loop.vector = 1.0 - shown.vector[1], shown.vector[0]


def soft_bumps(_folder):
    """Mirrors of a slope of 0.75, one of them twice as large: their normals are mixed with the surface's."""
    new_file()
    slope = image(
        "slope", lambda _, y: np.repeat(np.floor(y * 17)[..., None] / 17, 3, -1), 17, space="Non-Color"
    )
    material, tree, bsdf = shader("soft", "BsdfAnisotropic", Roughness=0.0)
    fill(tree, bsdf, {"Normal": node_of(tree, "Bump", Strength=0.5, Distance=0.75, Height=slope)})
    plane("small", (0.0, 0.0, 0.0), 1.0, material)
    plane("large", (3.0, 0.0, 0.0), 2.0, material)


def tilted(_folder):
    """A white plane of tilted normals, in even light."""
    new_file()
    world((0.5, 0.5, 0.5))
    tilt = image("tilt", lambda x, _: np.full((*x.shape, 3), (0.5, 0.8, 0.9)), 16, space="Non-Color")
    material, tree, bsdf = shader("tilted", "BsdfDiffuse", Color=(0.8, 0.8, 0.8, 1.0))
    fill(tree, bsdf, {"Normal": node_of(tree, "NormalMap", Color=tilt)})
    plane("tilted", (0.0, 0.0, -1.0), 60.0, material)


def single_scattering(_folder):
    """A rough metal of single scattering, in even light."""
    new_file()
    world((0.5, 0.5, 0.5))
    gold, _, bsdf = shader("gold", "BsdfAnisotropic", Color=(0.8, 0.6, 0.3, 1.0), Roughness=0.7)
    bsdf.distribution = "GGX"
    plane("gold", (0.0, 0.0, 0.0), 60.0, gold).rotation_euler.x = math.pi / 2


def lamp_nodes(_folder):
    """Lamps whose nodes are more than numbers."""
    new_file()
    plane("Floor", (0.0, 0.0, 0.0), 4.0, principled("floor"))
    kinds = {
        "Falloff": ("LightFalloff", "Linear", "Strength", {"Strength": 50.0}),
        "Pattern": ("TexNoise", "Color", "Color", {}),
        "Warm": ("Blackbody", "Color", "Color", {"Temperature": 2700.0}),
    }
    for name, (kind, output, socket, inputs) in kinds.items():
        tree, emission = _lamp_of_nodes(name)
        fill(tree, emission, {socket: node_of(tree, kind, **inputs).outputs[output]})
    tree, emission = _lamp_of_nodes("Computed")
    product, mixed = node_of(tree, "Math"), node_of(tree, "MixRGB")
    product.operation = "MULTIPLY"
    fill(tree, product, {0: 3.0, 1: 5.0})
    fill(tree, mixed, {0: 0.25, 1: (1.0, 0.0, 0.0, 1.0), 2: (0.0, 0.0, 1.0, 1.0)})
    fill(tree, emission, {"Color": mixed, "Strength": node_of(tree, "LightFalloff", Strength=product)})
    bpy.data.lights["Computed"].keyframe_insert("energy")
    add("Computed again", bpy.data.lights["Computed"], (1.0, 0.0, 3.0))
    tree, emission = _lamp_of_nodes("Sum")
    both = node_of(tree, "AddShader")
    mixed = node_of(tree, "MixShader", Fac=0.25)
    fill(tree, mixed, {1: node_of(tree, "Emission", Strength=2.0), 2: node_of(tree, "BsdfDiffuse")})
    fill(tree, both, {0: emission, 1: mixed})
    fill(tree, tree.nodes["Light Output"], {"Surface": both})
    tree, _ = _lamp_of_nodes("Dark")
    fill(tree, tree.nodes["Light Output"], {"Surface": node_of(tree, "BsdfDiffuse")})


def _lamp_of_nodes(name):
    """A point lamp of 10 W; the tree of its nodes, and the emission in it."""
    data = light("POINT", name, (0.0, 0.0, 3.0), 10.0, shadow_soft_size=0.0).data
    data.use_nodes = True
    emission = data.node_tree.nodes["Emission"]
    fill(data.node_tree, emission, {"Color": (1.0, 0.5, 0.5, 1.0), "Strength": 5.0})
    return data.node_tree, emission


def near_lamps(_folder):
    """Lamps of soft falloff, on by default, near a floor and not, a narrow sun, and a camera with shear."""
    eye = new_file().camera
    eye.parent = rig = add("Rig", None)
    rig.scale, eye.rotation_euler.z = (1.5, 1.0, 1.0), 0.7
    plane("Floor", (0.0, 0.0, 0.0), 20.0, principled("floor"))
    light("SUN", "Narrow", (0.0, 0.0, 5.0), 1.0, angle=1e-3)
    light("POINT", "Near", (0.0, 0.0, 0.5), 10.0, shadow_soft_size=0.25)
    light("POINT", "Hard", (1.0, 0.0, 0.5), 10.0, shadow_soft_size=0.25, use_soft_falloff=False)
    light("POINT", "Far", (2.0, 0.0, 1.0), 10.0, shadow_soft_size=0.25)
    for name, z in (("Down", 0.0), ("Up", 1.0)):
        light("SPOT", name, (3.0, 0.0, 0.5), 10.0, (3.0, 0.0, z), shadow_soft_size=0.25)


def painted(_folder):
    """Colour attributes: one by its alpha, and two in one material."""
    new_file()
    alpha, tree, bsdf = shader("alpha", "BsdfPrincipled", Roughness=1.0)
    red = node_of(tree, "VertexColor")
    red.layer_name = "Red"
    fill(tree, bsdf, {"Base Color": red, "Alpha": red.outputs["Alpha"]})
    both, tree, mix = shader("both", "MixShader")
    fill(tree, mix, {0: 0.5})
    for number, name in enumerate(("Red", "Green"), start=1):
        paint = node_of(tree, "VertexColor")
        paint.layer_name = name
        fill(tree, mix, {number: node_of(tree, "BsdfDiffuse", Color=paint)})
    for number, material in enumerate((alpha, both)):
        data = plane(material.name, (2.0 * number, 0.0, 0.0), 1.5, material).data
        for name, colour in (("Red", (0.8, 0.1, 0.1, 0.25)), ("Green", (0.1, 0.6, 0.1, 1.0))):
            for corner in data.color_attributes.new(name, "FLOAT_COLOR", "CORNER").data:
                corner.color = colour


def painted_lamps(_folder):
    """Spheres that shine by a colour attribute, one of them five times as bright, over a floor."""
    new_file()
    plane("Floor", (0.0, 0.0, 0.0), 4.0, shader("floor", "BsdfDiffuse", Color=(0.5, 0.5, 0.5, 1))[0])
    for x, strength in ((-0.6, 1.0), (0.6, 5.0)):
        glow, tree, emission = shader(f"glow {strength}", "Emission", Strength=strength)
        fill(tree, emission, {"Color": node_of(tree, "VertexColor")})
        data = sphere(glow.name, (x, 0.0, 0.8), 0.4, glow).data
        paint = data.color_attributes.new("Paint", "FLOAT_COLOR", "POINT")
        for vertex, colour in zip(data.vertices, paint.data, strict=True):
            colour.color = (*(0.3 + 0.25 * np.sin(10.0 * np.array(vertex.co))), 1.0)


def attributes(_folder):
    """A number of vertices and a vector of faces as colours, and a truth value of corners times 0.3.

    Then an attribute of Blender's own, of which nodes in a group make a colour: the number of the slot.
    """
    new_file()
    _slots()
    kinds = [
        ("Wear", "FLOAT", "POINT", 0.25),
        ("Side", "FLOAT_VECTOR", "FACE", (0.2, 0.4, 0.6)),
        ("On", "BOOLEAN", "CORNER", True),
    ]
    for number, (name, kind, domain, value) in enumerate(kinds):
        material, tree, bsdf = shader(name, "BsdfDiffuse")
        read = node_of(tree, "Attribute")
        read.attribute_name = name
        if name == "On":
            source, read = read, node_of(tree, "VectorMath")
            read.operation = "MULTIPLY"
            fill(tree, read, {0: source, 1: (0.3, 0.3, 0.3)})
        fill(tree, bsdf, {"Color": read})
        data = plane(name, (2.0 * number, 0.0, 0.0), 1.5, material).data
        for item in data.attributes.new(name, kind, domain).data:
            setattr(item, "vector" if kind == "FLOAT_VECTOR" else "value", value)


def _slots():
    group = bpy.data.node_groups.new("of slots", "ShaderNodeTree")
    group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    read, scaled = node_of(group, "Attribute"), node_of(group, "VectorMath")
    read.attribute_name, scaled.operation = "material_index", "MULTIPLY"
    fill(group, scaled, {0: read, 1: (0.3, 0.6, 0.0)})
    fill(group, group.nodes.new("NodeGroupOutput"), {0: scaled})
    material, tree, bsdf = shader("slots", "BsdfDiffuse")
    node = node_of(tree, "Group")
    node.node_tree = group
    fill(tree, bsdf, {"Color": node})
    board = plane("Slots", (-2.0, 0.0, 0.0), 1.5, principled("unused"))
    board.data.materials.append(material)
    board.data.polygons[0].material_index = 1


def numbers(_folder):
    """Factors of a colour attribute, of a vector, and of a vector out of a group."""
    new_file()
    group = bpy.data.node_groups.new("vector", "ShaderNodeTree")
    group.interface.new_socket("Vector", in_out="OUTPUT", socket_type="NodeSocketVector")
    fill(group, group.nodes.new("NodeGroupOutput"), {0: node_of(group, "CombineXYZ", X=0.9, Z=0.6)})
    for number, (name, kind, inputs) in enumerate(
        (
            ("colour", "VertexColor", {}),
            ("vector", "CombineXYZ", {"X": 0.9, "Z": 0.9}),
            ("grouped", "Group", {}),
        )
    ):
        material, tree, mix = shader(name, "MixShader")
        factor = node_of(tree, kind, **inputs)
        if kind == "Group":
            factor.node_tree = group
        fill(tree, mix, {0: factor, 1: node_of(tree, "BsdfDiffuse"), 2: node_of(tree, "BsdfTranslucent")})
        data = plane(name, (2.0 * number, 0.0, 0.0), 1.5, material).data
        for corner in data.color_attributes.new("Paint", "FLOAT_COLOR", "CORNER").data:
            corner.color = (0.9, 0.3, 0.0, 1.0)


def heights(_folder):
    """Bumps and normals that 8 bits above 0 can't hold, and roughnesses: three times an image, and little."""
    new_file()
    coarse = image("coarse", _grey_ramp, 64, space="Non-Color")
    fine = image("fine", _grey_ramp, 64, space="Non-Color", is_float=True)
    _displaced(coarse)
    names = "below 0", "low", "as it is", "beside noise", "normals", "rough", "polished"
    for number, name in enumerate(names):
        material, tree, bsdf = shader(name, "BsdfPrincipled", Metallic=1.0, Roughness=0.5)
        height = picture(tree, fine if name == "as it is" else coarse)
        if name in ("below 0", "low", "rough", "polished"):
            height, source = node_of(tree, "Math"), height
            height.operation = "SUBTRACT" if name == "below 0" else "MULTIPLY"
            factor = {"below 0": 0.5, "low": 0.004, "rough": 3.0, "polished": 0.2}[name]
            fill(tree, height, {0: source, 1: factor})
        if name == "beside noise":
            fill(tree, bsdf, {"Base Color": node_of(tree, "TexNoise")})
        if name == "normals":
            height = node_of(tree, "TexNoise", Scale=1.0)
        bumps = node_of(tree, "Bump", Height=height, Distance=0.3)
        fill(tree, bsdf, {"Roughness": height} if name in ("rough", "polished") else {"Normal": bumps})
        plane(name, (2.0 * number, 0.0, 0.0), 1.5, material)


def _displaced(heights):
    """Displacement nodes: as bumps, as bumps and moved, moved alone, and beside bumps of the shader."""
    kinds = {"bumps": "BUMP", "moved and bumps": "BOTH", "moved": "DISPLACEMENT", "own bumps": "BUMP"}
    for number, (name, method) in enumerate(kinds.items()):
        material, tree, bsdf = shader(name, "BsdfPrincipled")
        material.displacement_method = method
        if name == "own bumps":
            fill(tree, bsdf, {"Normal": node_of(tree, "Bump", Height=heights)})
        relief = node_of(tree, "Displacement", Height=heights, Scale=0.3)
        fill(tree, tree.nodes["Material Output"], {"Displacement": relief})
        plane(name, (2.0 * number, 2.0, 0.0), 1.5, material)


def copies_in_the_world(_folder):
    """Copies of a plane that have their place in the world as colour: few, and many."""
    new_file()
    material, tree, bsdf = shader("place", "BsdfDiffuse")
    fill(tree, bsdf, {"Color": node_of(tree, "NewGeometry").outputs["Position"]})
    for name, places in (("few", [(0.2, 0.2, 0.0), (0.8, 0.6, 0.0)]), ("many", [(0.1, 0.1, -1.0)] * 65)):
        data = bpy.data.meshes.new(name)
        data.from_pydata(places, [], [])
        points = add(name, data)
        points.instance_type = "VERTS"
        points.show_instancer_for_render = False
        copied = plane(f"{name} copied", (0.0, 0.0, 0.0), 0.2, material)
        copied.parent = points


def linked_duplicates(_folder):
    """18 objects of a mesh of half a million triangles, one of another material; 17 of colours by Random."""
    new_file()
    paint, other = principled("paint"), principled("other", (0.1, 0.2, 0.3, 1.0))
    by_object, tree, bsdf = shader("by object", "BsdfDiffuse")
    fill(tree, bsdf, {"Color": node_of(tree, "ObjectInfo").outputs["Random"]})
    for x, size, material in ((0.0, 500, paint), (2.0, 125, by_object)):
        bpy.ops.mesh.primitive_grid_add(
            x_subdivisions=size, y_subdivisions=size, size=1.0, location=(x, 0.0, 0.0)
        )
        first = finish(material.name, material)
        for number in range(1, 17):
            add(f"{material.name} {number}", first.data, (x, 2.0 * number, 0.0))
    slot = add("other", bpy.data.objects["paint"].data, (-2.0, 0.0, 0.0)).material_slots[0]
    slot.link, slot.material = "OBJECT", other


def of_view(_folder):
    """Bumps of window coordinates, wires as wide as pixels, and light as a colour."""
    new_file()
    bumps, tree, diffuse = shader("bumps", "BsdfDiffuse")
    noise = node_of(tree, "TexNoise", Vector=node_of(tree, "TexCoord").outputs["Window"])
    fill(tree, diffuse, {"Normal": node_of(tree, "Bump", Height=noise)})
    wires, tree, diffuse = shader("wires", "BsdfDiffuse")
    wire = node_of(tree, "Wireframe")
    wire.use_pixel_size = True
    fill(tree, diffuse, {"Color": wire})
    toon, tree, diffuse = shader("toon", "BsdfDiffuse", Color=(0.7, 0.2, 0.1, 1.0))
    fill(tree, diffuse, {"Color": node_of(tree, "ShaderToRGB", Shader=node_of(tree, "BsdfAnisotropic"))})
    for number, material in enumerate((bumps, wires, toon)):
        plane(material.name, (2.0 * number, 0.0, 0.0), 1.5, material)


def left_out(folder):
    """Settings that are easily overlooked, and a tinted coat with normals of its own over a bumpy base."""
    scene = new_file()
    lamp = light("AREA", "No gloss", (0.0, 2.0, 3.0), 10.0)
    lamp.visible_glossy, lamp.data.cycles.max_bounces = False, 0
    light("POINT", "Dimmer", (2.0, 2.0, 3.0), -5.0)
    hole, tree, emission = shader("hole", "Emission")
    value = node_of(tree, "Value")
    value.outputs[0].default_value = -2.0  # a strength that is not linked is 0 at least
    fill(tree, emission, {"Strength": value})
    plane("Hole", (0.0, 4.0, 0.0), 1.0, hole)
    plane("Broken", (5.0, 4.0, 0.0), 1.0, principled("broken", (math.nan, 0.5, 0.5, 1.0)))
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.render.use_border = scene.render.use_multiview = scene.cycles.use_fast_gi = True
    scene.view_layers.new("Second")
    scene.view_layers[0].material_override = principled("clay")
    coat = {"Coat_Weight": 1.0, "Coat_Tint": (1.0, 0.1, 0.1, 1.0)}
    material = principled("coated", Roughness=0.8, **coat)
    tree, tilted = material.node_tree, image("tilt", _grey, 16, space="Non-Color")
    normals = {name: node_of(tree, "NormalMap", Color=tilted) for name in ("Normal", "Coat Normal")}
    fill(tree, tree.nodes["Principled BSDF"], normals)
    coated = plane("Coated", (0.0, 0.0, 0.0), 4.0, material)

    _seen_and_counted()

    # A camera that clips, and what follows the render.
    scene.camera.data.clip_start = 5.0
    bpy.data.collections.new("Seen in mirrors").objects.link(coated)
    scene.collection.objects.unlink(coated)
    scene.collection.children.link(bpy.data.collections["Seen in mirrors"])
    for layer in scene.view_layers:
        layer.layer_collection.children["Seen in mirrors"].indirect_only = True
    scene.render.use_freestyle = True
    metal, _, bsdf = shader("metal", "BsdfMetallic", Anisotropy=0.5)
    bsdf.fresnel_type = "PHYSICAL_CONDUCTOR"
    plane("Metal", (5.0, 0.0, 0.0), 1.0, metal)
    sky = world((0.5, 0.5, 0.5)).node_tree
    ray = sky.nodes.new("ShaderNodeLightPath").outputs["Is Camera Ray"]
    fill(sky, sky.nodes["Background"], {"Strength": node_of(sky, "Math", Value=ray)})
    editor = scene.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences  # before Blender 4.4
    # From Blender 5 on the end is a length.
    last = {"length": 2} if bpy.app.version >= (5, 0, 0) else {"frame_end": 3}
    strips.new_effect(name="White", type="COLOR", channel=1, frame_start=1, **last)
    scene.cycles.caustics_reflective, scene.cycles.sample_clamp_indirect = False, 2.0
    _torn()
    text = bpy.data.curves.new("Text", "FONT")
    lost = shutil.copy(
        next(Path(bpy.utils.system_resource("DATAFILES", path="fonts")).glob("DejaVu*")), folder
    )
    text.body, text.font = "a", bpy.data.fonts.load(lost)
    add("Text", text)
    return Path(lost).unlink


def _seen_and_counted():
    """A matcap, a colour of islands, glass of a colour attribute, and a solid shadow of a clear surface."""
    matcap, tree, diffuse = shader("matcap", "BsdfDiffuse")
    turned = node_of(tree, "VectorTransform", Vector=node_of(tree, "NewGeometry").outputs["Normal"])
    turned.convert_from, turned.convert_to = "WORLD", "CAMERA"
    fill(tree, diffuse, {"Color": turned})
    islands, tree, diffuse = shader("islands", "BsdfDiffuse")
    fill(tree, diffuse, {"Color": node_of(tree, "NewGeometry").outputs["Random Per Island"]})
    stained, tree, glass = shader("stained", "BsdfPrincipled", Transmission_Weight=1.0)
    fill(tree, glass, {"Base Color": node_of(tree, "VertexColor")})
    solid = principled("solid shadow", Alpha=0.5)
    solid.use_transparent_shadow = False
    for number, material in enumerate((matcap, islands, solid)):
        plane(material.name, (-5.0, 2.0 * number, 0.0), 1.0, material)
    cube("stained", (-5.0, 6.0, 0.0), 1.0, stained)


def _torn():
    """A smooth roof of three triangles, one of which has a vertex nowhere; that of its ridge is shared."""
    data = bpy.data.meshes.new("Torn")
    ridge, eaves = [(0.0, -1.0, 1.0), (0.0, 1.0, 1.0)], [(-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)]
    data.from_pydata([*ridge, *eaves, (math.nan, 0.0, 0.0)], [], [(0, 1, 2), (1, 0, 3), (0, 3, 4)])
    data.materials.append(principled("roof", (0.5, 0.2, 0.1, 1)))
    data.shade_smooth()
    add("Torn", data)


def without_light(_folder):
    """A world that takes light away; lamps and a cube with numbers that are NaN, infinite or an area of 0."""
    new_file()
    tree = world((1.0, 1.0, 1.0)).node_tree
    value = node_of(tree, "Value")
    value.outputs[0].default_value = -0.5  # a strength that is not linked is 0 at least
    fill(tree, tree.nodes["Background"], {"Strength": value})
    paint = principled("paint")
    plane("Floor", (0.0, 0.0, 0.0), 4.0, paint)
    cube("Nowhere", (math.nan, 0.0, 0.0), 1.0, paint)
    light("POINT", "NaN", (0.0, 0.0, 2.0), math.nan)
    light("SUN", "Infinite", (0.0, 0.0, 2.0), math.inf, angle=0.1)
    light("AREA", "Colour", (0.0, 0.0, 2.0), 1.0, color=(1.0, math.nan, 1.0))
    light("AREA", "Size", (0.0, 0.0, 2.0), 1.0, size=math.nan)
    light("AREA", "Line", (0.0, 0.0, 2.0), 1.0, shape="RECTANGLE", size_y=0.0)
    light("AREA", "Small", (0.0, 0.0, 2.0), 1.0).scale = 0.0, 0.0, 0.0
    cube("Collapsed", (1.0, 0.0, 0.0), 1.0, shader("glow", "Emission")[0]).scale = 0.0, 0.0, 0.0


def nothing(_folder):
    """A scene without any object."""
    camera = new_file().camera
    bpy.data.objects.remove(camera)


def frozen(folder):
    """What changes from frame to frame, by other ways than the keyframes of a pose."""
    scene = new_file()
    scene.frame_start, scene.frame_end = 1, 8
    _changed_by_others(scene)
    blinking = plane("Blinking", (0.0, 0.0, 0.0), 1.0, principled("grey"))
    for frame in (1, 3):
        blinking.hide_render = frame == 3
        blinking.keyframe_insert("hide_render", frame=frame)
    driven = principled("driven")
    roughness = driven.node_tree.nodes["Principled BSDF"].inputs["Roughness"]
    roughness.driver_add("default_value").driver.expression = "frame / 10"
    by_script = plane("Driven", (2.0, 0.0, 0.0), 1.0, driven).driver_add("location", 0).driver
    by_script.expression = "bpy.data.scenes[0].frame_current * 0.1"
    film = image("film", tiles, 16)
    film.filepath_raw, film.file_format = str(folder / "film0001.png"), "PNG"
    film.save()
    film.source = "SEQUENCE"
    plane("Screen", (4.0, 0.0, 0.0), 1.0, principled("screen", film))
    scene.camera.parent = add("Dolly", None)
    hooked = plane("Hooked", (0.0, 2.0, 0.0), 1.0, bpy.data.materials["grey"])
    hooked.modifiers.new("Hook", "HOOK").object = handle = add("Handle", None)
    for carrier in (scene.camera.parent, handle):
        for frame in (1, 5):
            carrier.location.x = 0.1 * frame
            carrier.keyframe_insert("location", frame=frame)
    sliding, tree, bsdf = shader("sliding", "BsdfDiffuse")
    place = node_of(tree, "TexCoord")
    place.object = handle
    fill(tree, bsdf, {"Color": place.outputs["Object"]})
    plane("Sliding", (6.0, 0.0, 0.0), 1.0, sliding)
    lamp = light("POINT", "Growing", (0.0, 0.0, 3.0), 10.0).data
    for frame, radius in ((1, 0.1), (5, 0.5)):
        lamp.shadow_soft_size = radius
        lamp.keyframe_insert("shadow_soft_size", frame=frame)


def _changed_by_others(scene):
    """Shapes that modifiers and data change, copies that move; a brief motion, and none that renders show."""
    grey = principled("still")
    swelling = plane("Swelling", (0.0, 4.0, 0.0), 1.0, grey).modifiers.new("Displace", "DISPLACE")
    vine = bpy.data.curves.new("Vine", "CURVE")
    vine.splines.new("POLY").points.add(3)
    for x, point in enumerate(vine.splines[0].points):
        point.co.x = x
    add("Vine", vine, (2.0, 4.0, 0.0))
    for data, name, last in ((swelling, "strength", 1.0), (vine, "bevel_depth", 0.2)):
        for frame, value in ((1, 0.1), (8, last)):
            setattr(data, name, value)
            data.keyframe_insert(name, frame=frame)
    door, inner, of_set, cutter = (
        plane(name, (x, 6.0, 0.0), 1.0, grey)
        for x, name in enumerate(("Door", "Inner", "Of the set", "Cutter"))
    )
    scene.collection.children.link(group("Cutters", [cutter]))
    bpy.data.collections["Cutters"].hide_render = True
    plane("Cut", (4.0, 8.0, 0.0), 1.0, grey).modifiers.new("Boolean", "BOOLEAN").object = cutter
    emitter = plane("Emitter", (6.0, 6.0, 0.0), 1.0, grey)
    emitter.modifiers.new("Particles", "PARTICLE_SYSTEM")
    bald = plane("Bald", (8.0, 6.0, 0.0), 1.0, grey).modifiers.new("Hair", "PARTICLE_SYSTEM")
    bald.particle_system.settings.type, bald.show_render = "HAIR", False
    falling = emitter.particle_systems[0].settings
    falling.count, falling.frame_end, falling.render_type = 5, 8, "OBJECT"
    falling.instance_object = cube("Drop", (4.0, 6.0, 0.0), 0.1, grey)
    for obj in (door, inner, of_set, cutter):
        for frame, turn in ((2, 0.0), (3, 1.0), (4, 0.0)):
            obj.rotation_euler.z = turn
            obj.keyframe_insert("rotation_euler", frame=frame)
    instance("Copy", group("Inside", [inner]), (0.0, 8.0, 0.0), 0.0)
    scene.background_set = bpy.data.scenes.new("Set")
    scene.background_set.collection.objects.link(of_set)
    scene.collection.objects.unlink(of_set)
    rig = add("Rig", bpy.data.armatures.new("Rig"))
    plane("Skin", (2.0, 8.0, 0.0), 1.0, grey).modifiers.new("Armature", "ARMATURE").object = rig
    for frame, exposure in ((1, 0.0), (8, 1.0)):
        scene.view_settings.exposure = exposure
        scene.view_settings.keyframe_insert("exposure", frame=frame)


def simplified(_folder):
    """A subdivision that Simplify lowers, below an image on normalized coordinates; more that is not seen."""
    scene = new_file()
    scene.render.use_simplify, scene.render.simplify_subdivision_render = True, 1
    material = principled("normalized", image("tiles", tiles, 16))
    tree = material.node_tree
    mapped = node_of(tree, "Mapping", Vector=node_of(tree, "TexCoord").outputs["UV"])
    mapped.vector_type = "NORMAL"
    fill(tree, tree.nodes["Image Texture"], {"Vector": mapped})
    level = plane("Soft", (0.0, 0.0, 0.0), 4.0, material).modifiers.new("Subdivision", "SUBSURF")
    level.render_levels = 10
    plain = principled("plain")
    unseen = [plane(name, (0.0, 0.0, 0.0), 1.0, plain) for name in ("Excluded", "Unseen", "Bare")]
    for obj in unseen[:2]:
        obj.modifiers.new("Array", "ARRAY").count = 3_000_000
        obj.modifiers["Array"].show_viewport = False
        scene.collection.children.link(group(obj.name, [obj]))
    scene.view_layers[0].layer_collection.children["Excluded"].exclude = True
    bpy.data.collections["Unseen"].hide_render = True
    particles = unseen[2].modifiers.new("Particles", "PARTICLE_SYSTEM")
    particles.show_render = particles.show_viewport = False
    settings = particles.particle_system.settings
    settings.count, settings.render_type, settings.instance_object = 2_000_000, "OBJECT", unseen[0]


def leaves(folder):
    """Three cards, clear but for an edge, over a floor in even light."""
    scene = new_file()
    world((1.0, 1.0, 1.0))
    scene.camera.location, scene.camera.rotation_euler = (0.05, 0.05, 5.0), (0.0, 0.0, 0.0)
    scene.camera.data.lens = 200.0
    plane("Floor", (0.0, 0.0, 0.0), 4.0, shader("floor", "BsdfDiffuse", Color=(0.5, 0.5, 0.5, 1))[0])
    edge = image("edge", _grey, 16, alpha=lambda x, _y: np.where(x < 0.05, 1.0, 0.0))
    leaf, tree, bsdf = shader("leaf", "BsdfPrincipled", Roughness=1.0)
    fill(tree, bsdf, {"Alpha": picture(tree, edge).outputs["Alpha"]})
    for number in range(3):
        plane(f"Leaf {number}", (0.0, 0.0, 0.3 + 0.2 * number), 3.0, leaf)


def masked_light(_folder):
    """Signs of which a fourth shines: by their opacity, mixes, a strength; and lamps that no camera sees.

    The camera looks down through one of the lamps. Factors above 1 and nested ones are clipped.
    """
    scene = new_file()
    scene.camera.location, scene.camera.rotation_euler = (0.0, 0.0, 12.0), (0.0, 0.0, 0.0)

    def stripe(x, _y):
        return np.where(x < 0.25, 1.0, 0.0)

    mask = image("mask", lambda x, y: np.repeat(stripe(x, y)[..., None], 3, -1), 64, space="Non-Color")
    sign = image("sign", tiles, 64, alpha=stripe)
    cut, tree, bsdf = shader("cut", "BsdfPrincipled", Base_Color=(0, 0, 0, 1), Emission_Strength=2.0)
    texture = picture(tree, sign)
    fill(tree, bsdf, {"Emission Color": texture, "Alpha": texture.outputs["Alpha"]})
    mixed, tree, mix = shader("mixed", "MixShader")
    glow = node_of(tree, "Emission", Color=(1.0, 0.5, 0.2, 1.0), Strength=3.0)
    fill(tree, mix, {0: mask, 1: node_of(tree, "BsdfDiffuse", Color=(0, 0, 0, 1)), 2: glow})
    strip, tree, glow = shader("strip", "Emission", Color=(0.2, 0.5, 1.0, 1.0))
    fill(tree, glow, {"Strength": mask})
    two, tree, mix = shader("two", "MixShader")
    red, blue = (node_of(tree, "Emission", Color=c, Strength=0.01) for c in ((1, 0, 0, 1), (0, 0, 1, 1)))
    fill(tree, mix, {0: mask, 1: red, 2: blue})
    nested, tree, mix = shader("nested", "MixShader")
    factor = node_of(tree, "Math")
    factor.operation = "MULTIPLY"
    fill(tree, factor, {0: mask, 1: 5.0})
    inner = node_of(tree, "MixShader")
    black, glow = node_of(tree, "BsdfDiffuse", Color=(0, 0, 0, 1)), node_of(tree, "Emission", Strength=0.5)
    fill(tree, inner, {0: factor, 1: glow, 2: black})
    fill(tree, mix, {0: factor, 1: inner, 2: black})
    for number, material in enumerate((cut, mixed, strip)):
        plane(material.name, (2.0 * number - 3.0, 0.0, 0.0), 1.8, material)
    for number, material in enumerate((two, nested)):
        plane(material.name, (2.0 * number - 3.0, 2.0, 0.0), 1.8, material)
    plane("lit", (3.0, 0.0, 0.0), 1.8, shader("lit", "BsdfDiffuse", Color=(0.5, 0.5, 0.5, 1))[0])
    panel = plane("Panel", (0.0, 0.0, 6.0), 4.0, shader("panel", "Emission", Strength=5.0)[0])
    bpy.ops.mesh.primitive_cylinder_add(
        radius=1.0, depth=2.0, end_fill_type="NOTHING", location=(9.0, 0.0, 3.0)
    )
    tube = bpy.context.object
    tube.data.materials.append(shader("tube", "Emission", Strength=5.0)[0])
    panel.visible_camera = tube.visible_camera = False


def lamps_in_the_way(folder):
    """A window's area light, and a card with holes, between a floor and a sun, a spot and a panel."""
    scene = new_file()
    scene.camera.location, scene.camera.rotation_euler = (0.0, 0.0, 3.0), (0.0, 0.0, 0.0)
    plane("Floor", (0.0, 0.0, 0.0), 6.0, shader("floor", "BsdfDiffuse", Color=(0.5, 0.5, 0.5, 1))[0])
    light("AREA", "Window", (0.0, 0.0, 3.5), 10.0, size=3.0)
    light("AREA", "Panel", (0.5, 0.0, 4.5), 40.0, size=1.0)
    light("SUN", "Sun", (1.0, 0.0, 8.0), 2.0, angle=0.02)
    light("SPOT", "Spot", (-0.5, 0.0, 5.0), 300.0, spot_size=1.0, shadow_soft_size=0.0)
    holes = image("holes", _grey, 16, alpha=lambda x, y: ((16 * x).astype(int) + (16 * y).astype(int)) % 2)
    card, tree, bsdf = shader("card", "BsdfPrincipled", Roughness=1.0)
    fill(tree, bsdf, {"Alpha": picture(tree, holes).outputs["Alpha"]})
    plane("Card", (0.0, 0.0, 3.2), 2.0, card)


def panes(folder):
    """Two panes that shadow rays pass, a box and a layer over Transparent, between a floor and a sun."""
    scene = new_file()
    scene.cycles.caustics_refractive = False  # else light passes the box twice: by shadow rays, and refracted
    world((0.2, 0.2, 0.2))
    scene.camera.location, scene.camera.rotation_euler = (0.0, 0.0, 1.5), (0.0, 0.0, 0.0)
    plane("Floor", (0.0, 0.0, 0.0), 6.0, shader("floor", "BsdfDiffuse", Color=(0.5, 0.5, 0.5, 1))[0])
    light("SUN", "Sun", (0.5, 0.0, 8.0), 3.0, angle=0.0)
    window, tree, mix = shader("window", "MixShader")
    ray = node_of(tree, "LightPath").outputs["Is Shadow Ray"]
    glass = node_of(tree, "BsdfPrincipled", Base_Color=(1, 1, 1, 1), Transmission_Weight=1.0, Roughness=0.0)
    fill(tree, mix, {0: ray, 1: glass, 2: node_of(tree, "BsdfTransparent")})
    box("Window", (0.0, 0.0, 2.5), (4.0, 4.0, 0.02), window)
    layer, tree, mix = shader("layer", "MixShader")
    gloss = node_of(tree, "BsdfGlossy", Roughness=0.0)
    fill(
        tree,
        mix,
        {0: node_of(tree, "Fresnel", IOR=1.5).outputs[0], 1: node_of(tree, "BsdfTransparent"), 2: gloss},
    )
    plane("Layer", (0.0, 0.0, 3.0), 4.0, layer)


def kinds_of_panes(folder):
    """Glass that shadow rays pass: tinted, thick, below a layer, with light of its own, and the reverse."""
    new_file()
    half = {"Base_Color": (0.25, 0.25, 0.25, 1), "Transmission_Weight": 1.0, "Roughness": 0.02}

    def window(name, glass, *, is_swapped=False):
        material, tree, mix = shader(name, "MixShader")
        seen, clear = glass(tree), node_of(tree, "BsdfTransparent")
        most = node_of(tree, "Math")
        most.operation = "MAXIMUM"
        path = node_of(tree, "LightPath").outputs
        fill(tree, most, {0: path["Is Shadow Ray"], 1: path["Is Diffuse Ray"]})
        fill(tree, mix, {0: most, 1: clear if is_swapped else seen, 2: seen if is_swapped else clear})
        return material

    def layered(tree):
        mix, glass = node_of(tree, "MixShader"), node_of(tree, "BsdfGlass", Roughness=0.0, IOR=1.5)
        fill(tree, mix, {0: node_of(tree, "Fresnel", IOR=1.5), 1: glass, 2: node_of(tree, "BsdfGlossy")})
        return mix

    tinted = window("tinted", lambda tree: node_of(tree, "BsdfPrincipled", **half))
    box("Pane", (0.0, 0.0, 0.0), (1.0, 1.0, 0.01), tinted)
    sphere("Ball", (2.0, 0.0, 0.0), 0.5, tinted)
    lit = window("lit", lambda tree: node_of(tree, "BsdfPrincipled", **half, Emission_Strength=1.0))
    swapped = window("swapped", lambda tree: node_of(tree, "BsdfGlass", Roughness=0.0), is_swapped=True)
    for number, material in enumerate((window("layered", layered), lit, swapped)):
        box(material.name, (2.0 * number, 2.0, 0.0), (1.5, 1.5, 0.01), material)


def left_in_edit_mode(_folder):
    """Two objects, one of them with a modifier, in a file that is saved in Edit Mode."""
    new_file()
    plane("Plain", (0.0, 0.0, 0.0), 1.0, None)
    cube("Rounded", (2.0, 0.0, 0.0), 1.0, None).modifiers.new("Bevel", "BEVEL")
    for name in ("Plain", "Rounded"):
        bpy.data.objects[name].select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")


def sheets_of_glass(folder):
    """Glass without a back between the camera and even light, from both sides; a ball of the same glass."""
    scene = new_file()
    scene.camera.location, scene.camera.rotation_euler = (0.0, 0.0, 6.0), (0.0, 0.0, 0.0)
    world((0.5, 0.5, 0.5))
    clear = shader("clear", "BsdfGlass", Roughness=0.0, IOR=1.5)[0]
    frosted = principled("frosted", (1, 1, 1, 1), Transmission_Weight=1.0, Roughness=0.4, IOR=1.5)
    for y, material in ((1.0, clear), (-1.0, frosted)):
        for x, turn in ((-2.0, 0.0), (0.0, math.pi)):
            sheet = plane(f"{material.name} {x:.0f}", (x, y, 0.0), 1.5, material)
            sheet.rotation_euler = (turn, 0.0, 0.0)
    sphere("Ball", (2.0, 1.0, 0.0), 0.7, clear)


def _grey(x, _y):
    return np.full((*x.shape, 3), 0.8)


def _grey_ramp(x, _y):
    return np.repeat(x[..., None], 3, -1)


def _green(x, _y):
    return np.stack([0.0 * x, 0.2 + 0.6 * (x > 0.5), 0.0 * x], axis=-1)


def _cut_out(half):
    """The opacity is 1 minus a corrected image, which is baked."""
    material, tree, mix = shader("cut out", "MixShader")
    paint, clear = node_of(tree, "BsdfDiffuse"), node_of(tree, "BsdfTransparent")
    fill(tree, mix, {0: node_of(tree, "Gamma", Color=half, Gamma=2.0), 1: paint, 2: clear})
    return material


def _see_through(_half):
    return shader("see-through", "BsdfTransparent", Color=(0.2, 0.5, 0.9, 1))[0]


def _sheer_gloss(_half):
    material, tree, total = shader("sheer gloss", "AddShader")
    fill(tree, total, {0: node_of(tree, "BsdfTransparent"), 1: node_of(tree, "BsdfAnisotropic")})
    return material


def _bumpy_plastic(half):
    material, tree, mix = shader("bumpy plastic", "MixShader")
    matt = node_of(tree, "BsdfDiffuse", Normal=node_of(tree, "Bump", Height=half))
    gloss = node_of(tree, "BsdfAnisotropic", Color=(1.0, 0.5, 0.5, 1), Roughness=0.2)
    fill(tree, mix, {0: node_of(tree, "Fresnel", IOR=1.5), 1: matt, 2: gloss})
    return material


def _bright(_half):
    """Colours of 0 to 2."""
    material, tree, bsdf = shader("bright", "BsdfDiffuse")
    checker = node_of(tree, "TexChecker", Color1=(0.5, 0.5, 0.5, 1), Color2=(2, 2, 2, 1))
    fill(tree, bsdf, {"Color": checker})
    return material


def _pixelated(half):
    """A rough plastic, whose colours are scaled, with an image without interpolation or repetition."""
    material = principled("pixelated", half, Roughness=0.5)
    texture = material.node_tree.nodes["Image Texture"]
    texture.interpolation, texture.extension = "Closest", "CLIP"
    return material


def _decal(half):
    """An image over the middle quarter of the square, and nothing around it."""
    material, tree, bsdf = shader("decal", "BsdfPrincipled")
    over = node_of(tree, "TexCoord").outputs["UV"]
    scaled = node_of(tree, "Mapping", Vector=over, Location=(-0.5, -0.5, 0.0), Scale=(2.0, 2.0, 1.0))
    texture = picture(tree, half)
    texture.extension = "CLIP"
    fill(tree, texture, {"Vector": scaled})
    fill(tree, bsdf, {"Base Color": texture, "Alpha": texture.outputs["Alpha"]})
    return material


def _scaled(half):
    """Coordinates times numbers of other nodes, which need no bake."""
    material, tree, bsdf = shader("scaled", "BsdfPrincipled")
    number, place = node_of(tree, "Value"), node_of(tree, "CombineXYZ", X=0.25)
    number.outputs[0].default_value = 3.0
    mapped = node_of(tree, "Mapping", Scale=number, Location=place)
    fill(tree, mapped, {"Vector": node_of(tree, "UVMap")})
    texture = picture(tree, half)
    fill(tree, texture, {"Vector": mapped})
    fill(tree, bsdf, {"Base Color": texture})
    return material
