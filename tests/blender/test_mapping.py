"""Functions from Blender's parameters to Mitsuba's."""

import math
from types import SimpleNamespace
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from enfilade_blender.lights import area_radiance, point_intensity, sphere_radiance
from enfilade_blender.materials import mapping
from enfilade_blender.materials.bsdfs import plastic_bsdf
from enfilade_blender.materials.context import Context
from enfilade_blender.materials.graph import Graph
from enfilade_blender.materials.links import depends_on_place
from enfilade_blender.materials.surfaces import inverted
from enfilade_blender.materials.textures import ENVIRONMENT, Textures, file_stem
from enfilade_blender.materials.values import AttributeValue, Constant, Output
from enfilade_blender.notes import Notes


@pytest.mark.parametrize(("level", "factor"), [(0.0, 0.0), (0.5, 1.0), (1.0, 2.0)])
def test_the_level_scales_the_reflectance_along_the_normal(level, factor):
    ior = mapping.interface_ior(1.5, level)
    assert ((ior - 1.0) / (ior + 1.0)) ** 2 == pytest.approx(0.04 * factor)


def test_a_metal_reflects_its_colour_along_the_normal_and_all_light_at_grazing_angles():
    colour = np.array([0.9, 0.5, 0.1])
    eta, k = mapping.conductor_ior(colour, np.ones(3))
    assert mapping.conductor_reflectance(eta, k, np.ones(3)) == pytest.approx(colour, abs=1e-6)
    assert mapping.conductor_reflectance(eta, k, np.full(3, 1e-6)) == pytest.approx(1.0, abs=1e-3)


def test_a_metal_is_near_schlicks_reflectance():
    cosine = np.linspace(0.1, 1.0, 20)
    for colour in (0.3, 0.6, 0.95):
        eta, k = mapping.conductor_ior(np.full(3, colour), np.ones(3))
        schlick = colour + (1.0 - colour) * (1.0 - cosine) ** 5
        # Schlick's curve has no exact index; a fit by its value along the normal alone is 0.15 away.
        assert mapping.conductor_reflectance(eta[0], k[0], cosine) == pytest.approx(schlick, abs=0.045)


def test_a_mapping_node_scales_then_turns_then_moves():
    matrix = np.array(mapping.uv_matrix("POINT", (0.5, 0.0, 0.0), (0.0, 0.0, math.pi / 2), (2.0, 3.0, 1.0)))
    assert matrix @ [1.0, 0.0, 1.0] == pytest.approx([0.5, 2.0, 1.0])
    assert matrix @ [0.0, 1.0, 1.0] == pytest.approx([-2.5, 0.0, 1.0])


def test_a_mapping_node_of_the_kind_texture_is_the_inverse_of_a_point():
    settings = (0.3, -0.2, 0.0), (0.0, 0.0, 0.7), (2.0, 0.5, 1.0)
    both = mapping.product(mapping.uv_matrix("TEXTURE", *settings), mapping.uv_matrix("POINT", *settings))
    assert np.array(both) == pytest.approx(np.eye(3), abs=1e-12)


@pytest.mark.parametrize("blend", [0.05, 0.5, 1.0])
def test_the_ramp_of_a_spot_has_the_flux_of_blenders(blend):
    half = 0.5
    outer, inner = mapping.spot_ramp(half, blend)
    angle = (np.arange(20000) + 0.5) / 20000 * 0.8
    x = np.clip((np.cos(angle) - math.cos(half)) / ((1.0 - math.cos(half)) * blend), 0.0, 1.0)
    theirs = x * x * (3.0 - 2.0 * x)
    ours = np.clip((outer - angle) / (outer - inner), 0.0, 1.0)
    flux = [np.sum(falloff * np.sin(angle)) for falloff in (theirs, ours)]
    assert flux[1] == pytest.approx(flux[0], rel=0.05)  # a line in place of a smooth step


def test_a_point_light_has_one_flux_with_and_without_radius():
    power, radius = 100.0, 0.25
    # Seen from afar, a sphere has the radiant intensity of its radiance times its cross section.
    assert sphere_radiance(power, radius) * math.pi * radius**2 == pytest.approx(point_intensity(power))


def test_an_area_light_emits_its_power():
    assert area_radiance(60.0, 2.0) * math.pi * 2.0 == pytest.approx(60.0)


