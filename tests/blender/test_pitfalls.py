"""Data that has other values than a first look at it tells (see corpus/pitfalls.py)."""

from xml.etree import ElementTree as ET

import mitsuba as mi
import numpy as np
import pytest

pytestmark = [pytest.mark.blender, pytest.mark.slow]


@pytest.fixture(scope="module")
def exported(blender):
    code, out, result = blender.job(blender.make("pitfalls")[0], "pitfalls", bake_px=128)
    assert code == 0, result
    return out, result


@pytest.fixture(scope="module")
def scene(exported):
    return mi.load_file(str(exported[0] / "scene.xml"), optimize=False)


@pytest.fixture(scope="module")
def shapes(scene):
    return {shape.id(): shape for shape in scene.shapes()}


def values(plugin, name):
    parameters = mi.traverse(plugin)
    return np.array(next(parameters[key] for key in parameters.keys() if key.endswith(name))).ravel()  # noqa: SIM118


def test_copies_of_a_mesh_with_a_modifier_and_a_normal_map_are_joined(shapes):
    assert mi.traverse(shapes["Grid: Stud"])["faces"].shape[0] == 4 * 3 * 48


def test_values_of_what_viewports_hide_are_those_of_the_first_frame(scene, shapes):
    lamp = next(emitter for emitter in scene.emitters() if emitter.class_name() == "PointLight")
    assert values(lamp, "intensity.value") == pytest.approx(3 * [10.0 / (4.0 * np.pi)], rel=1e-5)
    assert values(shapes["Fading"].bsdf(), "reflectance.value") == pytest.approx([1.0, 0.0, 0.0], abs=1e-5)


def test_the_output_for_cycles_counts(scene, shapes):
    assert values(shapes["Both"].bsdf(), "reflectance.value") == pytest.approx([0.0, 1.0, 0.0])
    sky = next(emitter for emitter in scene.emitters() if emitter.class_name() == "ConstantBackgroundEmitter")
    assert values(sky, "radiance.value") == pytest.approx([0.0, 0.3, 0.0])


def test_attributes_have_any_domain(shapes):
    coordinates = values(shapes["Wrapped"], "vertex_texcoords")
    assert (coordinates.min(), coordinates.max()) == (0.0, 3.0)
    colours = values(shapes["Tinted"], "vertex_color").reshape(-1, 3)
    assert colours == pytest.approx(np.tile([0.1, 0.2, 0.7], (len(colours), 1)))


def test_a_tiled_image_below_a_correction_is_baked_over_its_own_square(scene):
    uv = np.random.default_rng(1).random((500, 2))
    ray = mi.Ray3f(mi.Point3f(*(uv - 0.5).T * 0.5 + [[-3.0], [-2.0]], 1.0), mi.Vector3f(0.0, 0.0, -1.0))
    si = scene.ray_intersect(ray)
    found = np.array(si.bsdf().eval_diffuse_reflectance(si)).T
    angle, (u, v) = 0.5, (uv * [8.0, 5.0]).T
    x, y = np.cos(angle) * u - np.sin(angle) * v, np.sin(angle) * u + np.cos(angle) * v
    wanted = np.stack([x % 1.0 <= 0.5, y % 1.0 <= 0.5, np.ones_like(x)], axis=1)
    assert (np.abs(found - wanted).max(axis=1) < 0.02).mean() > 0.9  # the rest are edges


def test_linked_duplicates_are_baked_once_as_large_as_the_nearest(exported, shapes):
    assert shapes["Far"].bsdf().id() == shapes["Near"].bsdf().id()
    (file,) = (exported[0] / "textures").glob("wood*")
    assert np.array(mi.Bitmap(str(file))).shape[:2] == (128, 128)


def test_what_has_no_effect_is_neither_baked_nor_noted(exported, shapes):
    assert not [note for note in exported[1]["notes"] if note["object"].startswith("idle")]
    assert values(shapes["Idle"].bsdf(), "diffuse_reflectance.value")[0] < 0.2  # not that of the muted red


def test_dim_emission_is_stored_as_srgb(exported):
    shape = ET.parse(exported[0] / "scene.xml").find("shape[@id='Dim']")
    assert shape.find("emitter/texture/boolean[@name='raw']").get("value") == "false"


def test_coordinates_and_layers_that_are_lost_are_noted(exported):
    found = {note["object"]: note["what"] for note in exported[1]["notes"] if note["kind"] == "approximated"}
    assert found["instanced"] == "its coordinates of the instancer are taken as 0"
    assert found["layers.exr"].endswith("has several layers, none of which is read")


def test_a_channel_of_an_image_is_not_baked(exported, shapes):
    parameters = mi.traverse(shapes["Packed"].bsdf())
    sizes = {np.array(value).shape[:2] for key, value in parameters if key.endswith("data")}
    assert sizes == {(16, 16)}
    assert not [note for note in exported[1]["notes"] if note["object"].startswith("packed")]


def test_a_blank_name_is_that_of_the_attribute_of_renders(shapes):
    assert values(shapes["Unnamed"].bsdf(), "reflectance.value") == pytest.approx([0.1, 0.7, 0.1], abs=2e-3)


def test_an_image_is_read_by_its_content_not_by_its_name(exported):
    file = next((exported[0] / "textures").glob("web*"))
    assert file.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("name", "stored"),
    [("png", 255 * 0.5 * 0.4), ("exr", 0.2140), ("webp", 255 * 0.5), ("jp2", 255 * 0.5)],
)
def test_a_file_decides_on_alpha_and_its_colour_space_on_colours(shapes, name, stored):
    # Cycles takes alpha of PNG files as straight, that of WebP and JPEG 2000 as multiplied into the colours,
    # and decodes EXR files as they are told.
    texture = mi.traverse(shapes[f"Contrary {name}"].bsdf())
    data = next(value for key, value in texture if key.endswith("data"))
    assert np.array(data)[..., :3].mean() == pytest.approx(stored, rel=0.01)


def test_a_lamp_that_the_camera_sees_is_a_surface(exported, shapes):
    assert shapes["Panel"].is_emitter()
    assert shapes["Panel"].bsdf().class_name() == "SmoothDiffuse"
    notes = [note for note in exported[1]["notes"] if note["object"] == "Panel"]
    assert [note["node"] for note in notes] == ["Ray visibility"]


def test_libraries_of_libraries_are_found(blender):
    code, _, result = blender.job(blender.make("nested_libraries")[0], "nested")
    assert code == 0, result
    assert len(result["files"]) == 2
