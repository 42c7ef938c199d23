"""Surfaces of shaders, without Blender."""

from xml.etree import ElementTree as ET

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from enfilade_blender.materials.bsdfs import Context
from enfilade_blender.materials.surfaces import build
from enfilade_blender.materials.textures import Textures
from enfilade_blender.materials.values import Constant, Lobe, Mix
from enfilade_blender.notes import Notes

WHITE = Constant((1.0, 1.0, 1.0))
CLEAR = Lobe("transparent", WHITE, "clear")


@pytest.fixture
def context(tmp_path):
    notes = Notes()
    return Context("wall", Textures(tmp_path, notes), notes)


def noted(context):
    return [note["what"] for note in context.notes.to_list()]


def passed(shader, context):
    """Share of light that passes a surface along its normal."""
    element = build(shader, context).element(context)
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = mi.Vector3f(0.0, 0.0, 1.0)
    bsdf = mi.load_string(
        ET.tostring(element, encoding="unicode").replace(" type", ' version="3.0.0" type', 1)
    )
    return np.array(bsdf.eval_null_transmission(si)).ravel()


@pytest.mark.parametrize(
    ("roughness", "notes"), [(0.0, []), (0.2, ["the roughness of reflections is left out"])]
)
def test_a_thin_pane_passes_what_fresnels_factor_does_not_reflect(context, roughness, notes):
    """Mitsuba's pane reflects at both of its sides, the mix of Cycles once."""
    gloss = Lobe("glossy", WHITE, "gloss", Constant((roughness,)))
    share = passed(Mix(Constant((0.5,)), CLEAR, gloss, 1.8, "mix"), context)
    assert share == pytest.approx(1.0 - (0.8 / 2.8) ** 2, abs=1e-4)
    assert noted(context) == notes
