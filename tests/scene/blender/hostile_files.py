"""Makes files that do harm to a careless importer. Run by Blender's Python: FOLDER MARK.

``MARK`` is the file that each script would write.
"""

import os
import sys
from pathlib import Path

import bpy


def empty_file():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    data = bpy.data.cameras.new("Cam")
    camera = bpy.data.objects.new("Cam", data)
    bpy.context.scene.collection.objects.link(camera)
    camera.location = (0.0, -5.0, 0.0)
    camera.rotation_euler = (1.5708, 0.0, 0.0)
    bpy.context.scene.camera = camera
    bpy.context.scene.frame_end = 3
    return cube


def save(file, **terms):
    bpy.ops.wm.save_as_mainfile(filepath=str(file), **terms)


def scripts(folder, mark):
    """A text block that registers itself, and a driver that calls Python."""
    cube = empty_file()
    text = bpy.data.texts.new("start.py")
    text.write(f"open({mark!r}, 'w').write('text block')")
    text.use_module = True
    curve = cube.driver_add("location", 0)
    curve.driver.expression = f"len(open({mark!r}, 'w').name)"
    save(folder / "scripts.blend")


def cut_off(folder):
    """Half of a file, plain and compressed."""
    for name, terms in (("plain", {}), ("compressed", {"compress": True})):
        empty_file()
        bpy.ops.mesh.primitive_uv_sphere_add(segments=128, ring_count=64)
        whole = folder / f"{name}.blend"
        save(whole, **terms)
        data = whole.read_bytes()
        (folder / f"{name}_cut.blend").write_bytes(data[: len(data) // 2])
        (folder / f"{name}_start.blend").write_bytes(data[:100])


def library(folder):
    """An object of a library outside of the file's folder."""
    empty_file()
    outside = folder / "outside"
    outside.mkdir()
    save(outside / "library.blend")
    empty_file()
    inside = folder / "inside"
    inside.mkdir()
    save(inside / "linked.blend")
    with bpy.data.libraries.load(str(outside / "library.blend"), link=True) as (there, here):
        here.objects = there.objects[:1]
    bpy.context.scene.collection.objects.link(here.objects[0])
    save(inside / "linked.blend")


def instances(folder):
    """10^7 cubes, by seven levels of ten instances."""
    cube = empty_file()
    inner = bpy.data.collections.new("level 0")
    inner.objects.link(cube)
    for level in range(1, 8):
        outer = bpy.data.collections.new(f"level {level}")
        for number in range(10):
            instance = bpy.data.objects.new(f"{level}.{number}", None)
            instance.instance_type, instance.instance_collection = "COLLECTION", inner
            instance.location = (float(number), float(level), 0.0)
            outer.objects.link(instance)
        inner = outer
    bpy.context.scene.collection.children.link(inner)
    save(folder / "instances.blend")


def scattered(folder):
    """10^7 cubes again, made by geometry nodes: nothing in the file tells their number."""
    cube = empty_file()
    tree = bpy.data.node_groups.new("scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    points, boxes = tree.nodes.new("GeometryNodePoints"), tree.nodes.new("GeometryNodeMeshCube")
    points.inputs["Count"].default_value = 10_000_000
    copies, end = tree.nodes.new("GeometryNodeInstanceOnPoints"), tree.nodes.new("NodeGroupOutput")
    tree.links.new(points.outputs[0], copies.inputs["Points"])
    tree.links.new(boxes.outputs[0], copies.inputs["Instance"])
    tree.links.new(copies.outputs[0], end.inputs[0])
    cube.modifiers.new("scatter", "NODES").node_group = tree
    save(folder / "scattered.blend")


def subdivided(folder):
    """10^9 triangles, by subdivision."""
    cube = empty_file()
    modifier = cube.modifiers.new("Subdivision", "SUBSURF")
    modifier.render_levels, modifier.levels = 11, 0
    for _ in range(2):
        array = cube.modifiers.new("Array", "ARRAY")
        array.count = 10
    save(folder / "subdivided.blend")


if __name__ == "__main__":
    place = Path(sys.argv[1])
    scripts(place, sys.argv[2])
    cut_off(place)
    library(place)
    instances(place)
    scattered(place)
    subdivided(place)
    sys.stdout.flush()
    os._exit(0)  # bpy may hang at its end
