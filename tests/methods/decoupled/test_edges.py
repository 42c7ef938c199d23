"""Outlines of shapes, and small emitters."""

import numpy as np
import pytest
import scipy.ndimage

from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.decoupled.edges import beside, dilated, is_outline, small_emitter_pixels
from enfilade.records import Geometry
from enfilade.renderer import Emitters

H, W = 20, 30
CAMERA = Camera(look_at((0, 0, 1), (0, 0, 0)), 50.0, W, H)


def geometry_of(shape_index):
    """A G-buffer of shapes at depth 1."""
    zeros = np.zeros((H, W, 3), np.float32)
    depth = (shape_index > 0).astype(np.float32)
    return Geometry(CAMERA, depth, zeros, zeros, shape_index.astype(np.uint32), np.zeros((H, W), np.uint8))


def emitters(pixels, depth, shape_index):
    """Points at the centres of pixels (x, y)."""
    across = np.array([(x + 0.5, y + 0.5, 1.0) for x, y in pixels]).reshape(-1, 3)
    position = CAMERA.eye + depth * (across @ CAMERA.direction_from_pixel.T)
    return Emitters(position.astype(np.float32), np.full(len(pixels), shape_index, np.uint32))


def test_small_emitters_are_found_between_camera_rays():
    geometry = geometry_of(np.ones((H, W)))
    mask = small_emitter_pixels(emitters([(4, 7), (4, 7), (29, 19)], 0.9, shape_index=5), geometry)
    assert sorted(np.argwhere(mask).tolist()) == [[7, 4], [19, 29]]
    sky = geometry_of(np.zeros((H, W)))
    assert small_emitter_pixels(emitters([(4, 7)], 50.0, shape_index=5), sky).sum() == 1
    assert not small_emitter_pixels(emitters([], 50.0, shape_index=5), sky).any()


def test_occluded_emitters_and_the_interior_of_large_ones_are_left_out():
    shape_index = np.ones((H, W))
    shape_index[5:15, 3:13] = 2
    geometry = geometry_of(shape_index)
    for pixels, depth in (([(4, 7)], 1.2), ([(4, 7)], -0.9), ([(-1, 7), (4, 20), (30, 7)], 0.9)):
        assert not small_emitter_pixels(emitters(pixels, depth, shape_index=5), geometry).any()
    large = [(x, y) for x in range(3, 13) for y in range(5, 15)]
    outline = np.zeros((H, W), bool)
    outline[5:15, 3:13] = True
    outline[6:14, 4:12] = False
    found = small_emitter_pixels(emitters(large, 1.0, shape_index=2), geometry)
    np.testing.assert_array_equal(found, outline)


def test_outlines_are_pixels_beside_another_shape():
    index = np.ones((H, W), np.uint32)
    index[5, 7] = 2
    rows, columns = np.nonzero(is_outline(geometry_of(index)))
    assert set(zip(rows, columns, strict=True)) == {(5, 7), (4, 7), (6, 7), (5, 6), (5, 8)}


@pytest.mark.parametrize("pixels", [1, 2, 4])
def test_a_mask_grows_as_by_scipy_to_the_border(pixels):
    mask = np.random.default_rng(pixels).random((H, W)) < 0.05
    expected = scipy.ndimage.binary_dilation(mask, np.ones((3, 3), bool), iterations=pixels)
    np.testing.assert_array_equal(dilated(mask, pixels), expected)


def test_pixels_are_beside_others_but_not_beside_themselves():
    mask = np.zeros((H, W), bool)
    mask[[4, 9, 9], [5, 0, 1]] = True
    expected = dilated(mask)
    expected[4, 5] = False
    np.testing.assert_array_equal(beside(mask), expected)