@pytest.mark.parametrize("letter", ["a", "\N{CJK UNIFIED IDEOGRAPH-6905}"])
def test_file_names_are_short_enough_for_any_disk(letter):
    stem = file_stem(200 * letter + "$")
    assert 100 < len(stem.encode()) <= 120
    assert set(stem) == {letter}


def test_file_names_lack_the_characters_that_mitsuba_reads():
    assert file_stem("cost $5: a/b.c") == "cost _5_ a_b_c"


def test_the_number_of_a_colour_is_its_luminance():
    numbers = [Constant(value).number for value in ((0.3,), (1.0, 1.0, 1.0), (0.0, 1.0, 0.0))]
    assert numbers == pytest.approx([0.3, 1.0, 0.7152], abs=1e-4)


@pytest.mark.parametrize(
    ("socket", "node", "is_so"),
    [
        ("Normal", {"type": "NEW_GEOMETRY"}, True),
        ("Pointiness", {"type": "NEW_GEOMETRY"}, False),
        ("Object", {"type": "TEX_COORD", "object": "another"}, True),
        ("Object", {"type": "TEX_COORD", "object": None}, False),
        ("Vector", {"type": "VECT_TRANSFORM", "convert_from": "OBJECT", "convert_to": "WORLD"}, True),
        ("Vector", {"type": "VECT_TRANSFORM", "convert_from": "WORLD", "convert_to": "WORLD"}, False),
        ("Normal", {"type": "NORMAL_MAP", "space": "BLENDER_WORLD"}, True),
        ("Normal", {"type": "NORMAL_MAP", "space": "OBJECT"}, False),
    ],
)
def test_what_depends_on_the_place_in_the_world(socket, node, is_so):
    assert depends_on_place(Output(SimpleNamespace(name=socket, node=SimpleNamespace(**node)))) == is_so


@pytest.mark.parametrize(("given", "taken"), [(-0.3, 0.0), (3.0, 1.0)])
def test_a_plastic_s_roughness_is_between_0_and_1(tmp_path, given, taken):
    notes = Notes()
    context, grey = Context("wall", Textures(tmp_path, notes), notes), Constant((0.5,))
    found, wanted = (plastic_bsdf(grey, Constant((r,)), 1.5, context) for r in (given, taken))
    assert ET.tostring(found) == ET.tostring(wanted)


def test_a_reflectance_beyond_0_and_1_is_one_that_mitsuba_takes(tmp_path):
    textures = Textures(tmp_path, Notes())
    assert textures.colour(Constant((-1.0, 0.5, 1.0))) == (0.0, 0.5, 1.0)
    vector = textures.colour(Constant((-1.0, 0.5, 2.0))).find("vector")
    assert [vector.get(axis) for axis in "xyz"] == ["0", "0.5", "2"]


def test_no_texture_has_the_name_of_the_file_of_the_world(tmp_path):
    zeros = np.zeros((1, 1, 3), np.float32)
    file = Textures(tmp_path, Notes()).write(ENVIRONMENT, zeros, raw=True, is_exact=True)
    assert file != f"textures/{ENVIRONMENT}.exr"


@pytest.mark.parametrize(("kind", "number"), [("VECTOR", 0.6), ("RGBA", 0.2563)])
def test_the_number_of_a_group_s_default_is_that_of_its_kind(kind, number):
    default = SimpleNamespace(identifier="in", type=kind, is_linked=False, default_value=(0.9, 0.0, 0.9))
    inside = SimpleNamespace(node=SimpleNamespace(type="GROUP_INPUT", mute=False), identifier="in")
    link = SimpleNamespace(is_valid=True, is_muted=False, from_socket=inside)
    socket = SimpleNamespace(type="VALUE", is_linked=True, links=[link])
    value = Graph("wall", Notes()).value(socket, (SimpleNamespace(inputs=[default]),))
    assert value.number == pytest.approx(number, abs=1e-3)


def test_a_colour_attribute_that_numbers_are_computed_of_is_grey_and_noted(tmp_path):
    notes = Notes()
    context = Context("wall", Textures(tmp_path, notes), notes)
    value = AttributeValue(Output(SimpleNamespace(node=SimpleNamespace(name="Paint node"))), "", "wall")
    assert context.textures.colour(value).get("type") == "mesh_attribute"
    assert notes.to_list() == []
    assert inverted(value, context) == 0.5
    assert context.textures.scaled_number(value, 3.0) == 1.5
    assert [(note["object"], note["node"]) for note in notes.to_list()] == [("wall", "Paint node")]
