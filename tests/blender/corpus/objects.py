# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of instances, modifiers, cameras, names and links."""

from pathlib import Path

import bpy

from corpus.stage import (
    add,
    aim,
    camera,
    cube,
    fill,
    finish,
    group,
    image,
    instance,
    new_file,
    node_of,
    plane,
    principled,
    save,
    scattering,
    shader,
    sphere,
    stage,
    three,
    tiles,
)

COLOURS = (0.7, 0.1, 0.1, 1), (0.1, 0.7, 0.1, 1), (0.1, 0.1, 0.7, 1)


def instances(folder):
    stage()
    brown = principled("chair", (0.7, 0.3, 0.1, 1), Roughness=0.5)
    chair = cube("Chair", (0.0, 0.0, 0.25), 0.5, brown)
    knob = sphere("Knob", (0.0, 0.0, 0.65), 0.15, principled("knob", Metallic=1.0, Roughness=0.2))
    chairs = group("Chairs", (chair, knob))
    for i in range(6):
        copy = instance(f"copy {i}", chairs, (-2.0 + 0.8 * i, -0.5 + 0.3 * (i % 2), 0.0), 0.4 * i)
        copy.scale = (1.0 if i % 2 else -0.7, 0.7, 0.7 + 0.1 * i)


def modifiers(folder):
    stage()
    three(*(principled(f"grey {i}", (0.6, 0.5, 0.4, 1), Roughness=0.4) for i in range(3)))
    soft = bpy.data.objects["Middle"]
    level = soft.modifiers.new("Subdivision", "SUBSURF")
    level.levels, level.render_levels = 0, 3
    row = bpy.data.objects["Left"].modifiers.new("Array", "ARRAY")
    row.count, row.relative_offset_displace = 2, (0.0, 1.1, 0.0)
    box = cube("Box", (0.0, -1.2, 0.25), 0.5, principled("box", Roughness=0.6))
    bevel = box.modifiers.new("Bevel", "BEVEL")
    bevel.width, bevel.segments = 0.1, 3
    hidden = cube("Hidden", (0.0, -1.8, 0.8), 0.8, principled("hidden"))
    hidden.hide_render = True
    only_viewport = sphere("Viewport only", (0.8, -1.5, 0.5), 0.3, principled("viewport"))
    only_viewport.hide_viewport = True  # is rendered


def modified_and_generated(folder):
    """Patterns in generated coordinates, which are those before modifiers, with and without a link."""
    stage()
    waves, tree, diffuse = shader("waves", "BsdfDiffuse")
    fill(
        tree, diffuse, {"Color": node_of(tree, "TexChecker", Scale=4.0, Color1=COLOURS[0], Color2=COLOURS[1])}
    )
    row = cube("Row", (-1.6, 0.0, 0.3), 0.5, waves)
    array = row.modifiers.new("Array", "ARRAY")
    array.count, array.relative_offset_displace = 4, (1.2, 0.0, 0.0)
    cells, tree, diffuse = shader("cells", "BsdfDiffuse")
    place = node_of(tree, "TexCoord").outputs["Generated"]
    fill(tree, diffuse, {"Color": node_of(tree, "TexChecker", Scale=6.0, Vector=place, Color2=COLOURS[2])})
    ball = sphere("Ball", (1.2, 0.2, 0.6), 0.5, cells)
    cast = ball.modifiers.new("Cast", "CAST")
    cast.cast_type, cast.factor = "CUBOID", 0.9


