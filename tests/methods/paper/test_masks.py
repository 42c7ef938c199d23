"""Slow pixels, specular shapes, and the order in which traced pixels are counted (§4.1, §4.3, §6)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra.numpy import arrays

from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.paper.masks import (
    provenance_of,
    reusable_specular_shapes,
    slow_pixels,
    specular_pixels,
)
from enfilade.records import Geometry, Provenance, SurfaceClass
from enfilade.settings import MaskSettings

H, W = 20, 30
SETTINGS = MaskSettings()
CAMERA = Camera(look_at((0, 0, 1), (0, 0, 0)), 50.0, W, H)
EVERYWHERE = np.ones((H, W), bool)
masks = arrays(bool, (4, 5))


def scene(shape_index, surface=SurfaceClass.GLOSSY):
    """A G-buffer of these shapes; shape 1 is diffuse, all others are of a class."""
    classes = np.where(
        shape_index > 1, surface, np.where(shape_index == 1, SurfaceClass.DIFFUSE, SurfaceClass.NONE)
    )
    zeros = np.zeros((H, W, 3), np.float32)
    depth = np.where(shape_index > 0, 1, 0).astype(np.float32)
    return Geometry(CAMERA, depth, zeros, zeros, shape_index.astype(np.uint32), classes.astype(np.uint8))


def two_panes():
    """Shape 2 is a pane of 10 x 10, shape 3 another, shape 1 between."""
    shape_index = np.ones((H, W), int)
    shape_index[5:15, 3:13] = 2
    shape_index[5:15, 17:27] = 3
    return shape_index


def traced_shapes(
    jnd, shape_index=None, *, is_compared=EVERYWHERE, surface=SurfaceClass.GLOSSY, settings=SETTINGS
):
    """Specular shapes that must be traced."""
    geometry = scene(two_panes() if shape_index is None else shape_index, surface)
    reusable = reusable_specular_shapes(jnd.astype(np.float32), is_compared, EVERYWHERE, geometry, settings)
    return frozenset(geometry.shape_index[specular_pixels(geometry, reusable)].tolist())


def differences(*places):
    """A JND map, 0 but for (rows, columns, value)."""
    jnd = np.zeros((H, W))
    for rows, columns, value in places:
        jnd[rows, columns] = value
    return jnd


def test_slow_is_below_the_threshold():
    speed = np.array([[0.0, 0.4999, 0.5, 0.7]], np.float32)
    np.testing.assert_array_equal(slow_pixels(speed, SETTINGS), [[True, True, False, False]])
    assert not slow_pixels(speed, MaskSettings(slow_deg_s=0.0)).any()


@given(masks, masks, masks)
def test_pixels_have_one_provenance_in_the_papers_order(is_slow, is_specular, is_disoccluded):
    got = provenance_of(is_slow, is_specular, is_disoccluded)
    for index in np.ndindex(got.shape):
        if is_slow[index]:
            expected = Provenance.SLOW
        elif is_specular[index]:
            expected = Provenance.SPECULAR
        elif is_disoccluded[index]:
            expected = Provenance.DISOCCLUDED
        else:
            expected = Provenance.REUSED
        assert got[index] == expected
    assert got.dtype == np.uint8
    assert np.bincount(got.ravel(), minlength=5).sum() == got.size


def test_shapes_that_are_not_reusable_are_traced():
    # Shape 4 is not visible in the frame that was compared.
    shape_index = two_panes()
    shape_index[0:3, 0:3] = 4
    geometry = scene(shape_index)
    np.testing.assert_array_equal(specular_pixels(geometry, frozenset({2, 3})), shape_index == 4)
    np.testing.assert_array_equal(specular_pixels(geometry, frozenset()), shape_index > 1)


ROWS = (slice(5, 7), slice(3, 13), 1.5)  # 20 of 100 pixels of the first pane
VISIBILITY = {
    "equal images": ((), set()),
    "a group above 2 JND": (((slice(6, 8), slice(4, 6), 2.5),), {2}),
    "a group on the other pane": (((slice(6, 8), slice(20, 22), 2.5),), {3}),
    "2 JND itself": (((slice(6, 8), slice(4, 6), 2.0),), set()),
    "outliers": (tuple((row, column, 9.0) for row in (6, 9) for column in range(3, 13, 2)), set()),
    "three pixels": (((6, slice(4, 7), 9.0),), set()),
    "four pixels": (((6, slice(4, 8), 9.0),), {2}),
    "four pixels that touch at corners": (tuple((6 + k, 4 + k, 3.0) for k in range(4)), {2}),
    "a fifth above 1 JND": ((ROWS,), set()),
    "a quarter above 1 JND": ((ROWS, (7, slice(3, 8), 1.5)), set()),
    "more than a quarter above 1 JND": ((ROWS, (7, slice(3, 9), 1.5)), {2}),
}


@pytest.mark.parametrize("name", VISIBILITY)
def test_visible_differences_of_specular_shapes(name):
    places, expected = VISIBILITY[name]
    assert traced_shapes(differences(*places)) == expected


def test_the_thresholds_are_the_settings():
    group = differences((slice(6, 8), slice(4, 6), 2.5))
    assert traced_shapes(group, settings=MaskSettings(specular_jnd=3.0)) == frozenset()
    assert traced_shapes(group, settings=MaskSettings(specular_jnd=3.0, specular_percent=3.0)) == {2}


def test_groups_do_not_cross_shapes():
    across = np.ones((H, W), int)
    across[5:15, 3:13] = 2
    across[5:15, 13:23] = 3
    jnd = differences((8, slice(11, 15), 5.0))  # two pixels on each of them
    assert traced_shapes(jnd, across) == frozenset()


def test_regions_of_one_shape_are_judged_separately():
    # A small region, all of it different, and a large one that is not: together less than a quarter.
    shape_index = np.ones((H, W), int)
    shape_index[2:6, 2:5] = 2
    shape_index[8:18, 5:25] = 2
    jnd = differences((slice(2, 6), slice(2, 5), 1.5))
    assert traced_shapes(jnd, shape_index) == {2}
    assert traced_shapes(np.zeros((H, W)), shape_index) == frozenset()


def test_the_percentage_is_not_applied_to_small_regions():
    shape_index = np.ones((H, W), int)
    shape_index[2:5, 2] = 2  # 3 pixels of 203: no group can be of 4
    shape_index[8:18, 5:25] = 2
    assert traced_shapes(differences((slice(2, 5), 2, 9.0)), shape_index) == frozenset()


def test_only_specular_surfaces_are_judged():
    group = differences((slice(0, H), slice(0, W), 9.0))
    assert traced_shapes(group, surface=SurfaceClass.DIFFUSE) == frozenset()
    assert traced_shapes(group, surface=SurfaceClass.EMISSIVE) == frozenset()
    for surface in (SurfaceClass.GLOSSY, SurfaceClass.MIRROR, SurfaceClass.TRANSPARENT):
        assert traced_shapes(group, surface=surface) == {2, 3}


def test_unjudged_pixels_do_not_count():
    group = differences((slice(6, 8), slice(4, 6), 2.5))
    hidden = EVERYWHERE.copy()
    hidden[6:8, 4:6] = False
    assert traced_shapes(group, is_compared=hidden) == frozenset()
    # A quarter is of the compared pixels: 20 of 60.
    most = EVERYWHERE.copy()
    most[11:15] = False
    assert traced_shapes(differences((slice(5, 7), slice(3, 13), 1.5)), is_compared=most) == {2}


def test_shapes_of_which_less_than_half_is_compared_are_traced():
    half = EVERYWHERE.copy()
    half[10:15, 3:13] = False
    assert traced_shapes(differences(), is_compared=half) == frozenset()
    half[9, 3] = False
    assert traced_shapes(differences(), is_compared=half) == {2}
    assert traced_shapes(differences(), is_compared=~EVERYWHERE) == {2, 3}


@pytest.mark.parametrize("size", [1, 2, 3])
def test_tiny_regions(size):
    shape_index = np.ones((H, W), int)
    shape_index[4, 4 : 4 + size] = 2
    assert traced_shapes(differences((4, slice(4, 4 + size), 1.5)), shape_index) == {2}
