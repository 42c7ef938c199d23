"""The exporter inside Blender: what is written of small files, and what is refused."""

import json
import shutil
from functools import cache
from pathlib import Path
from xml.etree import ElementTree as ET

import mitsuba as mi
import numpy as np
import pytest

import enfilade_blender
from enfilade.camera.load import load_path
from enfilade.images import read_exr
from enfilade.scene.mitsuba.files import check_scene
from enfilade.settings import LimitSettings
from enfilade_blender.image_files import srgb_from_linear
from enfilade_blender.materials.ggx import mean_reflectance
from enfilade_blender.scene_xml import LAMP
from support.imported import traced

pytestmark = [pytest.mark.blender, pytest.mark.slow]
FILES = (
    "modifiers",
    "instances",
    "instances_of_meshes",
    "curves",
    "markers",
    "lens_shift",
    "agx",
    "names",
    "missing_image",
    "library",
    "image_file",
    "procedural",
    "emission",
    "lamps_in_view",
    "mirrored_camera",
    "miniature",
    "lamp_nodes",
    "near_lamps",
    "left_out",
    "frozen",
    "simplified",
    "without_light",
    "linked_duplicates",
)

COUNT_CASTS = """
import sys
from types import SimpleNamespace
sys.path.insert(0, sys.argv[1])
import numpy as np
from enfilade_blender.left_out import note_falloff
from enfilade_blender.notes import Notes
from enfilade_blender.records import Lamp, Selection, View
from enfilade_blender.visibility import cast_count, note_depths

class Scene:
    count = 0
    def ray_cast(self, *_, **__):
        self.count += 1
        return False, None, None, None, None, None

bulb = SimpleNamespace(type="POINT", use_soft_falloff=True, energy=1.0, shadow_soft_size=0.1)
views, lamps = 100 * [View("Camera", np.eye(4), np.ones((4, 4)), {})], 20 * [Lamp("Bulb", bulb, np.eye(4))]
for note, items in ((note_depths, views), (note_falloff, lamps)):
    scene = Scene()
    note(items, Selection(scene, None, (1, 1), (8, 8)), Notes(), casts=cast_count(int(sys.argv[2])))
    print(scene.count)
"""

LOOKED_FOR = """
import sys
from types import SimpleNamespace
sys.path.insert(0, sys.argv[1])
import bpy
from enfilade_blender import motion
from enfilade_blender.notes import Notes
scene = bpy.context.scene
objects = {"scene": scene, "world": scene.world, "objects": lambda: list(scene.objects)}
objects["colour_management"] = scene.view_settings, scene.display_settings
selection = SimpleNamespace(frames=(1, 10), **objects)
motion.check_generated = lambda *_: None
def found():
    notes, looked = Notes(), motion.Motion(selection, None)
    for frame in range(1, 11):
        scene.frame_set(frame)
        looked.look(frame)
    looked.note(notes)
    return [note["what"] for note in notes.to_list() if note["node"] == "Animation"]
print(found())
setattr(motion, sys.argv[2], int(sys.argv[3]))
print(found())
"""
WORKING_SPACES = """
import sys
from pathlib import Path
from types import SimpleNamespace
sys.path.insert(0, sys.argv[1])
import bpy
from enfilade_blender import left_out
from enfilade_blender.job import Job
from enfilade_blender.notes import Notes
from enfilade_blender.records import Selection

scene = bpy.context.scene
selection = Selection(scene, scene.view_layers[0], (1, 1), (8, 8))
for space in ("Linear Rec.709", "ACEScg"):
    left_out.bpy = SimpleNamespace(data=SimpleNamespace(colorspace=SimpleNamespace(working_space=space)))
    notes = Notes()
    left_out.note_settings(Job("export", Path("a.blend"), Path("b")), selection, notes)
    print([note["what"] for note in notes.to_list() if note["node"] == "Working Space"])
"""

PACKED = """
import sys
from pathlib import Path
from types import SimpleNamespace
sys.path.insert(0, sys.argv[1])
import bpy
from enfilade_blender import open_file
from enfilade_blender.failure import ExportError
from enfilade_blender.job import Job

class Data:
    id_type = "MESH"

    def __init__(self, **values):
        self.__dict__ |= values

assets, archive = (Data(filepath="/elsewhere/assets.blend") for _ in range(2))
own = Data(library=None)
for used in (
    Data(library=archive, is_linked_packed=True),
    Data(library=assets, id_type="BRUSH"),
    Data(library=assets, is_linked_packed=False),
):
    data = SimpleNamespace(libraries=[assets, archive], user_map=lambda: {own: set(), used: {own}})
    open_file.bpy = SimpleNamespace(path=bpy.path, data=data)
    try:
        open_file._check_libraries(Job("export", Path("a.blend"), Path("b")))
        print("read")
    except ExportError as error:
        print(error.what)
"""


