"""Smooth coats: what they reflect of emitters is seen by camera rays, without noise."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from enfilade.arrays import Array3f, rows
from enfilade.kernels.random import one_sequence
from enfilade.methods.decoupled.integrator import Integrator
from enfilade.methods.decoupled.paths import spawn
from enfilade.renderer import Rays
from support.integrated import EMPTY
from support.mitsuba_scene import opened, placed, rgb, write

COUNT = 64
LAMP = placed(
    "rectangle", "lamp", (0, 0, 2), f'<emitter type="area">{rgb("radiance", 7, 7, 7)}</emitter>', 0.2
)
BLACK = rgb("diffuse_reflectance", 0, 0, 0)
COATS = {
    "plastic": f'<bsdf type="plastic">{BLACK}</bsdf>',
    "two-sided": f'<bsdf type="twosided"><bsdf type="plastic">{BLACK}</bsdf></bsdf>',
}
OTHERS = {
    "rough": f'<bsdf type="roughplastic">{BLACK}<float name="alpha" value="0.01"/></bsdf>',
    "mirror": '<bsdf type="conductor"/>',
    "cut-out": f'<bsdf type="mask"><float name="opacity" value="0.5"/>{COATS["plastic"]}</bsdf>',
}


def renderer_of(folder, bsdf):
    """A lamp that faces away from the camera, before a wall that reflects it."""
    turned = LAMP.replace("<translate", '<rotate y="1" angle="180"/><translate')
    return opened(write(folder, placed("rectangle", "wall", (0, 0, -2), bsdf, 4.0), turned, sky=""))


def rays(towards):
    """Rays to the wall from beside the lamp."""
    direction = np.array([towards, 0.0, -2.0]) - [1.0, 0.0, 2.0]
    return Rays(*(Array3f(*of) + dr.zeros(Array3f, COUNT) for of in ((1.0, 0.0, 2.0), direction.tolist())))


@pytest.mark.parametrize("name", COATS)
def test_a_coat_reflects_what_it_faces(tmp_path, name):
    renderer = renderer_of(tmp_path, COATS[name])
    cosine = 4.0 / np.hypot(4.0, 0.5)
    fresnel = mi.fresnel(mi.Float(cosine), 1.49 / 1.000277)[0][0]
    for towards, expected in ((0.5, 7.0 * fresnel), (-0.5, 0.0)):
        found = rows(renderer.coat_emission(renderer.intersect(rays(towards))))
        np.testing.assert_allclose(found, expected, rtol=1e-4)


@pytest.mark.parametrize("name", OTHERS)
def test_other_surfaces_do_not(tmp_path, name):
    renderer = renderer_of(tmp_path, OTHERS[name])
    assert not rows(renderer.coat_emission(renderer.intersect(rays(0.5)))).any()


def test_emission_in_a_coat_is_counted_once(tmp_path):
    renderer = renderer_of(tmp_path, COATS["plastic"])
    integrator = Integrator(renderer)
    seen, reflected = (
        rows(sum(of(EMPTY, spawn(rays(0.5), one_sequence(COUNT), spread=0.02)).layers, Array3f(0)))
        for of in (integrator.diffuse_radiance, integrator.specular_radiance)
    )
    expected = rows(renderer.coat_emission(renderer.intersect(rays(0.5))))
    np.testing.assert_allclose(seen, expected, rtol=1e-4)
    assert not reflected.any()
