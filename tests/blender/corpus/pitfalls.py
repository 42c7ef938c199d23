# SPDX-License-Identifier: GPL-3.0-or-later
"""A file whose data has other values than a first look at it tells, and one with nested libraries."""

import bpy
import numpy as np

from corpus.stage import (
    add,
    cube,
    fill,
    image,
    light,
    new_file,
    node_of,
    picture,
    plane,
    principled,
    save,
    shader,
    stage,
    tiles,
    world,
)  # fmt: skip


def pitfalls(folder):
    stage(lit=False)
    _world_of_two_engines()
    _copies_with_normals()
    _hidden_in_viewports()
    _material_of_two_engines()
    _attributes_of_geometry()
    _named_by_default()
    _image_of_another_kind(folder)
    _alpha_and_colours_against_the_file(folder)
    _tiled_and_corrected()
    _packed_channels()
    _duplicates_of_procedurals()
    _without_effect()
    _lost_in_files(folder)
    light("AREA", "Panel", (0.0, 2.9, 2.0), 50.0, target=(0.0, 0.0, 2.0)).visible_camera = True


def nested_libraries(folder):
    """A file that links a library in a folder, which links one in a folder below that."""
    rooms, assets = folder / "rooms", folder / "rooms" / "assets"
    assets.mkdir(parents=True, exist_ok=True)
    new_file()
    cube("Chair", (0.0, 0.0, 0.5), 0.5, principled("wood")).data.name = "chair"
    chair = save(assets, "chair")
    new_file()
    save(rooms, "room")  # paths can be relative to a file only
    add("Seat", _linked(chair, "meshes", "chair"))
    room = save(rooms, "room")
    stage()
    save(folder, "nested_libraries")
    bpy.context.scene.collection.objects.link(_linked(room, "objects", "Seat"))


def _linked(file, kind, name):
    with bpy.data.libraries.load(str(file), link=True, relative=True) as (_, wanted):
        setattr(wanted, kind, [name])
    return getattr(wanted, kind)[0]


def _world_of_two_engines():
    value = world((0.0, 0.3, 0.0))
    nodes = value.node_tree.nodes
    nodes["World Output"].target = "CYCLES"
    red, end = node_of(value.node_tree, "Background"), nodes.new("ShaderNodeOutputWorld")
    red.inputs[0].default_value = 1.0, 0.0, 0.0, 1.0
    end.target = "EEVEE"
    value.node_tree.links.new(red.outputs[0], end.inputs[0])
    nodes.active = end


def _copies_with_normals():
    """Copies of a mesh with a modifier and a normal map."""
    flat = image("flat", lambda x, _: np.full((*x.shape, 3), (0.5, 0.5, 1.0)), 16, space="Non-Color")
    mapped, tree, bsdf = shader("mapped", "BsdfPrincipled")
    fill(tree, bsdf, {"Normal": node_of(tree, "NormalMap", Color=flat)})
    stud = cube("Stud", (0.0, 0.0, 0.0), 0.1, mapped)
    stud.modifiers.new("smooth", "SUBSURF").render_levels = 1
    grid = plane("Grid", (0.0, -1.0, 0.2), 1.0, principled("grid"))
    stud.parent, grid.instance_type = grid, "VERTS"


def _hidden_in_viewports():
    """A lamp and a material with animated values, which viewports do not show."""
    lamp = light("POINT", "Hidden", (0.0, -2.0, 3.0), 10.0, shadow_soft_size=0.0)
    fading, _, bsdf = shader("fading", "BsdfDiffuse")
    box = cube("Fading", (2.0, 0.0, 0.25), 0.5, fading)
    for frame, energy, colour in ((1, 10.0, (1, 0, 0, 1)), (9, 90.0, (0, 0, 1, 1))):
        lamp.data.energy, bsdf.inputs["Color"].default_value = energy, colour
        lamp.data.keyframe_insert("energy", frame=frame)
        bsdf.inputs["Color"].keyframe_insert("default_value", frame=frame)
    lamp.hide_viewport = box.hide_viewport = True


def _material_of_two_engines():
    both, tree, _ = shader("both", "BsdfDiffuse", Color=(0.0, 1.0, 0.0, 1.0))
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    output.target = "CYCLES"
    red, end = node_of(tree, "BsdfDiffuse", Color=(1.0, 0.0, 0.0, 1.0)), node_of(tree, "OutputMaterial")
    tree.links.new(red.outputs[0], end.inputs["Surface"])
    tree.nodes.active = end
    cube("Both", (-2.0, 0.0, 0.25), 0.5, both)


