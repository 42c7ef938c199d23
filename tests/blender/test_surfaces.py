"""Surfaces of shaders, without Blender."""

from dataclasses import replace
from types import SimpleNamespace
from xml.etree import ElementTree as ET

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from enfilade_blender.materials.bsdfs import with_normal
from enfilade_blender.materials.context import Context
from enfilade_blender.materials.surfaces import build
from enfilade_blender.materials.textures import Textures
from enfilade_blender.materials.values import (
    Constant,
    Lobe,
    Mix,
    NormalMap,
    Output,
    Principled,
    Texture,
)
from enfilade_blender.notes import Notes
from enfilade_blender.scene_xml import plugin

SAMPLES = 100_000
WHITE = Constant((1.0, 1.0, 1.0))
CLEAR = Lobe("transparent", WHITE, "clear")


@pytest.fixture
def context(tmp_path):
    notes = Notes()
    return Context("wall", Textures(tmp_path, notes), notes)


def noted(context):
    return [note["what"] for note in context.notes.to_list()]


def loaded(shader, context):
    text = ET.tostring(build(shader, context).element(context), encoding="unicode")
    return mi.load_string(text.replace(" type", ' version="3.0.0" type', 1))


def passed(shader, context):
    """Share of light that passes a surface along its normal."""
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = mi.Vector3f(0.0, 0.0, 1.0)
    return np.array(loaded(shader, context).eval_null_transmission(si)).ravel()


def albedo(shader, context):
    """Share of uniform light that Mitsuba's samples reflect."""
    u = np.random.default_rng(1).random((4, SAMPLES), np.float32)
    cosine = mi.Float(np.sqrt(u[0]))  # directions weighted by their cosine
    si = dr.zeros(mi.SurfaceInteraction3f, SAMPLES)
    si.wi = mi.Vector3f(dr.sqrt(1.0 - cosine * cosine), 0.0, cosine)
    _, weight = loaded(shader, context).sample(mi.BSDFContext(), si, mi.Float(u[1]), mi.Point2f(u[2], u[3]))
    return float(dr.mean(weight.x)[0])


@pytest.mark.parametrize(
    ("roughness", "notes"), [(0.0, []), (0.2, ["the roughness of reflections is left out"])]
)
def test_a_thin_pane_passes_what_fresnels_factor_does_not_reflect(context, roughness, notes):
    """Mitsuba's pane reflects at both of its sides, the mix of Cycles once."""
    gloss = Lobe("glossy", WHITE, "gloss", Constant((roughness,)))
    share = passed(Mix(Constant((0.5,)), CLEAR, gloss, 1.8, "mix"), context)
    assert share == pytest.approx(1.0 - (0.8 / 2.8) ** 2, abs=1e-4)
    assert noted(context) == notes


@pytest.mark.parametrize("roughness", [0.0, 0.4])
@pytest.mark.parametrize("ior", [1.5, 1 / 1.5])
def test_a_sheet_of_glass_keeps_the_energy_of_light_from_both_sides(context, roughness, ior):
    glass = Lobe("glass", WHITE, "glass", Constant((roughness,)), Constant((ior,)))
    assert albedo(glass, replace(context, is_sheet=True)) == pytest.approx(1.0, abs=0.05)
    assert noted(context) == ["glass of an open mesh is a thin pane"]
    assert abs(albedo(glass, context) - 1.0) > 0.3  # of an interface, whose other side undoes that


@pytest.mark.parametrize(
    ("colour", "roughness", "kind"),
    [
        (0.8, 0.55, "roughplastic"),
        (0.8, 0.6, "roughplastic"),
        (0.8, 0.7, "diffuse"),
        (0.4, 0.7, "roughplastic"),
        (0.4, 0.79, "diffuse"),
        (0.1, 0.8, "diffuse"),
    ],
)
def test_plastic_is_matt_where_its_highlights_are_faint_beside_its_colour(context, colour, roughness, kind):
    inputs = {"Base Color": Constant((colour,) * 3), "Roughness": Constant((roughness,))}
    plain = build(Principled(inputs, None, "paint"), context).plain()
    assert plain.get("type") == kind
    assert bool(noted(context)) == (0.55 < roughness < 0.8)


@pytest.mark.parametrize(("roughness", "share"), [(0.3, 0.031), (0.5, 0.114), (1.0, 0.445)])
def test_sheen_reflects_the_share_that_it_does_in_cycles(context, roughness, share):
    black = {"Base Color": Constant((0.0, 0.0, 0.0)), "Specular IOR Level": Constant((0.0,))}
    sheen = {"Sheen Weight": Constant((1.0,)), "Sheen Roughness": Constant((roughness,))}
    assert albedo(Principled({**black, **sheen}, None, "cloth"), context) == pytest.approx(share, rel=0.05)


GREY, ROUGH = Constant((0.5, 0.5, 0.5)), Constant((0.9,))
METAL = {"Base Color": GREY, "Metallic": Constant((1.0,)), "Roughness": ROUGH}