@pytest.fixture(scope="session")
def files(blender):
    return dict(zip(FILES, blender.make(*FILES), strict=True))


@pytest.fixture(scope="session")
def exported(blender, files):
    """Folder and ``import.json`` of an exported file; each is exported once."""

    @cache
    def export(name):
        code, out, result = blender.job(files[name], f"scene {{x}} {name}")
        assert code == 0, result
        return out, result

    return export


def notes(result, kind):
    return [(note["object"], note["what"]) for note in result["notes"] if note["kind"] == kind]


def shapes(out):
    return {shape.id(): shape for shape in mi.load_file(str(out / "scene.xml"), optimize=False).shapes()}


@pytest.mark.parametrize("name", FILES)
def test_the_scene_is_accepted_and_the_path_is_read(exported, name):
    out, result = exported(name)
    check_scene(out / "scene.xml", LimitSettings())
    path = load_path(out / "camera_path.json")
    assert len(path.cameras) == result["frames"][1] - result["frames"][0] + 1
    assert shapes(out)
    assert result["counts"]["triangles"] > 0


def test_modifiers_and_visibility_are_those_of_renders(exported):
    out, _ = exported("modifiers")
    found = shapes(out)
    assert "Hidden" not in found
    assert "Viewport only" in found  # hidden in the viewport alone
    assert found["Middle"].face_count() == 6 * 4**3 * 2
    assert found["Left"].face_count() == 2 * (64 * 30 * 2 + 64 * 2)


def test_instances_are_shapes_of_their_instancers(exported):
    out, result = exported("instances")
    found = shapes(out)
    assert {f"copy {i}: Chair" for i in range(6)} <= set(found)
    assert result["counts"]["instances"] > 12
    # A copy of negative scale keeps its normals outside.
    box = found["copy 0: Chair"]
    parameters = mi.traverse(box)
    points = np.array(parameters["vertex_positions"]).reshape(-1, 3)
    normals = np.array(parameters["vertex_normals"]).reshape(-1, 3)
    assert (np.einsum("ij,ij->i", points - points.mean(axis=0), normals) > 0.0).all()


def test_meshes_that_geometry_nodes_make_are_instances(exported):
    found = shapes(exported("instances_of_meshes")[0])
    ball, box = 64 * 30 * 2 + 64 * 2, 12
    counts = sorted(shape.face_count() for name, shape in found.items() if name.startswith("Pedestal"))
    pedestal, *_ = counts
    assert pedestal == 2  # of one alone: the other has no surface
    assert counts[1:] == sorted(2 * [15 * ball, 15 * box])


def test_linked_duplicates_of_many_triangles_are_instances(exported):
    out, _ = exported("linked_duplicates")
    root = ET.parse(out / "scene.xml").getroot()
    names = {
        kind: {e.get("id") for e in root.findall(f"shape[@type='{kind}']")} for kind in ("instance", "ply")
    }
    copies = [f" {number}" for number in range(1, 17)]
    assert names["instance"] == {"paint", *(f"paint{copy}" for copy in copies)}
    # Of another material, or of one that tells objects apart.
    assert names["ply"] == {"other", "by object", *(f"by object{copy}" for copy in copies)}
    assert root.findall("shape[@id='paint 3']/transform/matrix")[0].get("value").split()[7] == "6"


def test_text_curves_surfaces_and_metaballs_are_meshes(exported):
    found = shapes(exported("curves")[0])
    assert {"Text", "Tube", "Tube again", "Surface", "Drop"} <= set(found)
    assert "Drop.001" not in found  # is a part of the first
    assert len(found) == 8  # with floor, wall and lamp: none twice
    assert found["Tube"].face_count() == found["Tube again"].face_count() > 1000


def test_a_marker_is_a_cut(exported):
    out, result = exported("markers")
    path = json.loads((out / "camera_path.json").read_text())
    assert (path["cuts"], path["first_frame"], len(path["camera_path"])) == ([5], 5, 8)
    assert path["camera_path"][3]["fov"] > path["camera_path"][4]["fov"]
    assert result["camera"] in ("Wide", "Close")