def geometry_nodes(folder):
    stage()
    pebble = sphere("Pebble", (0.0, 0.0, -5.0), 0.12, principled("pebble", (0.6, 0.2, 0.5, 1), Roughness=0.4))
    pebble.hide_render = True
    ground = plane("Ground", (0.0, 0.0, 0.05), 3.0, principled("ground", Roughness=0.9))
    tree, start, points, end = scattering("Scatter", density=8.0)
    info = tree.nodes.new("GeometryNodeObjectInfo")
    info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = pebble, True
    copies, join = tree.nodes.new("GeometryNodeInstanceOnPoints"), tree.nodes.new("GeometryNodeJoinGeometry")
    tree.links.new(points.outputs["Points"], copies.inputs["Points"])
    tree.links.new(info.outputs["Geometry"], copies.inputs["Instance"])
    tree.links.new(copies.outputs[0], join.inputs[0])
    tree.links.new(start.outputs[0], join.inputs[0])
    tree.links.new(join.outputs[0], end.inputs[0])
    ground.modifiers.new("Scatter", "NODES").node_group = tree


def instances_of_meshes(folder):
    """Geometry nodes that make what they scatter, with the surface that they scatter it on and without."""
    stage()
    red = principled("red", (0.7, 0.15, 0.1, 1), Roughness=0.5)
    green = principled("green", (0.1, 0.5, 0.15, 1), Roughness=0.5)
    lent = sphere("Lent", (0.0, 0.0, -5.0), 0.15, green)
    lent.hide_render = True
    for x, has_surface in ((-1.1, True), (1.1, False)):
        ground = plane("Pedestal", (x, 0.0, 0.4), 1.6, principled("pedestal", Roughness=0.9))
        tree, start, points, end = scattering("Cubes", density=6.0)
        box, painted = tree.nodes.new("GeometryNodeMeshCube"), tree.nodes.new("GeometryNodeSetMaterial")
        box.inputs["Size"].default_value = (0.2, 0.2, 0.2)
        painted.inputs["Material"].default_value = red
        info = tree.nodes.new("GeometryNodeObjectInfo")
        info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = lent, False
        made, lents, join = (
            tree.nodes.new(f"GeometryNode{n}") for n in (*["InstanceOnPoints"] * 2, "JoinGeometry")
        )
        tree.links.new(box.outputs["Mesh"], painted.inputs["Geometry"])
        for copies, source in ((made, painted.outputs[0]), (lents, info.outputs["Geometry"])):
            tree.links.new(points.outputs["Points"], copies.inputs["Points"])
            tree.links.new(source, copies.inputs["Instance"])
            tree.links.new(copies.outputs[0], join.inputs[0])
        lents.inputs["Scale"].default_value = (0.5, 0.5, 2.5)
        if has_surface:
            tree.links.new(start.outputs[0], join.inputs[0])
        tree.links.new(join.outputs[0], end.inputs[0])
        ground.modifiers.new("Cubes", "NODES").node_group = tree


def curves(folder):
    """Text, a tube along a curve, a surface of NURBS and a metaball, one of them twice."""
    stage()
    bpy.ops.object.text_add(location=(-2.2, 0.0, 0.3), rotation=(1.3, 0.0, 0.0))
    text = finish("Text", principled("letters", (0.7, 0.3, 0.1, 1), Roughness=0.4))
    text.data.body, text.data.extrude, text.data.size = "Grüße", 0.08, 0.8
    bpy.ops.curve.primitive_bezier_circle_add(radius=0.5, location=(0.6, 0.0, 0.6), rotation=(1.2, 0.0, 0.3))
    tube = finish("Tube", principled("tube", (0.1, 0.3, 0.7, 1), Roughness=0.3))
    tube.data.bevel_depth = 0.1
    again = add("Tube again", tube.data, (1.6, 0.6, 0.5))
    again.scale = (0.8, 0.8, 0.8)
    bpy.ops.surface.primitive_nurbs_surface_sphere_add(radius=0.35, location=(1.7, -0.6, 0.36))
    finish("Surface", principled("surface", (0.2, 0.6, 0.3, 1), Roughness=0.5))
    bpy.ops.object.metaball_add(type="BALL", radius=0.5, location=(-0.9, -1.0, 0.35))
    finish("Drop", principled("drop", (0.6, 0.6, 0.2, 1), Roughness=0.4))
    bpy.ops.object.metaball_add(type="BALL", radius=0.4, location=(-0.5, -1.0, 0.3))
    bpy.context.object.name = "Drop.001"


