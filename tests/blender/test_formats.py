"""Formats that Blender imports: their camera, frames and materials."""

import json

import pytest

from enfilade.camera import load_path

pytestmark = [pytest.mark.blender, pytest.mark.slow]
EXPORT = """
import sys, bpy
cube = bpy.data.objects["Cube"]
cube.data.materials[0].use_nodes = True
camera = bpy.data.objects["Camera"]
for frame in (3, 9):
    camera.location.x = 0.1 * frame
    camera.keyframe_insert("location", frame=frame)
bpy.context.scene.frame_start, bpy.context.scene.frame_end = 3, 9
bpy.ops.export_scene.gltf(filepath=sys.argv[1], export_cameras=True, export_lights=True)
bpy.ops.export_scene.fbx(filepath=sys.argv[2], bake_anim=True)
"""

RIG = """
import sys, bpy
camera, rig = bpy.data.objects["Camera"], bpy.data.objects.new("Rig", None)
bpy.context.scene.collection.objects.link(rig)
camera.parent = rig
bpy.ops.export_scene.gltf(filepath=sys.argv[1], export_cameras=True)
for frame in (3, 9):
    rig.location.x = 0.1 * frame
    rig.keyframe_insert("location", frame=frame)
bpy.ops.export_scene.gltf(filepath=sys.argv[2], export_cameras=True)
bpy.ops.wm.usd_export(filepath=sys.argv[3], export_animation=True)
"""
TEXTURED = """
import sys, bpy
material = bpy.data.objects["Cube"].data.materials[0]
material.use_nodes = True
picture = bpy.data.images.new("picture", 8, 8)
picture.filepath_raw, picture.file_format = sys.argv[2], "PNG"
picture.save()
node = material.node_tree.nodes.new("ShaderNodeTexImage")
node.image = picture
bsdf = material.node_tree.nodes["Principled BSDF"]
material.node_tree.links.new(node.outputs[0], bsdf.inputs["Base Color"])
bpy.ops.export_scene.gltf(filepath=sys.argv[1], export_format="GLTF_SEPARATE", export_keep_originals=True)
"""

SQUARE = """
{{
    uniform token subdivisionScheme = "{}"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
}}
"""


@pytest.fixture(scope="module")
def imported(blender):
    files = [blender.folder / f"moving.{suffix}" for suffix in ("glb", "fbx")]
    done = blender.run("-c", EXPORT, *files)
    assert done.returncode == 0, done.stderr[-2000:]
    return {file.suffix: blender.job(file, f"scene {file.name}") for file in files}


@pytest.mark.parametrize("suffix", [".glb", ".fbx"])
def test_the_first_camera_and_its_frames_are_used(imported, suffix):
    code, out, result = imported[suffix]
    assert code == 0
    assert result["camera"] == "Camera"
    first, last = result["frames"]
    assert last - first == 6
    nodes = {note["node"] for note in result["notes"] if note["object"] == "the file"}
    assert nodes >= {"Resolution"}
    assert ("Frame Rate" in nodes) == (suffix == ".glb")
    assert (out / "camera_path.json").is_file()


def test_the_frames_are_those_of_the_cameras_parents(blender):
    files = [blender.folder / name for name in ("still.glb", "rig.glb", "rig.usdc")]
    done = blender.run("-c", RIG, *files)
    assert done.returncode == 0, done.stderr[-2000:]
    counts = []
    for file in files:
        _, out, _ = blender.job(file, f"scene {file.name}")
        counts.append(len(json.loads((out / "camera_path.json").read_text())["camera_path"]))
    assert counts == [1, 7, 250]  # USD has the range of the scene


STAGE = """#usda 1.0
(
    metersPerUnit = 0.01
    timeCodesPerSecond = 30
    upAxis = "Z"
)
def Camera "Eye"
{
    double3 xformOp:translate = (0, 0, 500)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def test_rate_and_units_of_usd_are_those_of_the_stage(blender):
    file = blender.folder / "stage.usda"
    proxy = 'def Mesh "Proxy" ' + SQUARE.format("none").replace("{", '{ uniform token purpose = "proxy"', 1)
    file.write_text(STAGE + 'def Mesh "Square"' + SQUARE.format("none") + proxy)
    code, out, result = blender.job(file, "stage")
    assert (code, result["fps"], result["counts"]["objects"]) == (0, 30.0, 1)
    path = load_path(out / "camera_path.json", size=None, frames=None, fps=None)
    assert path.fps == 30.0
    assert path.cameras[0].world_from_camera[:3, 3] == pytest.approx([0.0, 0.0, 5.0])
    noted = [(note["node"], note["effect"]) for note in result["notes"] if note["object"] == "the file"]
    assert noted == [("Resolution", "they have 1920x1080 pixels unless --size says otherwise")]


def test_images_within_gltf_are_copied(blender):
    file, picture = blender.folder / "packed.glb", blender.folder / "packed.png"
    script = TEXTURED.replace("GLTF_SEPARATE", "GLB").replace(", export_keep_originals=True", "")
    metal = 'bsdf.inputs["Metallic"].default_value = 1.0\nbpy.ops.export_scene'  # else it is scaled
    done = blender.run("-c", script.replace("bpy.ops.export_scene", metal), file, picture)
    assert done.returncode == 0, done.stderr[-2000:]
    _, out, result = blender.job(file, "packed", size=[64, 48])
    (texture,) = out.glob("textures/*.png")
    assert texture.read_bytes() in file.read_bytes()
    assert not [note for note in result["notes"] if note["node"] == "Resolution"]


@pytest.mark.parametrize(("scheme", "count"), [("none", 2), ("catmullClark", 2 * 4**2)])
def test_subdivision_surfaces_of_usd_are_subdivided(blender, scheme, count):
    file = blender.folder / f"{scheme}.usda"
    file.write_text('#usda 1.0\ndef Mesh "Square"' + SQUARE.format(scheme))
    code, _, result = blender.job(file, f"scene {scheme}")
    assert (code, result["counts"]["triangles"]) == (0, count)


def test_normal_maps_without_an_image_are_not_baked(imported):
    _, out, result = imported[".fbx"]
    assert not [note for note in result["notes"] if note["kind"] == "baked"]
    assert not list(out.glob("textures/*"))


def test_images_of_gltf_are_those_of_the_allowed_folders(blender):
    folder, picture = blender.folder / "gltf", blender.folder / "apart.png"
    folder.mkdir()
    done = blender.run("-c", TEXTURED, folder / "textured.gltf", picture)
    assert done.returncode == 0, done.stderr[-2000:]
    assert "../apart.png" in (folder / "textured.gltf").read_text()
    _, out, result = blender.job(folder / "textured.gltf", "image apart")
    assert any("outside the allowed folders" in note["what"] for note in result["notes"])
    assert not list(out.glob("textures/*"))
    allowed = [str(blender.folder)]
    _, out, result = blender.job(folder / "textured.gltf", "image allowed", library_folders=allowed)
    assert result["files"] == [str(picture)]
    assert list(out.glob("textures/*"))