def test_the_lens_shift_is_the_principal_point(exported):
    out, _ = exported("lens_shift")
    frame = json.loads((out / "camera_path.json").read_text())["camera_path"][0]
    # Vertical fit: the shift is in units of the sensor's height; x moves the picture left, y up.
    assert frame["principal_point"] == pytest.approx([0.5 - 0.15 * 96 / 128, 0.5 - 0.1], abs=1e-6)


def test_a_mirrored_camera_looks_where_it_points(exported):
    out, result = exported("mirrored_camera")
    pose = np.array(json.loads((out / "camera_path.json").read_text())["camera_path"][0]["camera_to_world"])
    forward = np.array([0.0, 5.2, -1.3]) / np.hypot(5.2, 1.3)  # of corpus.stage
    assert -pose[:3, 2] == pytest.approx(forward, abs=1e-5)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)
    assert [what for name, what in notes(result, "not-carried") if name == "Camera"] == [
        "its negative scale is left out"
    ]
    assert ("Camera", "it is 5,000 units from the origin") in notes(result, "approximated")


@pytest.mark.parametrize("corner", [(0.0, 0.0), (-1.0, 1.0), (1.0, -1.0)])
def test_the_axes_of_a_camera_may_be_oblique(exported, corner):
    """As in Cycles, which normalizes the columns of its matrix, of a parent that is twice as high."""
    path = json.loads((exported("miniature")[0] / "camera_path.json").read_text())
    frame = path["camera_path"][0]
    tangent = np.tan(0.5 * np.radians(frame["fov"])) * np.array(
        [path["render_width"] / path["render_height"], 1]
    )
    centre = np.multiply(frame["principal_point"], (2.0, -2.0)) + np.array((-1.0, 1.0))
    found = np.array(frame["camera_to_world"])[:3, :3] @ [*((corner - centre) * tangent), -1.0]
    turn, (sine, cosine) = 0.5, (np.sin(np.pi / 3.0), np.cos(np.pi / 3.0))
    rig = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 2]])
    axes = rig @ [[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]]
    axes /= np.linalg.norm(axes, axis=0)
    width = 0.5 * 36.0 / 35.0  # of the sensor, by the focal length
    size = np.array([width, width * path["render_height"] / path["render_width"]])
    wanted = axes @ [*(corner * size), -1.0]
    assert found / np.linalg.norm(found) == pytest.approx(wanted / np.linalg.norm(wanted), abs=1e-5)


def test_a_shear_of_the_picture_is_noted(exported):
    found = [name for name, what in notes(exported("near_lamps")[1], "approximated") if "shear" in what]
    assert found == ["Camera"]


def test_a_miniature_is_not_clipped_and_said_to_be_small(exported):
    _, result = exported("miniature")
    found = {note["node"]: note for note in result["notes"] if note["object"] == "Camera"}
    assert set(found) == {"Clip Start", "Location"}
    assert found["Clip Start"]["effect"] == "surfaces that it clips are visible: Coin"
    assert "miniature" in found["Location"]["what"]


def test_view_and_exposure_are_those_of_the_file(exported):
    _, result = exported("agx")
    assert result["view"] == {"display": "sRGB", "view_transform": "AgX", "look": "AgX - Punchy"}
    assert result["exposure_ev"] == pytest.approx(0.7)


def test_names_of_any_script_are_ids(exported):
    out, _ = exported("names")
    assert {"Stühle é_001", "椅子 <1>", "a_b\\c"} <= set(shapes(out))


def test_a_missing_image_is_grey_and_noted(exported):
    out, result = exported("missing_image")
    assert any("lost.png" in what for _, what in notes(result, "approximated"))
    assert "lost.png" not in (out / "scene.xml").read_text()


def test_procedural_values_are_baked_and_noted(exported):
    out, result = exported("procedural")
    assert {name.split(",")[0] for name, _ in notes(result, "baked")} == {"noise", "voronoi", "checker"}
    checker = next((out / "textures").glob("checker*.png"))
    tones = np.percentile(np.array(mi.Bitmap(str(checker))), [5, 95]) / 255.0
    white = mean_reflectance(0.64, 1.5)  # of its roughness of 0.8: the surface is matt
    wanted = srgb_from_linear(white + (1.0 - white) * np.array([0.2, 0.8]))
    assert tones == pytest.approx(wanted, abs=1.5 / 255.0)