@pytest.mark.parametrize(
    ("shader", "name", "own"),
    [
        (Lobe("glossy", GREY, "lobe", ROUGH), "specular_reflectance", 0.5),
        (Lobe("glass", GREY, "lobe", ROUGH, Constant((1.5,))), "specular_transmittance", 0.5),
        (Principled(METAL, None, "metal"), "specular_reflectance", 1.0),
    ],
)
def test_microfacets_of_single_scattering_have_no_gain(context, shader, name, own):
    tints = []
    for is_multiple in (True, False):
        bsdf = build(replace(shader, is_multiple=is_multiple), context).plain()
        (tint,) = bsdf.findall(f"*[@name='{name}']")
        numbers = tint.get("value") or tint.find("vector").get("x")
        tints.append(float(numbers.split()[0]))
    assert tints[0] > 1.2 * own
    assert tints[1] == own


@pytest.mark.parametrize(
    ("colour", "share", "notes"),
    [
        ((1.0, 1.0, 1.0), 1.0, []),
        ((0.25, 0.25, 0.25), 0.25, []),
        ((0.0, 0.0, 0.0), 0.0, []),
        ((0.0, 1.0, 0.0), 0.7152, ["the tint of transparency is left out"]),
    ],
)
def test_transparency_passes_its_luminance(context, colour, share, notes):
    assert passed(replace(CLEAR, colour=Constant(colour)), context) == pytest.approx(share, abs=1e-3)
    assert noted(context) == notes


NONE, ONE = Constant((0.0,)), Constant((1.0,))
COAT = {"Coat Weight": ONE, "Coat Roughness": Constant((0.03,))}
MATT = {"Base Color": GREY, "Specular IOR Level": NONE}


@pytest.mark.parametrize("base", [MATT, METAL, METAL | {"Roughness": NONE}, {"Roughness": NONE}])
def test_coats_keep_their_energy(context, base):
    """Mitsuba mixes the density of rough parts of a blend into samples of smooth ones."""
    below, coated = (albedo(Principled(inputs, None, "base"), context) for inputs in (base, base | COAT))
    reflected = 0.0918  # of an index of 1.5
    assert coated == pytest.approx((1.0 - reflected) * below + reflected, rel=0.03)


def test_a_mix_with_a_mirror_keeps_its_energy(context):
    mix = Mix(Constant((0.5,)), Lobe("diffuse", GREY, "paint"), Lobe("glossy", WHITE, "mirror"), None, "mix")
    assert albedo(mix, context) == pytest.approx(0.75, rel=0.01)


@pytest.fixture
def rewritten(context, monkeypatch):
    """Writes a normal map of one colour; its name in the scene, and the images that are written for it."""
    written = []

    def write(_self, _name, image, **_options):
        written.append(image)
        return "textures/rewritten.png"

    def make(colour, *terms):
        monkeypatch.setattr(Textures, "pixels", lambda *_: np.full((2, 2, 3), colour, np.float32))
        monkeypatch.setattr(Textures, "write", write)
        output = Output(SimpleNamespace(node=SimpleNamespace(type="NORMAL_MAP")))
        texture = Texture("textures/tilted.png", "UVMap", colour, raw=True)
        bsdf = with_normal(
            plugin("bsdf", "diffuse"), NormalMap(texture, *terms[:1], output, *terms[1:]), context
        )
        return bsdf.find("texture/string[@name='filename']").get("value"), written

    return make


@pytest.mark.parametrize(("is_flipped", "green"), [(False, None), (True, 0.2)])
def test_normal_maps_of_directx_have_green_downwards(rewritten, is_flipped, green):
    name, written = rewritten((0.5, 0.8, 0.9), 1.0, is_flipped)
    assert name == ("textures/tilted.png" if green is None else "textures/rewritten.png")
    assert [float(image[..., 1].mean()) for image in written] == pytest.approx(
        [] if green is None else [green]
    )


@pytest.mark.parametrize(
    ("strength", "normal"), [(0.5, (0.447, 0.894)), (2.0, (0.936, 0.351)), (4.0, (0.983, 0.184))]
)
def test_strong_normal_maps_point_outwards(rewritten, strength, normal):
    """Numbers of normals that Cycles bakes."""
    _, (image,) = rewritten((0.9, 0.5, 0.8), strength)
    assert image[0, 0, [0, 2]] * 2.0 - 1.0 == pytest.approx(normal, abs=1e-3)


def test_a_glossy_layer_over_refraction_is_glass(context):
    below = Lobe("refraction", WHITE, "below", Constant((0.0,)), Constant((1.5,)))
    gloss = Lobe("glossy", Constant((0.5, 0.5, 0.5)), "gloss", Constant((0.0,)))
    bsdf = build(Mix(Constant((0.5,)), below, gloss, 1.5, "mix"), context).plain()
    assert bsdf.get("type") == "dielectric"
    assert bsdf.find("rgb[@name='specular_reflectance']").get("value").split() == ["0.5"] * 3
    assert noted(context) == []
    build(below, context)
    assert noted(context) == ["glass, which also reflects"]