def _attributes_of_geometry():
    """A UV map of points, and colours of faces, as geometry nodes store them."""
    wrapped, tree, bsdf = shader("wrapped", "BsdfDiffuse")
    where, texture = node_of(tree, "UVMap"), picture(tree, image("squares", tiles, 32))
    where.uv_map = "of points"
    tree.links.new(where.outputs["UV"], texture.inputs["Vector"])
    fill(tree, bsdf, {"Color": texture})
    board = plane("Wrapped", (-1.0, -2.0, 0.1), 0.5, wrapped)
    attribute = board.data.attributes.new("of points", "FLOAT2", "POINT")
    attribute.data.foreach_set("vector", [0.0, 0.0, 3.0, 0.0, 0.0, 3.0, 3.0, 3.0])
    tinted, tree, bsdf = shader("tinted", "BsdfDiffuse")
    read = node_of(tree, "Attribute")
    read.attribute_name = "of faces"
    fill(tree, bsdf, {"Color": read.outputs["Color"]})
    board = plane("Tinted", (0.0, -2.0, 0.1), 0.5, tinted)
    board.data.attributes.new("of faces", "FLOAT_COLOR", "FACE").data[0].color = 0.1, 0.2, 0.7, 1.0


def _named_by_default():
    """The render-active one of two colour attributes, by a node without a name, which is baked."""
    tinted, tree, bsdf = shader("unnamed", "BsdfDiffuse")
    fill(tree, bsdf, {"Color": node_of(tree, "Gamma", Color=node_of(tree, "VertexColor"), Gamma=1.0)})
    colours = plane("Unnamed", (1.0, -2.0, 0.1), 0.5, tinted).data.color_attributes
    for name, colour in (("first", (0.7, 0.1, 0.1, 1.0)), ("second", (0.1, 0.7, 0.1, 1.0))):
        colours.new(name, "FLOAT_COLOR", "CORNER").data.foreach_set("color", 4 * colour)
    colours.render_color_index = 1


def _tiled_and_corrected():
    """An image that is turned and repeated by its Mapping, below a colour correction."""
    tiled, tree, bsdf = shader("tiled", "BsdfDiffuse")
    place = node_of(tree, "TexCoord").outputs["UV"]
    mapped = node_of(tree, "Mapping", Vector=place, Scale=(8.0, 5.0, 1.0), Rotation=(0.0, 0.0, 0.5))
    texture = picture(tree, image("repeated", lambda x, y: np.stack([x > 0.5, y > 0.5, 0.0 * x], -1), 64))
    fill(tree, texture, {"Vector": mapped})
    fill(tree, bsdf, {"Color": node_of(tree, "Invert", Color=texture)})
    plane("Tiled", (-3.0, -2.0, 0.1), 0.5, tiled)


def _packed_channels():
    """Roughness and metal in two channels of one image."""
    packed, tree, bsdf = shader("packed", "BsdfPrincipled")
    layers = image("layers", lambda x, y: np.stack([0.0 * x, 0.3 + 0.6 * x, 1.0 * (y > 0.5)], -1), 16,
                   space="Non-Color")  # fmt: skip
    parts = node_of(tree, "SeparateColor", Color=layers)
    fill(tree, bsdf, {"Roughness": parts.outputs[1], "Metallic": parts.outputs[2]})
    plane("Packed", (-3.0, -3.0, 0.1), 0.5, packed)


def _duplicates_of_procedurals():
    """Two objects of one mesh, the second one much nearer to the camera."""
    wood, tree, bsdf = shader("wood", "BsdfDiffuse")
    place = node_of(tree, "TexCoord").outputs["Object"]
    fill(tree, bsdf, {"Color": node_of(tree, "TexNoise", Vector=place, Scale=9.0).outputs["Color"]})
    far = plane("Far", (0.0, 60.0, 0.1), 0.2, wood)
    add("Near", far.data, (0.3, -4.9, 1.9))


