"""Bump maps with flat parts, on walls of all directions."""

import mitsuba as mi
import numpy as np
import pytest
from PIL import Image

from enfilade.device import active
from enfilade.scene.mitsuba.load import load_scene
from support.mitsuba_scene import opened

PLASTIC = '<bsdf type="roughplastic"/>'


def reflected(folder, bsdf, turned):
    """Values of the BSDF of the front of a cube, in a grid of points."""
    shape = f'<shape type="cube"><transform name="to_world">{turned}</transform>{bsdf}</shape>'
    file = folder / "scene.xml"
    file.write_text(f'<scene version="3.0.0"><emitter type="constant"/>{shape}</scene>')
    scene = load_scene(file)
    y, z = (lane.ravel() for lane in np.meshgrid(np.linspace(-0.95, 0.95, 20), np.linspace(-0.95, 0.95, 20)))
    hit = scene.ray_intersect(mi.Ray3f(mi.Point3f(-2.0, y, z), mi.Vector3f(1.0, 0.0, 0.0)))
    return np.array(hit.bsdf().eval(mi.BSDFContext(), hit, mi.Vector3f(0.3, 0.1, 0.9)))


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("angle", [0, 90, 180, 270])
def test_flat_parts_are_those_of_the_bsdf_below(tmp_path, axis, angle):
    """They were NaN where U runs along z."""
    mi.set_variant(active().variant)
    Image.new("L", (4, 4), 128).save(tmp_path / "flat.png")
    flat = (
        '<texture type="bitmap"><string name="filename" value="flat.png"/><boolean name="raw" value="true"/>'
    )
    turned = f'<rotate {axis}="1" angle="{angle}"/>'
    found = reflected(tmp_path, f'<bsdf type="bumpmap">{flat}</texture>{PLASTIC}</bsdf>', turned)
    expected = reflected(tmp_path, PLASTIC, turned)
    assert expected.min() > 0.1
    np.testing.assert_allclose(found, expected, rtol=0.01)


@pytest.mark.parametrize(("angle", "is_told"), [(90, True), (270, True), (0, False), (45, False)])
def test_rectangles_that_lose_light_are_told(tmp_path, angle, is_told):
    Image.new("L", (4, 4), 128).save(tmp_path / "flat.png")
    flat = (
        '<texture type="bitmap"><string name="filename" value="flat.png"/><boolean name="raw" value="true"/>'
    )
    bumpy = f'<bsdf type="bumpmap">{flat}</texture>{PLASTIC}</bsdf>'
    wall = f'<transform name="to_world"><rotate y="1" angle="{angle}"/></transform>'
    shape = f'<shape type="rectangle" id="wall">{wall}{bumpy}</shape>'
    file = tmp_path / "scene.xml"
    file.write_text(f'<scene version="3.0.0"><emitter type="constant"/>{shape}</scene>')
    notes = opened(file).describe().notes
    assert any("the rectangle wall loses light" in note for note in notes) == is_told
