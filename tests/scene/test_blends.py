"""Blends of delta lobes and others: their light is that of their parts."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from enfilade.device import active
from enfilade.kernels.random import one_sequence
from enfilade.scene.mitsuba.lobes import Lobes

COUNT = 1 << 16
PARTS = {
    "mirror": '<bsdf type="conductor"><rgb name="specular_reflectance" value="0.8"/></bsdf>',
    "plastic": '<bsdf type="plastic"/>',
    "rough metal": '<bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf>',
    "rough plastic": '<bsdf type="roughplastic"><float name="alpha" value="0.15"/></bsdf>',
    "diffuse": '<bsdf type="diffuse"/>',
    "principled": '<bsdf type="principled"><float name="metallic" value="0.3"/></bsdf>',
}


def blend(weight, first, second):
    return f'<bsdf type="blendbsdf"><float name="weight" value="{weight}"/>{first}{second}</bsdf>'


def albedo(bsdf):
    """What a surface reflects of a constant environment, by both of its lobes."""
    mi.set_variant(active().variant)
    scene = mi.load_string(f'<scene version="3.0.0"><shape type="sphere">{bsdf}</shape></scene>')
    lobes, sampler = Lobes(scene), one_sequence(COUNT, 1)
    si = dr.zeros(mi.SurfaceInteraction3f, COUNT)
    si.shape = mi.ShapePtr(scene.shapes()[0])
    si.t, si.wi = mi.Float(1.0), dr.normalize(mi.Vector3f(0.4, 0.0, 1.0))
    own = lobes.albedo(si, si.bsdf(), mi.Bool(True))
    *_, diffuse = lobes.sample_diffuse(si, si.bsdf(), own, sampler, mi.Bool(True))
    _, _, specular, *_ = lobes.sample_specular(si, si.bsdf(), own, sampler)
    return sum(float(np.mean(np.array(mi.Color3f(weight)))) for weight in (diffuse, specular))


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("rough plastic", "mirror"),
        ("plastic", "rough metal"),
        ("plastic", "mirror"),
        ("diffuse", "mirror"),
        ("principled", "mirror"),
    ],
)
@pytest.mark.parametrize("weight", [0.1, 0.5])
def test_a_blend_reflects_the_light_of_its_parts(first, second, weight):
    expected = (1.0 - weight) * albedo(PARTS[first]) + weight * albedo(PARTS[second])
    assert albedo(blend(weight, PARTS[first], PARTS[second])) == pytest.approx(expected, rel=0.01)


def test_blends_of_blends():
    inner = blend(0.6, PARTS["mirror"], PARTS["diffuse"])
    parts = {0.28: "mirror", 0.42: "diffuse", 0.3: "rough plastic"}
    expected = sum(share * albedo(PARTS[name]) for share, name in parts.items())
    assert albedo(blend(0.3, inner, PARTS["rough plastic"])) == pytest.approx(expected, rel=0.01)
