"""Formats that Blender imports: their camera, frames and materials."""

import pytest

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
    assert (out / "camera_path.json").is_file()


def test_normal_maps_without_an_image_are_not_baked(imported):
    _, out, result = imported[".fbx"]
    assert not [note for note in result["notes"] if note["kind"] == "baked"]
    assert not list(out.glob("textures/*"))