def test_an_open_emitter_shines_on_both_sides(exported):
    out, _ = exported("emission")
    found = shapes(out)
    assert found["Screen"].is_emitter()
    assert found["Screen back"].is_emitter()
    assert "Left back" not in found


def test_point_lights_keep_their_radius_unseen_by_the_camera(exported):
    out, result = exported("lamps_in_view")
    assert notes(result, "approximated") == []
    lamps = [shapes(out)[name] for name in ("Seen", "Inside the left sphere", "Behind the camera")]
    assert all(shape.is_emitter() and shape.bsdf().id() == LAMP for shape in lamps)


def test_soft_falloff_is_noted_of_lamps_near_surfaces(exported):
    found = [note for note in exported("near_lamps")[1]["notes"] if note["node"] == "Soft Falloff"]
    assert {note["object"] for note in found} == {"Near", "Down"}
    # Measured in Cycles at two radii: 0.779 of the light without, off the axis in part.
    assert all(note["effect"].endswith("at 0.5 units by 25%") for note in found)


def test_a_sun_narrower_than_texels_of_the_environment_is_widened_and_noted(exported):
    found = notes(exported("near_lamps")[1], "approximated")
    assert ("Narrow", "its angle of 0.057 degrees is 0.35 degrees in the environment map") in found


def test_notes_cast_fewer_rays_at_more_objects(blender):
    counts = {}
    for objects in (100, 20_000, 1_000_000):
        done = blender.run("-c", COUNT_CASTS, Path(enfilade_blender.__file__).parents[1], objects)
        assert done.returncode == 0, done.stderr[-2000:]
        counts[objects] = [int(count) for count in done.stdout.split()[-2:]]
    # Of 100 views 40 rays of every second one, and of 20 lamps 27 rays; then a few.
    assert counts == {100: [50 * 40, 20 * 27], 20_000: [5 * 8, 5 * 7], 1_000_000: [8, 7]}


def test_other_working_spaces_of_blender_5_are_noted(blender):
    done = blender.run("-c", WORKING_SPACES, Path(enfilade_blender.__file__).parents[1])
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.splitlines()[-2:] == ["[]", "['its working space ACEScg is left out']"]


@pytest.mark.parametrize(
    ("name", "told"),
    [("BUDGET", "54 frames, and in 100000 objects"), ("COMPARED", "1 frames, and in 1 objects")],
)
def test_motion_that_is_not_looked_for_is_told(blender, name, told):
    done = blender.run("-c", LOOKED_FOR, Path(enfilade_blender.__file__).parents[1], name, 1)
    assert done.returncode == 0, done.stderr[-2000:]
    none, some = done.stdout.splitlines()[-2:]
    assert none == "[]"
    assert some == f"['motion is looked for in one of {told} and copies']"


def test_constants_of_a_lamps_nodes_are_kept(exported):
    out, result = exported("lamp_nodes")
    emitters = ET.parse(out / "scene.xml").getroot().findall("emitter[@type='point']")
    found = [[float(c) for c in e.find("rgb").get("value").split()] for e in emitters]
    watts = 10.0 / (4.0 * np.pi)
    falloff, pattern = np.multiply([1.0, 0.5, 0.5], 50.0 * watts), np.full(3, 5.0 * watts)
    warm = np.multiply([1.9351, 0.8035, 0.1917], 5.0 * watts)  # a world of this temperature, by Cycles
    computed = np.multiply([0.75, 0.0, 0.25], 15.0 * watts)
    total = np.multiply([5.0 + 1.5, 2.5 + 1.5, 2.5 + 1.5], watts)  # of an emission, and 3/4 of another
    wanted = np.array([falloff, pattern, warm, computed, computed, total])
    assert np.array(found) == pytest.approx(wanted, rel=1e-3, abs=1e-6)
    assert notes(result, "approximated") == [("Falloff", "its falloff is quadratic")]
    assert notes(result, "not-carried") == [("Pattern", "a pattern of its nodes is left out")]


