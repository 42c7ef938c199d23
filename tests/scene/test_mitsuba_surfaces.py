"""Surfaces of a Mitsuba scene: shapes, classes, albedo, masks."""

import numpy as np
import pytest

from enfilade.arrays import Array3f
from enfilade.camera.pinhole import Camera, look_at
from enfilade.gbuffer import find_geometry
from enfilade.records import SurfaceClass
from enfilade.renderer import Rays
from support.analytic_truth import projected
from support.mitsuba_scene import BITMAP_MASK, DIFFUSE, HOLES, opened, placed, rgb, veil, write, write_holes

POLISHED = '<float name="metallic" value="1"/><float name="roughness" value="0"/>'
MATERIALS = {
    "paint": (DIFFUSE, SurfaceClass.DIFFUSE),
    "both sides": (f'<bsdf type="twosided">{DIFFUSE}</bsdf>', SurfaceClass.DIFFUSE),
    "brushed": ('<bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf>', SurfaceClass.GLOSSY),
    "polished": (
        '<bsdf type="roughconductor"><float name="alpha" value="0.002"/></bsdf>',
        SurfaceClass.MIRROR,
    ),
    "polished, principled": (f'<bsdf type="principled">{POLISHED}</bsdf>', SurfaceClass.MIRROR),
    "coated": (
        f'<bsdf type="principled">{POLISHED}<float name="clearcoat" value="1"/></bsdf>',
        SurfaceClass.GLOSSY,
    ),
    "chrome": ('<bsdf type="conductor"/>', SurfaceClass.MIRROR),
    "chrome both sides": ('<bsdf type="twosided"><bsdf type="conductor"/></bsdf>', SurfaceClass.MIRROR),
    "glass": ('<bsdf type="dielectric"/>', SurfaceClass.TRANSPARENT),
    "frosted": ('<bsdf type="roughdielectric"/>', SurfaceClass.TRANSPARENT),
    "pane": ('<bsdf type="thindielectric"/>', SurfaceClass.TRANSPARENT),
    "plastic": ('<bsdf type="plastic"/>', SurfaceClass.GLOSSY),
    "rough plastic": ('<bsdf type="roughplastic"/>', SurfaceClass.GLOSSY),
    "principled": (
        '<bsdf type="principled"/>',
        SurfaceClass.GLOSSY,
    ),
    "bumpy": (
        f'<bsdf type="bumpmap">{HOLES.format("bumps", "bilinear")}{DIFFUSE}</bsdf>',
        SurfaceClass.DIFFUSE,
    ),
    "lamp": (f'<emitter type="area">{rgb("radiance", 3, 2, 1)}</emitter>{DIFFUSE}', SurfaceClass.EMISSIVE),
    "opaque mask": (veil(1.0), SurfaceClass.DIFFUSE),
    "mostly opaque": (veil(0.7), SurfaceClass.DIFFUSE),
}
COLUMNS = 5


