"""Virtual images: apparent positions of surfaces seen in mirrors and through glass."""

import numpy as np
import pytest

from enfilade.camera.pinhole import Camera, look_at
from enfilade.gbuffer import find_geometry, positions
from enfilade.methods.decoupled.virtual_images import IN_VIRTUAL_IMAGE, VirtualImages
from enfilade.scene.mitsuba.renderer import MitsubaRenderer
from enfilade.scene.mitsuba.shapes import LAMP
from support.material_scene import MATERIALS, front_camera, opened_scene, pane


def test_virtual_images_of_a_mirror_lie_behind_it(tmp_path):
    mirror = (
        '</shape><shape type="rectangle" id="mirror"><transform name="to_world"><scale value="3"/>'
        '<translate z="-1.4"/></transform><bsdf type="conductor"/>'
    )
    renderer, camera = opened_scene(tmp_path, {"ball": mirror}), front_camera()
    seen = find_geometry(renderer, camera)
    shown, _ = VirtualImages(renderer).find(seen)
    names = renderer.describe().shapes
    is_floor = shown.shape_index == IN_VIRTUAL_IMAGE + names.index("floor") + 1
    assert is_floor.sum() > 20
    points = positions(shown)[is_floor]
    # The floor, y = 0, continues behind an upright mirror.
    np.testing.assert_allclose(points[:, 1], 0.0, atol=2e-3)
    assert points[:, 2].max() < -1.4
    # The last lane is followed by padding.
    last = np.flatnonzero(seen.shape_index == names.index("mirror") + 1)[-1]
    assert is_floor.ravel()[last]
    is_same = shown.shape_index == seen.shape_index
    np.testing.assert_array_equal(shown.depth[is_same], seen.depth[is_same])


def test_rough_glass_has_no_virtual_image(tmp_path):
    balls = {"rough": MATERIALS["roughdielectric"], "glass": MATERIALS["thindielectric"]}
    renderer, camera = opened_scene(tmp_path, balls), front_camera()
    seen = find_geometry(renderer, camera)
    shown, _ = VirtualImages(renderer).find(seen)
    rough, glass = (seen.shape_index == renderer.describe().shapes.index(name) + 1 for name in balls)
    assert rough.sum() > 20
    np.testing.assert_array_equal(shown.shape_index[rough], seen.shape_index[rough])
    np.testing.assert_array_equal(shown.depth[rough], seen.depth[rough])
    assert (shown.shape_index[glass] >= IN_VIRTUAL_IMAGE).all()


IOR = '<float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/>'
SMOOTH = {
    "metal": '<bsdf type="conductor"/>',
    "both sides": '<bsdf type="twosided"><bsdf type="conductor"/></bsdf>',
    "glass": f'<bsdf type="dielectric">{IOR}</bsdf>',
}
PRINCIPLED = (
    '<bsdf type="principled"><float name="eta" value="1.5"/><float name="roughness" value="{}"/>{}</bsdf>'
)
METALLIC, CLEAR = (f'<float name="{name}" value="1"/>' for name in ("metallic", "spec_trans"))


def of_roughness(roughness):
    alpha = f'<float name="alpha" value="{roughness**2}"/>'
    plugins = {
        "metal": f'<bsdf type="roughconductor">{alpha}</bsdf>',
        "both sides": f'<bsdf type="twosided"><bsdf type="roughconductor">{alpha}</bsdf></bsdf>',
        "glass": f'<bsdf type="roughdielectric">{alpha}{IOR}</bsdf>',
    }
    metal, glass = (PRINCIPLED.format(roughness, kind) for kind in (METALLIC, CLEAR))
    both_sides = f'<bsdf type="twosided">{metal}</bsdf>'
    return [plugins, {"metal": metal, "both sides": both_sides, "glass": glass}]


@pytest.mark.parametrize("kind", [0, 1], ids=["plugins", "principled"])
def test_nearly_smooth_lobes_show_the_images_of_smooth_ones(tmp_path, kind):
    def images(balls):
        renderer = opened_scene(tmp_path, balls)
        seen = find_geometry(renderer, front_camera())
        is_ball = np.isin(seen.shape_index, [renderer.describe().shapes.index(n) + 1 for n in balls])
        return np.array([image.shape_index[is_ball] for image in VirtualImages(renderer).find(seen)])

    smooth = images(SMOOTH)
    assert (smooth[0] >= IN_VIRTUAL_IMAGE).all()
    assert np.mean(images(of_roughness(0.03)[kind]) == smooth) > 0.9
    assert (images(of_roughness(0.2)[kind]) < IN_VIRTUAL_IMAGE).all()