def test_settings_that_are_left_out_are_noted(exported):
    _, result = exported("left_out")
    assert {(note["object"], note["node"]) for note in result["notes"] if note["kind"] == "not-carried"} == {
        ("No gloss", "Ray visibility"),
        ("No gloss", "Max Bounces"),
        ("Dimmer", "Power"),
        ("Scene", "Stereoscopy"),
        ("Scene", "Light Paths: Fast GI Approximation"),
        ("Torn", "Mesh"),
        ("Scene", "Render Region"),
        ("Scene", "Sequencer"),
        ("Scene", "Freestyle"),
        ("Scene", "Light Paths: Reflective Caustics"),
        ("Scene", "Light Paths: Clamping"),
        ("Camera", "Clip Start"),
        ("Coated", "Shadow catcher, holdout or indirect only"),
        ("DejaVu Sans Mono Book", "Font"),
        ("ViewLayer", "Override"),
        ("Second", ""),
        ("metal", "Metallic BSDF"),
        ("hole", "Emission"),
        ("coated", "Principled BSDF: Coat Tint"),
        ("coated", "Principled BSDF: Coat Normal"),
        ("solid shadow", "Transparent Shadows"),
    }
    grey = "a colour attribute is taken as a mid grey, where numbers are computed of its own"
    assert set(notes(result, "approximated")) >= {
        ("World", "Is Camera Ray is left out"),
        ("matcap, matcap", "it depends on the view"),
        ("islands", "its Random Per Island are other numbers than in Cycles"),
        ("stained", grey),
        ("Scene", "paths through glass end after 6 bounces, in Blender after 12"),
        ("Scene", "the scene is read as Cycles has it, not WORKBENCH"),
    }
    assert ("broken", "a number that is NaN or infinite is taken as 0") in notes(result, "approximated")


def test_what_changes_is_noted(exported):
    _, result = exported("frozen")
    changes = {note["object"] for note in result["notes"] if note["node"] == "Animation"}
    assert changes == {
        *("Blinking", "driven", "film", "Growing", "Hooked", "sliding"),
        *("Swelling", "Vine", "Door", "Copy: Inner", "Of the set", "Emitter: Drop", "Cut"),
    }
    assert ("Scene", "its animation is left out") in notes(result, "not-carried")
    assert result["exposure_ev"] == 0.0
    assert not any("hair" in what for _, what in notes(result, "not-carried"))
    (blocked,) = (note["what"] for note in result["notes"] if note["node"] == "Drivers")
    assert "drivers that need Python don't run" in blocked


def test_a_sequence_of_images_is_baked_as_in_the_first_frame(exported):
    out, result = exported("frozen")
    assert notes(result, "approximated") == []
    (film,) = (out / "textures").glob("screen*")
    dark, bright = np.percentile(np.array(mi.Bitmap(str(film)))[..., 0], [1, 99])
    # Tiles of 0.1 and 0.9 in sRGB, to half a step of 8 bits each.
    assert bright / dark == pytest.approx((0.955 / 1.055) ** 2.4 / (0.155 / 1.055) ** 2.4, rel=0.05)


@pytest.mark.parametrize(("name", "depth"), [("markers", 6), ("lamp_nodes", 7)], ids=["matt", "plastic"])
def test_paths_are_longer_where_most_surfaces_are_plastics(exported, name, depth):
    integrator = ET.parse(exported(name)[0] / "scene.xml").find("integrator")
    assert int(integrator.find("integer[@name='max_depth']").get("value")) == depth


def test_a_coat_is_even_over_a_bumpy_base(exported):
    bsdf = ET.parse(exported("left_out")[0] / "scene.xml").find("bsdf[@id='material coated']")
    kinds = [nested.get("type") for nested in bsdf.find("bsdf").findall("bsdf")]
    assert kinds == ["normalmap", "roughconductor"]


def test_triangles_without_a_place_are_left_out(exported):
    out, result = exported("left_out")
    assert ("Torn", "triangles with a vertex that is NaN or infinite are left out: 1 of 3") in notes(
        result, "not-carried"
    )
    torn = shapes(out)["Torn"]
    assert torn.face_count() == 2
    normals = np.array(mi.traverse(torn)["vertex_normals"]).reshape(-1, 3)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0, abs=1e-5)


def test_light_that_is_no_number_or_negative_is_left_out_and_noted(exported):
    out, result = exported("without_light")
    assert {(note["object"], note["node"]) for note in result["notes"]} == {
        ("World", "World"),
        ("Nowhere", "Transform"),
        ("NaN", "Light"),
        ("Infinite", "Light"),
        ("Colour", "Light"),
        ("Size", "Light"),
        ("Line", "Size"),
        ("Small", "Size"),
        ("Collapsed", "Emission"),
        ("Scene", "Light"),
    }
    assert set(shapes(out)) == {"Floor", "Collapsed"}
    assert not any(shape.is_emitter() for shape in shapes(out).values())