def markers(folder):
    scene, _ = stage()
    three(*(principled(f"colour {i}", c) for i, c in enumerate(COLOURS)))
    scene.frame_start, scene.frame_end = 5, 12
    first = scene.camera
    first.name = "Wide"
    first.keyframe_insert("location", frame=5)
    first.location.x += 0.4
    first.keyframe_insert("location", frame=12)
    second = camera((2.5, -3.0, 1.2), (0.0, 0.0, 0.5), lens=50.0)
    second.name = "Close"
    for frame, eye in ((5, first), (9, second)):
        marker = scene.timeline_markers.new(eye.name, frame=frame)
        marker.camera = eye


def lens_shift(folder):
    scene, _ = stage()
    three(*(principled(f"colour {i}", c) for i, c in enumerate(COLOURS)))
    data = scene.camera.data
    data.shift_x, data.shift_y, data.sensor_fit, data.sensor_height = 0.15, -0.1, "VERTICAL", 22.0


def agx(folder):
    scene, _ = stage()
    three(*(principled(f"grey {i}", (0.5, 0.5, 0.5, 1)) for i in range(3)))
    scene.view_settings.view_transform, scene.view_settings.look = "AgX", "AgX - Punchy"
    scene.view_settings.exposure = 0.7


def names(folder):
    stage()
    scripts = ("grün", "模型 1", 'a/b: <c> & "d".001')
    three(*(principled(name, image(f"bild {name}", tiles), Roughness=0.7) for name in scripts))
    bpy.data.objects["Left"].name = "Stühle é.001"
    bpy.data.objects["Middle"].name = "椅子 <1>"
    bpy.data.objects["Right"].name = "a/b\\c"


def missing_image(folder):
    stage()
    lost = bpy.data.images.load(str(_written(folder, "lost.png")))
    three(principled("lost", lost, Roughness=0.7), principled("kept"), principled("lost too", lost))
    return (Path(folder) / "lost.png").unlink


def image_file(folder):
    stage()
    picture = bpy.data.images.load(str(_written(folder, "picture é.png")))
    three(*(principled(f"picture {r}", picture, Roughness=r) for r in (0.3, 0.6, 0.9)))


def library(folder):
    new_file()
    shelf = cube("Shelf", (0.0, 0.0, 0.0), 0.9, principled("shelf", (0.2, 0.5, 0.3, 1), Roughness=0.5))
    shelf.rotation_euler = (0.0, 0.0, 0.3)
    file = save(folder, "shelf of a library")
    stage()
    with bpy.data.libraries.load(str(file), link=True, relative=False) as (_, wanted):
        wanted.objects = ["Shelf"]
    for x in (-1.2, 1.2):
        empty = add(f"place {x}", None, (x, 0.0, 0.45))
        empty.instance_type = "COLLECTION"
        linked = bpy.data.collections.new(f"linked {x}")
        linked.objects.link(wanted.objects[0])
        empty.instance_collection = linked


def two_slots(folder):
    stage()
    three(*(principled("paint", (0.7, 0.2, 0.1, 1), Roughness=0.4) for _ in range(3)))
    for name in ("Left", "Middle", "Right"):
        data = bpy.data.objects[name].data
        steel = {"colour": (0.9, 0.9, 0.9, 1), "Metallic": 1.0, "Roughness": 0.25}
        data.materials.append(principled(f"second {name}", **steel))
        for polygon in data.polygons:
            polygon.material_index = int(polygon.center.z > 0.1)
    aim(bpy.data.objects["Camera"], (0.0, 0.0, 0.6))


def _written(folder, name):
    picture = image("written", tiles)
    picture.filepath_raw, picture.file_format = str(Path(folder) / name), "PNG"
    picture.save()
    return Path(folder) / name