def test_surfaces_behind_a_pane_keep_their_positions(tmp_path):
    bare, camera = opened_scene(tmp_path, {"ball": MATERIALS["diffuse"]}), front_camera()
    behind = find_geometry(bare, camera)
    renderer = opened_scene(tmp_path, {"ball": pane("front", 1.0)})
    seen, images = find_geometry(renderer, camera), VirtualImages(renderer)
    where = seen.shape_index == renderer.describe().shapes.index("front") + 1
    assert where.sum() > 50
    mirrored, through = images.find(seen)
    np.testing.assert_allclose(positions(through)[where], positions(behind)[where], atol=2e-3)
    names = renderer.describe().shapes
    assert set(through.shape_index[where]) == {
        IN_VIRTUAL_IMAGE + names.index(name) + 1 for name in ("ball", "floor", "back")
    }
    # The reflected floor continues behind the pane.
    is_floor = where & (mirrored.shape_index == IN_VIRTUAL_IMAGE + names.index("floor") + 1)
    assert is_floor.sum() > 20
    np.testing.assert_allclose(positions(mirrored)[is_floor][:, 1], 0.0, atol=2e-3)
    assert positions(mirrored)[is_floor][:, 2].max() < 1.0
    assert (mirrored.shape_index != through.shape_index)[where].mean() > 0.3


def test_virtual_images_lie_behind_the_clear_parts_of_cut_outs(tmp_path):
    # The card is clear in its upper left quarter; the veil behind it is not clear enough.
    def card(name: str, z: float, opacity: str) -> str:
        return (
            f'</shape><shape type="rectangle" id="{name}"><transform name="to_world"><scale value="3"/>'
            f'<translate y="1" z="{z}"/></transform><bsdf type="mask">{opacity}<bsdf type="diffuse"/></bsdf>'
        )

    checkers = (
        '<texture name="opacity" type="checkerboard"><rgb name="color0" value="0"/>'
        '<rgb name="color1" value="1"/></texture>'
    )
    cards = card("card", 0.9, checkers) + card("veil", 0.8, '<float name="opacity" value="0.7"/>')
    renderer = opened_scene(tmp_path, {"ball": pane("front", 1.0) + cards})
    seen = find_geometry(renderer, front_camera())
    through = VirtualImages(renderer).find(seen)[1].shape_index
    names = renderer.describe().shapes
    is_pane = seen.shape_index == names.index("front") + 1
    is_pane[12:] = False  # the card's middle is at row 19
    for side, name in ((np.s_[:, :16], "veil"), (np.s_[:, -16:], "card")):
        assert is_pane[side].sum() > 50
        assert set(through[side][is_pane[side]]) == {IN_VIRTUAL_IMAGE + names.index(name) + 1}


def test_lamps_in_a_mirror_are_seen_as_themselves(tmp_path):
    # Rays of the camera pass the shapes of lamps, but mirrors show them.
    def upright(name: str, z: float, scale: float, inner: str) -> str:
        return (
            f'<shape type="rectangle" id="{name}"><transform name="to_world"><scale value="{scale}"/>'
            f'<rotate y="1" angle="{180 if z > 0 else 0}"/><translate z="{z}"/></transform>{inner}</shape>'
        )

    mirror, wall = upright("mirror", -1.4, 3, '<bsdf type="conductor"/>'), upright("wall", 4.0, 9, "")
    panel = upright("panel", 2.0, 0.5, f'<bsdf type="null" id="{LAMP}"/><emitter type="area"/>')
    file = tmp_path / "scene.xml"
    file.write_text(f'<scene version="3.0.0"><integrator type="path"/>{mirror}{wall}{panel}</scene>')
    renderer = MitsubaRenderer(file)
    camera = Camera(look_at((0.0, 0.0, 3.0), (0.0, 0.0, 0.0)), 40.0, 48, 36)
    shown = VirtualImages(renderer).find(find_geometry(renderer, camera))[0].shape_index
    of_panel, of_wall = (renderer.describe().shapes.index(name) + 1 for name in ("panel", "wall"))
    assert (shown == IN_VIRTUAL_IMAGE + of_panel).sum() > 20
    assert (shown == IN_VIRTUAL_IMAGE + of_wall).sum() > 20
    assert not (shown == of_panel).any()
