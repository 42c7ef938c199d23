"""Lights of Blender, as emitters: records in, elements out."""

import math
from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from enfilade_blender.lights import (
    Sun,
    emitters,
    is_portal,
    needs_passing,
    note_glass,
    split_suns,
)
from enfilade_blender.notes import Notes
from enfilade_blender.records import Lamp
from enfilade_blender.scene_xml import LAMP, Identifiers, named, plugin, write_scene

SAMPLES = 20_000
ABOVE = np.eye(4)
ABOVE[2, 3] = 2.0  # shines down


def lamp(kind, name="Lamp", matrix=ABOVE, **settings):
    defaults = {
        "type": kind, "energy": 100.0, "color": (1.0, 1.0, 1.0), "use_nodes": False, "use_shadow": True,
        "shadow_soft_size": 0.0, "shape": "SQUARE", "size": 1.0, "size_y": 1.0, "angle": 0.0,
        "spot_size": 1.0, "spot_blend": 0.2,
    }  # fmt: skip
    return Lamp(name, SimpleNamespace(**(defaults | settings)), matrix)


def irradiance(tmp_path, light):
    """Irradiance at the origin, on a plane that faces up."""
    elements = [named(plugin("bsdf", "null"), LAMP), *emitters(light, Identifiers(), Notes())]
    write_scene(tmp_path / "scene.xml", elements)
    scene = mi.load_file(str(tmp_path / "scene.xml"))
    si = dr.zeros(mi.SurfaceInteraction3f, SAMPLES)
    si.n = mi.Normal3f(0.0, 0.0, 1.0)
    rng = np.random.default_rng(1)
    sample = mi.Point2f(*rng.random((2, SAMPLES), np.float32))
    direction, weight = scene.sample_emitter_direction(si, sample, test_visibility=False)
    return float(np.mean(np.array(weight.x) * np.array(direction.d.z)))


@pytest.mark.parametrize(
    ("light", "expected"),
    [
        (lamp("POINT"), 100.0 / (4.0 * math.pi) / 4.0),  # intensity over the squared distance
        (lamp("POINT", shadow_soft_size=0.1), 100.0 / (4.0 * math.pi) / 4.0),
        (lamp("SPOT"), 100.0 / (4.0 * math.pi) / 4.0),
        (lamp("SUN", energy=3.0), 3.0),
        # Measured in Cycles, with lights that are not normalized.
        (lamp("POINT", shadow_soft_size=0.5, normalize=False), 100.0 / 4.0 * 0.25),
        (lamp("POINT", normalize=False), 100.0 / math.pi / 4.0),
        (lamp("SUN", energy=3.0, angle=1.0, normalize=False), 3.0 * math.pi * math.sin(0.5) ** 2),
        (lamp("AREA", size=0.01), 100.0 / math.pi / 4.0),  # far away, on its axis
        (lamp("AREA", size=0.01, shape="DISK"), 100.0 / math.pi / 4.0),
        (lamp("AREA", size=0.01, size_y=0.02, shape="ELLIPSE"), 100.0 / math.pi / 4.0),
    ],
)
def test_irradiance_below_a_light(tmp_path, light, expected):
    assert irradiance(tmp_path, light) == pytest.approx(expected, rel=0.01)


def test_power_does_not_change_with_the_scale_of_the_object(tmp_path):
    large = lamp("AREA", matrix=ABOVE @ np.diag([3.0, 3.0, 3.0, 1.0]), size=0.01)
    assert irradiance(tmp_path, large) == pytest.approx(100.0 / math.pi / 4.0, rel=0.01)


@pytest.mark.parametrize(("place", "is_lit"), [((0.8, 0.0), True), ((0.0, 0.8), False), ((0.0, 0.3), True)])
def test_a_spot_of_uneven_scale_is_an_ellipse(tmp_path, place, is_lit):
    """As Cycles has it: half of its angle is a radius of 1.1 along x on the ground, and of 0.4 along y."""
    matrix = ABOVE @ np.diag([1.0, 0.35, 1.0, 1.0])
    matrix[:2, 3] = place
    squared = 4.0 + np.square(place).sum()
    expected = 100.0 / (4.0 * math.pi) * 2.0 / squared**1.5 if is_lit else 0.0
    assert irradiance(tmp_path, lamp("SPOT", matrix=matrix, spot_blend=0.0)) == pytest.approx(
        expected, rel=0.01
    )


def test_a_dark_lamp_is_left_out():
    notes = Notes()
    assert emitters(lamp("POINT", energy=0.0), Identifiers(), notes) == []
    assert notes.to_list() == []


@pytest.mark.parametrize("angle", [0.0, 0.1])
def test_a_sun_without_a_direction_is_dark(angle):
    flat = lamp("SUN", matrix=np.diag([1.0, 1.0, 0.0, 1.0]), angle=angle)
    lamps, sun = split_suns([flat], Notes())
    assert (sun, emitters(lamps[0], Identifiers(), Notes())) == (None, [])


def test_a_lamp_that_takes_light_away_is_left_out_and_noted():
    notes = Notes()
    assert emitters(lamp("POINT", "Dimmer", energy=-10.0), Identifiers(), notes) == []
    assert [(note["object"], note["what"]) for note in notes.to_list()] == [
        ("Dimmer", "its negative light is left out")
    ]


def test_a_material_may_have_the_name_of_the_lamps():
    assert Identifiers().unique(LAMP) != LAMP


def test_a_portal_is_an_area_light_that_is_marked():
    marks = [SimpleNamespace(is_portal=is_marked) for is_marked in (True, False)]
    assert [is_portal(lamp("AREA", cycles=mark)) for mark in marks] == [True, False]
    assert not is_portal(lamp("POINT"))


def test_the_brightest_sun_with_a_disc_is_in_the_environment():
    notes = Notes()
    weak, bright = lamp("SUN", "weak", angle=0.1, energy=1.0), lamp("SUN", "bright", angle=0.1, energy=3.0)
    rest, sun = split_suns([weak, bright, lamp("SUN", "sharp")], notes)
    assert (sun.name, [light.name for light in rest]) == ("bright", ["weak", "sharp"])
    assert [note["object"] for note in notes.to_list()] == ["weak"]


def test_lamps_of_a_size_that_shadow_rays_alone_reach_are_noted_where_glass_is():
    notes = Notes()
    small, dark = lamp("SPOT", "small"), lamp("SPOT", "dark", shadow_soft_size=0.1, energy=0.0)
    large, soft = lamp("SPOT", "large", shadow_soft_size=0.1), lamp("SUN", "soft", angle=0.1)
    note_glass([small, dark, large, soft, lamp("POINT"), lamp("AREA")], notes)
    assert [note["object"] for note in notes.to_list()] == ["large", "soft"]


@pytest.mark.parametrize(
    ("kinds", "has_sun", "expected"),
    [
        (("SPOT", "AREA"), False, True),
        (("SPOT",), True, False),
        (("AREA",), True, True),
        (("AREA",), False, False),
    ],
)
def test_shadow_rays_have_to_pass_lamps_in_the_way_of_hard_light(kinds, has_sun, expected):
    names = Identifiers()
    made = [element for kind in kinds for element in emitters(lamp(kind), names, Notes())]
    sun = Sun("Sun", np.array([0.0, 0.0, 1.0]), (1.0, 1.0, 1.0), 0.01) if has_sun else None
    assert needs_passing(made, sun) == expected
