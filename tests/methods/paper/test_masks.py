"""Slow pixels, specular shapes, and the order in which traced pixels are counted (§4.1, §4.3, §6)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra.numpy import arrays

from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.paper.masks import emitter_pixels, slow_pixels, sources, specular_pixels, unseen_items
from enfilade.records import Geometry, Provenance, SurfaceClass
from enfilade.renderer import Emitters
from enfilade.settings import MaskSettings

H, W = 20, 30
SETTINGS = MaskSettings()
CAMERA = Camera(look_at((0, 0, 1), (0, 0, 0)), 50.0, W, H)
EVERYWHERE = np.ones((H, W), bool)
masks = arrays(bool, (4, 5))


def scene(shape_index, surface=SurfaceClass.GLOSSY):
    """Geometry with these shapes; shape 1 diffuse, all others of a class."""
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


def seen(jnd, shape_index=None, *, is_judged=EVERYWHERE, surface=SurfaceClass.GLOSSY, settings=SETTINGS):
    """Items of which something must be traced."""
    geometry = scene(two_panes() if shape_index is None else shape_index, surface)
    unseen = unseen_items(jnd.astype(np.float32), is_judged, geometry, settings)
    return frozenset(geometry.shape_index[specular_pixels(geometry, unseen)].tolist())


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
def test_each_pixel_is_counted_once_in_the_papers_order(is_slow, is_specular, is_hole):
    got = sources(is_slow, is_specular, is_hole)
    for index in np.ndindex(got.shape):
        if is_slow[index]:
            expected = Provenance.SLOW
        elif is_specular[index]:
            expected = Provenance.SPECULAR
        elif is_hole[index]:
            expected = Provenance.DISOCCLUDED
        else:
            expected = Provenance.REUSED
        assert got[index] == expected
    assert got.dtype == np.uint8
    assert np.bincount(got.ravel(), minlength=5).sum() == got.size


def test_what_was_not_judged_unseen_is_traced():
    # Shape 4 comes into view in another frame than the one that was judged.
    shape_index = two_panes()
    shape_index[0:3, 0:3] = 4
    geometry = scene(shape_index)
    np.testing.assert_array_equal(specular_pixels(geometry, frozenset({2, 3})), shape_index == 4)
    np.testing.assert_array_equal(specular_pixels(geometry, frozenset()), shape_index > 1)


def test_nothing_differs():
    assert seen(differences()) == frozenset()


def test_a_group_above_2_jnd_is_seen():
    assert seen(differences((slice(6, 8), slice(4, 6), 2.5))) == {2}
    assert seen(differences((slice(6, 8), slice(20, 22), 2.5))) == {3}


def test_two_jnd_itself_is_not_above():
    assert seen(differences((slice(6, 8), slice(4, 6), 2.0))) == frozenset()


def test_outliers_are_no_group():
    scattered = differences(*((6, c, 9.0) for c in range(3, 13, 2)), *((9, c, 9.0) for c in range(3, 13, 2)))
    assert seen(scattered) == frozenset()
    three = differences((6, slice(4, 7), 9.0))
    assert seen(three) == frozenset()
    four = differences((6, slice(4, 8), 9.0))
    assert seen(four) == {2}


def test_pixels_that_touch_at_a_corner_are_one_group():
    diagonal = differences(*((6 + k, 4 + k, 3.0) for k in range(4)))
    assert seen(diagonal) == {2}


def test_more_than_a_quarter_above_1_jnd_is_seen():
    rows = differences((slice(5, 7), slice(3, 13), 1.5))  # 20 of 100
    assert seen(rows) == frozenset()
    quarter = rows + differences((7, slice(3, 8), 1.5))  # 25 of 100: not more than a quarter
    assert seen(quarter) == frozenset()
    assert seen(quarter + differences((7, 8, 1.5))) == {2}


def test_the_thresholds_are_the_settings():
    group = differences((slice(6, 8), slice(4, 6), 2.5))
    assert seen(group, settings=MaskSettings(specular_jnd=3.0)) == frozenset()
    assert seen(group, settings=MaskSettings(specular_jnd=3.0, specular_percent=3.0)) == {2}


def test_a_group_does_not_reach_over_items():
    across = np.ones((H, W), int)
    across[5:15, 3:13] = 2
    across[5:15, 13:23] = 3
    jnd = differences((8, slice(11, 15), 5.0))  # two pixels on each of them
    assert seen(jnd, across) == frozenset()


def test_regions_of_one_item_are_judged_separately():
    # A small region, all of it different, and a large one that is not: together less than a quarter.
    shape_index = np.ones((H, W), int)
    shape_index[2:6, 2:5] = 2
    shape_index[8:18, 5:25] = 2
    jnd = differences((slice(2, 6), slice(2, 5), 1.5))
    assert seen(jnd, shape_index) == {2}
    assert seen(np.zeros((H, W)), shape_index) == frozenset()


def test_a_splinter_does_not_decide_by_its_share():
    shape_index = np.ones((H, W), int)
    shape_index[2:5, 2] = 2  # 3 pixels of 203: no group can be of 4
    shape_index[8:18, 5:25] = 2
    assert seen(differences((slice(2, 5), 2, 9.0)), shape_index) == frozenset()


def test_other_surfaces_are_not_judged():
    group = differences((slice(0, H), slice(0, W), 9.0))
    assert seen(group, surface=SurfaceClass.DIFFUSE) == frozenset()
    assert seen(group, surface=SurfaceClass.EMISSIVE) == frozenset()
    for surface in (SurfaceClass.GLOSSY, SurfaceClass.MIRROR, SurfaceClass.TRANSPARENT):
        assert seen(group, surface=surface) == {2, 3}


def test_differences_that_were_not_judged_do_not_count():
    group = differences((slice(6, 8), slice(4, 6), 2.5))
    hidden = EVERYWHERE.copy()
    hidden[6:8, 4:6] = False
    assert seen(group, is_judged=hidden) == frozenset()
    # A quarter is of the judged pixels: 20 of 60.
    most = EVERYWHERE.copy()
    most[11:15] = False
    assert seen(differences((slice(5, 7), slice(3, 13), 1.5)), is_judged=most) == {2}


def test_an_item_of_which_less_than_half_is_judged_is_traced():
    half = EVERYWHERE.copy()
    half[10:15, 3:13] = False
    assert seen(differences(), is_judged=half) == frozenset()
    half[9, 3] = False
    assert seen(differences(), is_judged=half) == {2}
    assert seen(differences(), is_judged=~EVERYWHERE) == {2, 3}


@pytest.mark.parametrize("size", [1, 2, 3])
def test_tiny_regions(size):
    shape_index = np.ones((H, W), int)
    shape_index[4, 4 : 4 + size] = 2
    assert seen(differences((4, slice(4, 4 + size), 1.5)), shape_index) == {2}


def emitters(pixels, depth, shape_index):
    """Points at the centres of pixels (x, y)."""
    across = np.array([(x + 0.5, y + 0.5, 1.0) for x, y in pixels]).reshape(-1, 3)
    position = CAMERA.eye + depth * (across @ CAMERA.direction_from_pixel.T)
    return Emitters(position.astype(np.float32), np.full(len(pixels), shape_index, np.uint32))


def test_a_lamp_between_pixels_is_told():
    geometry = scene(np.ones((H, W), int))  # at depth 1, and the lamp before it
    mask = emitter_pixels(emitters([(4, 7), (4, 7), (29, 19)], 0.9, shape_index=5), geometry)
    assert sorted(np.argwhere(mask).tolist()) == [[7, 4], [19, 29]]


def test_hidden_lamps_and_the_inside_of_large_ones_are_not():
    geometry = scene(two_panes())
    assert not emitter_pixels(emitters([(4, 7)], 1.2, shape_index=5), geometry).any()
    assert not emitter_pixels(emitters([(4, 7)], -0.9, shape_index=5), geometry).any()
    assert not emitter_pixels(emitters([(-1, 7), (4, 20), (30, 7)], 0.9, shape_index=5), geometry).any()
    pane = [(x, y) for x in range(3, 13) for y in range(5, 15)]
    mask = emitter_pixels(emitters(pane, 1.0, shape_index=2), geometry)
    outline = np.zeros((H, W), bool)
    outline[5:15, 3:13] = True
    outline[6:14, 4:12] = False
    np.testing.assert_array_equal(mask, outline)


def test_a_lamp_before_the_sky_is_seen():
    geometry = scene(np.zeros((H, W), int))
    assert emitter_pixels(emitters([(4, 7)], 50.0, shape_index=5), geometry).sum() == 1
    assert not emitter_pixels(emitters([], 50.0, shape_index=5), geometry).any()