def place(index):
    return (1.2 * (index % COLUMNS), 1.2 * (index // COLUMNS), 0.0)


@pytest.fixture(scope="module")
def swatches(tmp_path_factory):
    """Every material on a square of its own, and a camera that sees them all."""
    shapes = [placed("rectangle", name, place(i), m) for i, (name, (m, _)) in enumerate(MATERIALS.items())]
    folder = tmp_path_factory.mktemp("swatches")
    write_holes(folder)
    renderer = opened(write(folder, *shapes))
    camera = Camera(look_at((2.4, 1.2, 8), (2.4, 1.2, 0)), 40.0, 160, 120)
    return renderer, camera, find_geometry(renderer, camera)


def pixel_of(camera, point):
    at, _ = projected(camera, np.array(point, float))
    return int(at[1]), int(at[0])


@pytest.mark.parametrize("name", MATERIALS)
def test_shapes_and_classes(swatches, name):
    renderer, camera, geometry = swatches
    index = list(MATERIALS).index(name)
    at = pixel_of(camera, place(index))
    assert renderer.describe().shapes[index] == name
    assert geometry.shape_index[at] == index + 1
    assert SurfaceClass(geometry.surface[at]) == MATERIALS[name][1]
    assert geometry.depth[at] == pytest.approx(8.0, rel=1e-5)
    if name != "bumpy":
        np.testing.assert_allclose(geometry.normal[at], (0, 0, 1), atol=1e-6)


def test_albedo_is_the_diffuse_reflectance(swatches):
    _, camera, geometry = swatches
    names = list(MATERIALS)
    for name in ("paint", "both sides", "opaque mask", "lamp"):
        at = pixel_of(camera, place(names.index(name)))
        np.testing.assert_allclose(geometry.albedo[at], (0.2, 0.5, 0.7), rtol=1e-5)
    for name in ("chrome", "glass", "pane", "brushed"):
        assert not geometry.albedo[pixel_of(camera, place(names.index(name)))].any()


def test_the_sky_is_no_shape(swatches):
    _, _, geometry = swatches
    assert geometry.shape_index[0, 0] == 0
    assert geometry.surface[0, 0] == SurfaceClass.NONE
    assert geometry.depth[0, 0] == 0.0
    for values in (geometry.depth, geometry.normal, geometry.albedo):
        assert np.isfinite(values).all()


LEAF_CARD = f'<bsdf type="blendbsdf">{HOLES.format("weight", "nearest")}<bsdf type="null"/>{DIFFUSE}</bsdf>'
DIRTY_PANE = f"""<bsdf type="blendbsdf"><float name="weight" value="0.1"/>
<bsdf type="thindielectric"/>{DIFFUSE}</bsdf>"""


@pytest.fixture(scope="module")
def screens(tmp_path_factory):
    """Masks before a wall and before the sky, one of them an instance, one behind another."""
    folder = tmp_path_factory.mktemp("screens")
    write_holes(folder)
    group = f"""<shape type="shapegroup" id="group">
{placed("disk", "leaf", (0, 0, 0), veil(0.2))}</shape>
<shape type="instance" id="tree"><ref id="group"/>
<transform name="to_world"><translate x="1.2" y="0" z="1"/></transform></shape>"""
    file = write(
        folder,
        placed("rectangle", "wall", (0, 0, -1), DIFFUSE, scale=3),
        placed("rectangle", "pierced", (0, 0, 1), BITMAP_MASK),
        placed("rectangle", "thin", (-1.2, 0, 1), veil(0.2)),
        placed("rectangle", "thin behind", (-1.2, 0, 0.5), veil(0.3)),
        placed("rectangle", "above the wall", (0, 4, 1), veil(0.1)),
        placed("rectangle", "leaf card", (2.2, 0, 1), LEAF_CARD),
        placed("rectangle", "dirty pane", (-2.2, 0, 1), DIRTY_PANE),
        group,
    )
    renderer = opened(file)
    camera = Camera(look_at((0, 1, 12), (0, 1, 0)), 45.0, 200, 200)
    return renderer, camera, find_geometry(renderer, camera)


@pytest.mark.parametrize(
    ("point", "seen", "depth"),
    [
        ((-0.2, 0, 1), "pierced", 11.0),
        ((0.2, 0, 1), "wall", 13.0),
        ((-1.2, 0, 1), "wall", 13.0),  # through two
        ((1.2, 0, 1), "wall", 13.0),  # through an instance
        ((0, 4, 1), None, 0.0),
        ((2.0, 0, 1), "leaf card", 11.0),
        ((2.4, 0, 1), "wall", 13.0),
        ((-2.2, 0, 1), "dirty pane", 11.0),
        ((2.2, 1.5, -1), "wall", 13.0),
    ],
)
def test_masked_out_surfaces_are_looked_through(screens, point, seen, depth):
    renderer, camera, geometry = screens
    at = pixel_of(camera, point)
    assert geometry.shape_index[at] == (renderer.describe().shapes.index(seen) + 1 if seen else 0)
    assert geometry.depth[at] == pytest.approx(depth, rel=1e-4)  # Mitsuba begins anew a little beyond


def test_an_instance_is_one_shape(tmp_path):
    file = write(
        tmp_path,
        f"""<shape type="shapegroup" id="group">{placed("sphere", "a", (0, 0, 0), DIFFUSE)}</shape>""",
        *(
            f"""<shape type="instance" id="copy {k}"><ref id="group"/>
<transform name="to_world"><translate x="{k}"/></transform></shape>"""
            for k in (-1, 1)
        ),
    )
    renderer = opened(file)
    camera = Camera(look_at((0, 0, 8), (0, 0, 0)), 40.0, 64, 48)
    geometry = find_geometry(renderer, camera)
    names = renderer.describe().shapes
    assert [names[geometry.shape_index[pixel_of(camera, (k, 0, 0))] - 1] for k in (-1, 1)] == [
        "copy -1",
        "copy 1",
    ]


def test_equal_materials_stay_separate_shapes(tmp_path):
    # Mitsuba joins meshes that share a material, unless it is told not to.
    shared = f'<bsdf type="diffuse" id="grey"/>{placed("cube", "a", (-1, 0, 0), "<ref id=%sgrey%s/>")}'
    shared += placed("cube", "b", (1, 0, 0), "<ref id=%sgrey%s/>")
    renderer = opened(write(tmp_path, shared.replace("%s", '"')))
    assert renderer.describe().shapes == ("a", "b")


def test_distance_counts_in_lengths_of_the_direction(swatches):
    renderer, _, _ = swatches
    found = renderer.surfaces(Rays(Array3f(0, 0, 6), Array3f(0, 0, -2)))
    assert found.distance[0] == pytest.approx(3.0, rel=1e-5)


def test_parameters_that_have_no_value_are_no_fault(tmp_path):
    hairy = [placed("cube", f"cube {x}", (x, 0, 0), '<bsdf type="hair"/>') for x in (-1, 1)]  # no sigma_a
    renderer = opened(write(tmp_path, *hairy))
    geometry = find_geometry(renderer, Camera(look_at((0, 0, 5), (0, 0, 0)), 45.0, 32, 16))
    assert np.unique(geometry.shape_index).tolist() == [0, 1, 2]
