"""Settings, nodes and objects that an exporter can overlook (see corpus/overlooked.py)."""

from xml.etree import ElementTree as ET

import mitsuba as mi
import numpy as np
import pytest

from enfilade.images import read_exr

pytestmark = [pytest.mark.blender, pytest.mark.slow]


@pytest.fixture(scope="module")
def source(blender):
    return blender.make("overlooked")[0]


@pytest.fixture(scope="module")
def exported(blender, source):
    """Root of the scene, notes by object, and the folder."""
    code, out, result = blender.job(source, "overlooked", limits={"instances": 1000})
    assert code == 0, result
    notes = {}
    for note in result["notes"]:
        notes.setdefault(note["object"], []).append(note["what"])
    return ET.parse(out / "scene.xml").getroot(), notes, out


def test_a_view_layer_may_leave_out_the_world(exported):
    root, notes, _ = exported
    assert root.find("emitter[@type='constant']") is None
    assert "World" not in notes


def test_a_view_layer_without_surfaces_is_noted(exported):
    assert exported[1]["ViewLayer"] == ["that it leaves out surfaces is left out"]


def test_diffuse_paths_that_are_longer_than_in_blender_are_noted(exported):
    assert "diffuse paths end after 6 bounces, in Blender after 1" in exported[1]["Scene"]


def test_culling_and_adaptive_subdivision_are_noted(exported):
    assert "its culling is left out" in exported[1]["Scene"]
    assert exported[1]["Floor"] == ["its levels are those of the modifier"]


def test_the_falloff_of_emissive_materials_is_noted(exported):
    root, notes, _ = exported
    for name, radiance in (("even", 3.0), ("doubled", 6.0)):
        found = root.find(f"shape[@id='{name}']/emitter/rgb").get("value").split()
        assert [float(number) for number in found] == pytest.approx(3 * [radiance], rel=2e-3)
        assert notes[name] == ["its falloff is quadratic"]


def test_a_spot_that_glass_stops_is_noted(exported):
    assert "its light does not pass glass" in exported[1]["Downlight"]


def test_a_script_is_noted(exported):
    assert exported[1]["scripted"] == ["scripts of OSL are not run, and their outputs are taken as 0"]


def test_an_image_is_mapped_by_its_own_node(exported):
    scene = mi.load_file(str(exported[2] / "scene.xml"))
    x = 0.75 + 0.5 * np.array([0.1, 0.4, 0.6, 0.9])
    si = scene.ray_intersect(mi.Ray3f(mi.Point3f(x, 1.0, 0.2), mi.Vector3f(0.0, 0.0, -1.0)))
    assert np.array(si.bsdf().eval_diffuse_reflectance(si))[0] == pytest.approx(
        [0.0, 1.0, 0.0, 1.0], abs=0.01
    )


def test_cycles_renders_what_is_imported(blender):
    code, out, _ = blender.job(blender.make("blurred")[0], "blurred", task="cycles", spp=16)
    assert code == 0
    image = read_exr(out / "cycles-0001.exr")["RGB"]
    # The pixels of the outline are in between; a pixel of one sample is of either colour.
    colours = np.isclose(image, 0.25, atol=2e-3) | np.isclose(image, 1.0, atol=2e-3)
    assert 0.7 < colours.mean() < 0.97
    assert image.min() > 0.24


def test_an_object_that_renders_do_not_show_is_neither_counted_nor_hit(exported):
    _, notes, _ = exported  # of few instances
    assert "Camera" not in notes
