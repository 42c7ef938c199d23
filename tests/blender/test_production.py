"""Settings of production files (see corpus/production.py)."""

import math
from xml.etree import ElementTree as ET

import pytest

from enfilade.camera import load_path

pytestmark = [pytest.mark.blender, pytest.mark.slow]


@pytest.fixture(scope="module")
def exported(blender):
    """Folder, ``import.json``, root of the scene, and notes by object."""
    code, out, result = blender.job(blender.make("production")[0], "production")
    assert code == 0, result
    notes = {}
    for note in result["notes"]:
        notes.setdefault(note["object"], []).append((note["kind"], note["node"], note["effect"]))
    return out, result, ET.parse(out / "scene.xml").getroot(), notes


def bsdf_of(root, shape):
    identifier = root.find(f"shape[@id='{shape}']/ref").get("id")
    return root.find(f"bsdf[@id='{identifier}']")


def test_the_view_is_that_of_the_output(exported):
    _, result, _, notes = exported
    assert (result["view"]["view_transform"], result["exposure_ev"]) == ("Filmic", 1.5)
    assert ("not-carried", "Metadata", "the picture is without it") in notes["Scene"]


def test_jumps_of_a_single_camera_are_cuts(exported):
    assert load_path(exported[0] / "camera_path.json", size=None, frames=None, fps=None).cuts == {3}


def test_glass_without_a_shadow_is_a_pane(exported):
    _, _, root, notes = exported
    assert bsdf_of(root, "Window").find(".//bsdf[@type='thindielectric']") is not None or (
        bsdf_of(root, "Window").get("type") == "thindielectric"
    )
    effect = "nothing is bent; thick objects cast shadows"
    assert notes["Window"] == [("approximated", "Ray visibility", effect)]
    assert notes["Board"] == [("not-carried", "Ray visibility", "it casts shadows")]


def test_walls_that_the_camera_does_not_see_are_marked(exported):
    _, _, root, notes = exported
    front, back = (bsdf_of(root, name) for name in ("Front wall", "Back wall"))
    assert (front.get("id"), back.get("id")) == (
        "hidden from the camera material plaster",
        "material plaster",
    )
    assert "Front wall" not in notes


def test_a_sun_behind_glass_is_noted_and_that_it_casts_shadows(exported):
    found = {node for _, node, _ in exported[3]["Sun"]}
    assert found == {"Sun", "Shadow"}


def test_lamps_that_change_are_noted(exported):
    _, result, _, notes = exported
    names = ["Shadowless", "Dimmed"] if result["blender"] >= "4.5" else ["Shadowless"]
    assert all(("not-carried", "Animation", "it stays as in frame 1") in notes[name] for name in names)


def test_ies_profiles_have_their_mean(exported):
    _, _, root, notes = exported
    lamps = [e for e in root.findall("emitter[@type='point']") if e.find("point").get("y") == "8"]
    intensity = float(lamps[0].find("rgb").get("value").split()[0])
    assert intensity == pytest.approx(2.0 * 10.0 / (4.0 * math.pi), rel=1e-3)
    assert notes["Downlight"] == [("approximated", "Nodes", "light is even in all directions")]


def test_roughness_that_is_changed_is_noted(exported):
    assert ("approximated", "Roughness", "highlights are smaller") in exported[3]["satin"]
    assert [node for _, node, _ in exported[3]["lacquer"]] == ["Principled BSDF: Coat IOR"]


def test_tiles_of_images_are_watched(exported):
    assert [file.rpartition("/")[2] for file in exported[1]["files"]] == ["tile.1001.png", "tile.1002.png"]