def _without_effect():
    """Patterns below weights of 0, and a colour of a muted node; a dim screen."""
    idle, tree, bsdf = shader("idle", "BsdfPrincipled", Emission_Strength=0.0, Coat_Weight=0.0)
    mix, glow = node_of(tree, "MixShader", Fac=0.0), node_of(tree, "Emission", Strength=0.0)
    both = node_of(tree, "AddShader")
    colour = node_of(tree, "RGB")
    colour.outputs[0].default_value, colour.mute = (1.0, 0.0, 0.0, 1.0), True
    bsdf.inputs["Base Color"].default_value = 0.1, 0.6, 0.2, 1.0
    noise = node_of(tree, "TexNoise").outputs["Color"]
    fill(tree, bsdf, {"Base Color": colour, "Emission Color": noise, "Coat Roughness": noise})
    fill(tree, glow, {"Color": noise})
    fill(tree, both, {0: bsdf, 1: glow})
    fill(tree, mix, {1: both, 2: node_of(tree, "BsdfDiffuse", Color=noise)})
    fill(tree, tree.nodes["Material Output"], {"Surface": mix})
    plane("Idle", (-2.0, -3.0, 0.1), 0.5, idle)
    ramp = image("ramp", lambda x, _: np.repeat(x[..., None], 3, -1), 16)
    plane("Dim", (-1.0, -3.0, 0.1), 0.5, shader("dim", "Emission", Color=ramp, Strength=0.5)[0])


def _lost_in_files(folder):
    """Coordinates of an instancer, and a file of several layers."""
    instanced, tree, bsdf = shader("instanced", "BsdfDiffuse")
    place = node_of(tree, "TexCoord")
    place.from_instancer = True
    fill(tree, bsdf, {"Color": place.outputs["Generated"]})
    plane("Instanced", (0.0, -3.0, 0.1), 0.5, instanced)
    render = bpy.data.scenes.new("layers").render
    render.engine, render.resolution_x, render.resolution_y = "CYCLES", 4, 4
    bpy.data.scenes["layers"].camera = bpy.context.scene.camera
    bpy.data.scenes["layers"].cycles.samples = 1
    if hasattr(render.image_settings, "media_type"):  # from Blender 5 on
        render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    render.filepath = str(folder / "layers.exr")
    bpy.ops.render.render(write_still=True, scene="layers")
    bpy.data.scenes.remove(bpy.data.scenes["layers"])
    layered = bpy.data.images.load(str(folder / "layers.exr"))
    plane("Layered", (1.0, -3.0, 0.1), 0.5, shader("layered", "BsdfDiffuse", Color=layered)[0])


def _image_of_another_kind(folder):
    """A WebP file whose name is that of a PNG file."""
    value = image("web", tiles, 32)
    value.file_format, value.filepath_raw = "WEBP", str(folder / "web.webp")
    value.save()
    (folder / "web.webp").rename(folder / "web.png")
    file = bpy.data.images.load(str(folder / "web.png"))
    cube("Web", (0.0, 1.5, 0.25), 0.5, shader("web", "BsdfDiffuse", Color=file)[0])


def _alpha_and_colours_against_the_file(folder):
    """Files of 0.5 and alpha 0.4, the PNG as premultiplied, and an EXR file of 0.5 that is read as sRGB."""
    premultiplied = {"alpha_mode": "PREMUL"}
    kinds = (
        ("png", "PNG", premultiplied),
        ("exr", "OPEN_EXR", {}),
        ("webp", "WEBP", {}),
        ("jp2", "JPEG2000", {}),
    )
    for place, (name, kind, settings) in enumerate(kinds, 1):
        value = bpy.data.images.new(name, 64, 64, alpha=kind != "OPEN_EXR", float_buffer=kind == "OPEN_EXR")
        value.colorspace_settings.name = "Non-Color"
        value.pixels = 64 * 64 * [0.5, 0.5, 0.5, 1.0 if kind == "OPEN_EXR" else 0.4]
        value.file_format, value.filepath_raw = kind, str(folder / f"contrary.{name}")
        value.save()
        bpy.data.images.remove(value)
        file = bpy.data.images.load(str(folder / f"contrary.{name}"))
        file.colorspace_settings.name = "sRGB"
        for key, mode in settings.items():
            setattr(file, key, mode)
        cube(f"Contrary {name}", (float(place), 1.5, 0.25), 0.5, shader(name, "BsdfDiffuse", Color=file)[0])
