"""The tint of specular lobes: what textures colour, for filters that are to keep the texture."""

import drjit as dr
import numpy as np
import pytest

from enfilade.arrays import Array3f, Float, rows
from enfilade.renderer import Rays
from support.mitsuba_scene import opened, placed, rgb, write

DARK, BRIGHT = 0.3, 0.9  # of the left half of each texture, and of the right one
CHECKS = (
    f'<texture type="checkerboard" name="{{}}">{rgb("color0", DARK, DARK, DARK)}'
    f'{rgb("color1", BRIGHT, BRIGHT, BRIGHT)}<transform name="to_uv"><scale x="1" y="0.5"/></transform>'
    "</texture>"
)
ROUGH = '<float name="alpha" value="0.3"/>'
METAL = f'<bsdf type="roughconductor">{ROUGH}{CHECKS.format("specular_reflectance")}</bsdf>'
PRINCIPLED = (
    f'<bsdf type="principled">{CHECKS.format("base_color")}<float name="metallic" value="{{}}"/>'
    '<float name="roughness" value="0.5"/></bsdf>'
)
TEXTURED = {
    "metal": METAL,
    "two-sided": f'<bsdf type="twosided">{METAL}</bsdf>',
    "principled": PRINCIPLED.format(1.0),
}
OTHERS = {
    "plain metal": '<bsdf type="roughconductor"/>',
    "plain principled": '<bsdf type="principled"><float name="metallic" value="1"/></bsdf>',
    "principled without metal": PRINCIPLED.format(0.0),
    "plastic": f'<bsdf type="roughplastic">{CHECKS.format("diffuse_reflectance")}</bsdf>',
    "mirror": f'<bsdf type="conductor">{CHECKS.format("specular_reflectance")}</bsdf>',
}


def tints(folder, bsdf):
    """Whether a renderer has tints, and that of both halves of a wall, (2, 3)."""
    renderer = opened(write(folder, placed("rectangle", "wall", (0, 0, 0), bsdf)))
    x = Float(-0.1, 0.1)
    rays = Rays(Array3f(x, 0.05, 3.0), Array3f(0.0, 0.0, -1.0) + dr.zeros(Array3f, 2))
    return renderer.has_specular_texture(), rows(renderer.specular_tint(renderer.intersect(rays)))


@pytest.mark.parametrize("name", TEXTURED)
def test_it_is_proportional_to_the_texture(tmp_path, name):
    has_texture, found = tints(tmp_path, TEXTURED[name])
    assert has_texture
    np.testing.assert_allclose(found.max(axis=0) / found.min(axis=0), BRIGHT / DARK, rtol=0.01)


@pytest.mark.parametrize("name", OTHERS)
def test_it_is_one_where_no_texture_colours_a_lobe(tmp_path, name):
    has_texture, found = tints(tmp_path, OTHERS[name])
    assert has_texture == (name == "mirror")
    np.testing.assert_array_equal(found, 1.0)