def test_a_file_of_nothing_is_refused(blender):
    code, _, error = blender.job(blender.make("nothing")[0], "nothing")
    assert (code, "there is nothing to render" in error["what"]) == (3, True)


def test_a_library_of_another_folder_is_refused_unless_it_is_allowed(blender, files, tmp_path):
    apart = tmp_path / "library.blend"
    shutil.copyfile(files["library"], apart)
    code, _, error = blender.job(apart, "library apart")
    assert (code, "outside the allowed folders" in error["what"]) == (3, True)
    code, _, _ = blender.job(apart, "allowed", library_folders=[str(files["library"].parent)])
    assert code == 0


def test_libraries_of_which_data_is_packed_are_not_read(blender):
    """As Blender 5 leaves that of its essential assets in a file; nor those of brushes alone."""
    done = blender.run("-c", PACKED, Path(enfilade_blender.__file__).parents[1])
    assert done.returncode == 0, done.stderr[-2000:]
    refused = "it links the library /elsewhere/assets.blend, outside the allowed folders"
    assert done.stdout.splitlines()[-3:] == ["read", "read", refused]


def test_libraries_and_images_are_listed(exported):
    names = {"library": "shelf of a library.blend", "image_file": "picture é.png"}
    for file, name in names.items():
        _, result = exported(file)
        assert [Path(one).name for one in result["files"]] == [name]
        assert Path(result["files"][0]).is_absolute()
    assert exported("missing_image")[1]["files"] == []


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_a_cut_off_file_is_refused(blender, files, tmp_path, share):
    whole = files["agx"].read_bytes()
    cut = tmp_path / f"cut {share}.blend"
    cut.write_bytes(whole[: int(share * len(whole))])
    code, _, error = blender.job(cut, f"cut {share}")
    assert code == 3
    assert "cut" in error["where"]


@pytest.mark.parametrize(
    ("limit", "word"), [({"instances": 10}, "instances"), ({"triangles": 1000}, "triangles")]
)
def test_limits_hold(blender, files, limit, word):
    code, _, error = blender.job(files["instances"], f"limit {word}", limits=limit)
    assert (code, word in error["what"]) == (3, True)


def test_limits_count_the_triangles_of_instances_once(blender, files):
    code, _, result = blender.job(files["linked_duplicates"], "instanced", limits={"triangles": 2_000_000})
    large, small = 2 * 500**2, 2 * 125**2  # of a grid
    assert (code, result["counts"]["triangles"]) == (0, 2 * large + 17 * small)


def test_limits_count_levels_that_simplify_leaves(blender, files):
    code, _, result = blender.job(files["simplified"], "limit simplified", limits={"triangles": 100})
    assert (code, result["counts"]["triangles"]) == (0, 8 + 2)


def test_normalized_coordinates_are_baked(exported):
    assert [name for name, _ in notes(exported("simplified")[1], "baked")] == ["normalized, Soft"]


def test_frames_beyond_the_range_of_the_scene_are_noted(blender, exported, files):
    code, out, result = blender.job(files["agx"], "beyond", frames=[2, 3])
    assert (code, len(json.loads((out / "camera_path.json").read_text())["camera_path"])) == (0, 2)
    wanted = [("Scene", "frames 2-3 reach beyond the range of the scene, 1-1")]
    assert (notes(result, "approximated"), notes(exported("agx")[1], "approximated")) == (wanted, [])


def test_a_wrong_name_lists_the_right_ones(blender, files):
    code, _, error = blender.job(files["agx"], "wrong camera", camera="Kamera")
    assert (code, error["do"]) == (3, "choose one of Camera")


def test_cycles_and_mitsuba_agree_on_the_light(blender, exported, files):
    code, out, result = blender.job(files["agx"], "cycles", task="cycles", spp=64, unbiased=True)
    assert (code, result["spp"]) == (0, 64)
    theirs = read_exr(out / "cycles-0001.exr")["RGB"]
    ours = traced(exported("agx")[0], 64)
    # Light of an area lamp and a world on plastics. The noise of the mean is 0.2 %.
    assert ours.mean(axis=(0, 1)) == pytest.approx(theirs.mean(axis=(0, 1)), rel=0.02)
