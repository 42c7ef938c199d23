"""Details that an exporter can miss: one file holds them all (see corpus/details.py)."""

import mitsuba as mi
import numpy as np
import pytest

from enfilade.images import read_exr

pytestmark = [pytest.mark.blender, pytest.mark.slow]


@pytest.fixture(scope="module")
def source(blender):
    return blender.make("details")[0]


@pytest.fixture(scope="module")
def exported(blender, source):
    code, out, result = blender.job(source, "details")
    assert code == 0, result
    return out, result


@pytest.fixture(scope="module")
def shapes(exported):
    scene = mi.load_file(str(exported[0] / "scene.xml"), optimize=False)
    return {shape.id(): shape for shape in scene.shapes()}


def test_a_portal_is_no_lamp_and_a_dome_shines_inward(shapes):
    assert not {name for name in shapes if "Portal" in name}
    assert shapes["Dome back"].is_emitter()
    assert "Bulb back" not in shapes


def test_any_name_is_an_id(shapes):
    assert {"material floor 2", "cost _5"} <= set(shapes)


def test_slots_of_one_procedural_material_have_places_of_their_own_in_an_atlas(exported, shapes):
    assert len(list((exported[0] / "textures").glob("noise*"))) == 1
    slots = [shapes[name] for name in ("Slots: noise", "Slots: noise 2")]
    assert slots[0].bsdf().id() == slots[1].bsdf().id()
    first, second = (np.array(mi.traverse(slot)["vertex_texcoords"]).reshape(-1, 2) for slot in slots)
    assert ((first.max(axis=0) < second.min(axis=0)) | (second.max(axis=0) < first.min(axis=0))).any()


def test_a_corrected_image_is_on_each_meshs_own_uv_map(shapes):
    for name in ("corrected UVMap", "corrected another"):
        uv = np.array(mi.traverse(shapes[name])["vertex_texcoords"])
        assert (uv.min(), uv.max()) == (0.0, 1.0)


def test_a_normal_map_turns_with_its_uv_map(exported, shapes):
    parameters = mi.traverse(shapes["Tilted"])
    uv = np.array(parameters["vertex_texcoords"]).reshape(-1, 2)
    points = np.array(parameters["vertex_positions"]).reshape(-1, 3)
    tangents = np.linalg.lstsq(np.c_[uv, np.ones(len(uv))], points, rcond=None)[0][:2]
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    pixels = np.array(mi.Bitmap(str(exported[0] / "textures" / "Tilted normal.exr"))).reshape(-1, 3)
    normal = np.median(pixels, axis=0) * 2.0 - 1.0
    world = normal[0] * tangents[0] + normal[1] * tangents[1] + normal[2] * np.array([0.0, 0.0, 1.0])
    assert world == pytest.approx([0.0, -0.6, 0.8], abs=0.01)  # u of the file is along -y


def test_a_world_that_the_camera_does_not_see_still_lights(exported):
    image = np.array(mi.Bitmap(str(exported[0] / "textures" / "environment.exr")))
    assert image.shape[1] == 1100  # of an image in a group
    assert image.mean(axis=(0, 1)) == pytest.approx([0.2, 0.2, 0.2], rel=0.01)


def test_the_colour_of_an_object_is_baked_to_a_constant(shapes):
    parameters = mi.traverse(shapes["Coloured"].bsdf())
    reflectance = next(parameters[key] for key in parameters.keys() if key.endswith("reflectance.value"))  # noqa: SIM118
    assert np.array(reflectance).ravel() == pytest.approx([0.6, 0.1, 0.2], abs=2e-3)


def test_texels_off_the_mesh_are_not_black(exported):
    file = next((exported[0] / "textures").glob("noise*"))
    assert np.array(mi.Bitmap(str(file))).max(axis=-1).min() > 50


def test_generated_coordinates_are_baked_over_the_mesh_at_the_first_frame(exported):
    file = next((exported[0] / "textures").glob("rising_ Rising*"))
    values = np.array(mi.Bitmap(str(file)))[..., 0]
    assert np.percentile(values, 95) == pytest.approx(255, abs=5)  # half of it at frame 1


def test_what_is_lost_is_noted(exported):
    _, result = exported
    noted = {(note["object"], note["node"]) for note in result["notes"]}
    assert noted >= {
        ("Key", "Animation"),
        ("Key", "Light linking"),
        ("Scene", "Color Management: Gamma"),
        ("Scene", "Frame Step"),
        ("World", "Animation"),
        ("rising", "Animation"),
        ("World", "Ray visibility"),
        ("World", "Light Path"),  # in a group
        ("coloured", "Object Info"),
    }


def test_cycles_renders_beyond_the_files_border(blender, source):
    _, out, _ = blender.job(source, "border", task="cycles", spp=1)
    image = read_exr(out / "cycles-0011.exr")["RGB"]
    assert image.shape == (24, 32, 3)
    assert image[0, 0].max() > 0.0
    assert image[-1, -1].max() > 0.0
