"""The tint of specular lobes: what textures colour, for filters that are to keep the texture."""

import drjit as dr
import numpy as np
import pytest

from enfilade.arrays import Array3f, Float, rows
from enfilade.renderer import Rays
from support.mitsuba_scene import HOLES, opened, placed, rgb, write, write_holes

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
SLOPES = HOLES.format("bump", "bilinear")
TEXTURED = {
    "metal": METAL,
    "mirror": f'<bsdf type="conductor">{CHECKS.format("specular_reflectance")}</bsdf>',
    "two-sided": f'<bsdf type="twosided">{METAL}</bsdf>',
    "principled": PRINCIPLED.format(1.0),
    "bumpy": f'<bsdf type="bumpmap">{SLOPES}{PRINCIPLED.format(1.0)}</bsdf>',
}
OTHERS = {
    "plain metal": '<bsdf type="roughconductor"/>',
    "plain principled": '<bsdf type="principled"><float name="metallic" value="1"/></bsdf>',
    "principled without metal": PRINCIPLED.format(0.0),
    "plastic": f'<bsdf type="roughplastic">{CHECKS.format("diffuse_reflectance")}</bsdf>',
    "translucent": f'<bsdf type="principledthin">{CHECKS.format("base_color")}'
    '<float name="diff_trans" value="1"/></bsdf>',
    "one side": f'<bsdf type="twosided"><bsdf type="roughconductor"/>{METAL}</bsdf>',
    "coated": PRINCIPLED.format(1.0).replace("</bsdf>", '<float name="clearcoat" value="1"/></bsdf>'),
    "blend": f'<bsdf type="blendbsdf"><float name="weight" value="0.5"/><bsdf type="diffuse"/>{METAL}</bsdf>',
}


def tints(folder, bsdf, cosine=1.0):
    """Whether a renderer has textured metal; tints of both halves of a wall, and if from textures."""
    write_holes(folder)
    renderer = opened(write(folder, placed("rectangle", "wall", (0, 0, 0), bsdf)))
    slope = float(np.sqrt(1.0 - cosine**2))
    direction = Array3f(0.0, slope, -cosine) + dr.zeros(Array3f, 2)
    rays = Rays(Array3f(Float(-0.1, 0.1), 0.05, 0.0) - 3.0 * direction, direction)
    tint, is_textured = renderer.specular_tint(renderer.intersect(rays))
    return renderer.has_specular_texture(), rows(tint), np.array(is_textured)


@pytest.mark.parametrize("name", TEXTURED)
def test_it_is_that_of_the_texture(tmp_path, name):
    has_texture, found, is_textured = tints(tmp_path, TEXTURED[name])
    assert has_texture
    assert is_textured.all()
    np.testing.assert_allclose(np.sort(found, axis=0), [[DARK] * 3, [BRIGHT] * 3], rtol=1e-5)


@pytest.mark.parametrize("name", OTHERS)
def test_others_have_one_value(tmp_path, name):
    has_texture, found, is_textured = tints(tmp_path, OTHERS[name])
    assert not has_texture
    assert not is_textured.any()
    np.testing.assert_array_equal(found, found[0, 0])
    assert 0.01 <= found[0, 0] <= 1.0


def test_cut_outs_show_what_has_another_colour(tmp_path):
    _, found, _ = tints(tmp_path, f'<bsdf type="mask"><float name="opacity" value="0.7"/>{METAL}</bsdf>')
    np.testing.assert_allclose(np.sort(found[:, 0]), [0.3 + 0.7 * DARK, 0.3 + 0.7 * BRIGHT], rtol=1e-5)


@pytest.mark.parametrize("metallic", [0.5, 1.0])
def test_grazing_principled_metal_loses_its_colour(tmp_path, metallic):
    _, found, _ = tints(tmp_path, PRINCIPLED.format(metallic), cosine=0.2)
    normal = np.array([0.04 + (colour - 0.04) * metallic for colour in (DARK, BRIGHT)])
    expected = normal + (1.0 - normal) * (1.0 - 0.2) ** 5
    np.testing.assert_allclose(np.sort(found[:, 0]), expected, rtol=1e-4)


def test_it_is_zero_where_nothing_is_specular(tmp_path):
    _, found, _ = tints(tmp_path, '<bsdf type="diffuse"/>')
    np.testing.assert_array_equal(found, 0.0)
