"""Rays at edges: outlines, small emitters, and pixels whose displayed value is uncertain."""

import numpy as np
import pytest

from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.decoupled.edges import (
    EdgeRays,
    dilated,
    displayed_deviation,
    displayed_tolerance,
    is_outline,
    small_emitter_pixels,
)
from enfilade.records import Geometry, Shading
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


def test_the_unseen_share_follows_the_rays_of_each_pixel():
    # A bright pixel beside two dark ones, of which the right one has fewer rays.
    color = np.zeros((1, 3, 3), np.float32)
    color[0, 1] = 0.2
    counts = np.array([[31, 31, 7]], np.uint32)
    found = displayed_deviation(Shading(color, np.zeros((1, 3), np.float32)), 0.0, counts)[0]
    assert found[0] < found[2]
    alone = displayed_deviation(Shading(color, np.zeros((1, 3), np.float32)), 0.0, 7)[0]
    assert found[2] == alone[2]


def test_outlines_are_pixels_beside_another_shape():
    index = np.ones((H, W), np.uint32)
    index[5, 7] = 2
    rows, columns = np.nonzero(is_outline(geometry_of(index)))
    assert set(zip(rows, columns, strict=True)) == {(5, 7), (4, 7), (6, 7), (5, 6), (5, 8)}


def test_what_is_clipped_at_white_is_not_uncertain():
    grey = np.repeat(np.array([[0.2], [0.2], [50.0], [1.1], [1.1]], np.float32), 3, axis=1)
    deviation = np.array([0.0, 0.02, 5.0, 0.05, 0.5], np.float32)
    found = displayed_deviation(Shading(grey, deviation**2), 0.0)
    assert found[[0, 2, 3]].tolist() == [0.0, 0.0, 0.0]
    # sRGB of 0.22 and of 0.18; of 0.6 and of white
    np.testing.assert_allclose(found[[1, 4]], [(0.5064 - 0.4614) / 2.0, (1.0 - 0.7977) / 2.0], atol=1e-3)
    darker = displayed_deviation(Shading(grey, deviation**2), -1.0)
    assert darker[3] > 0.01


@pytest.mark.parametrize(
    ("sky", "spp", "is_uncertain"), [(100.0, 16, True), (100.0, 8000, False), (0.3, 16, False)]
)
def test_a_bright_surface_beside_a_pixel_may_have_been_missed(sky, spp, is_uncertain):
    color = np.full((H, W, 3), 0.2, np.float32)
    color[:, :10] = sky
    found = displayed_deviation(Shading(color, np.zeros((H, W), np.float32)), 0.0, spp) > 0.02
    assert found[:, 10].all() == is_uncertain
    assert not found[:, 11:].any()  # no bright surface beside them
    assert not found[:, :10].any()


def test_the_tolerance_follows_the_quality():
    tolerances = [displayed_tolerance(quality) for quality in (1.0, 4.0, 16.0, 64.0)]
    np.testing.assert_allclose(tolerances, [0.0033, 0.0066, 0.0132, 0.0264])


def test_rays_double_where_the_value_is_uncertain_and_beside_it():
    sampled = np.ones((H, W), bool)
    sampled[:, 0] = False  # pixels of the estimate are those of a mask
    traced = np.zeros((H, W), int)
    noisy = np.zeros((H, W), bool)
    noisy[7, 8] = True

    class Counted:
        def add(self, spp, where):
            traced[sampled] += spp * where

        @property
        def shadings(self):
            variance = np.where(noisy, 1.0 / np.maximum(traced, 1), 0.0).astype(np.float32)[sampled]
            return [Shading(np.full((sampled.sum(), 3), 0.5, np.float32), variance)] * 2

    edges = noisy | (np.arange(W) == 20)
    refined = EdgeRays(most=100, tolerance=0.02, exposure_ev=0.0).refine(
        Counted(), sampled, edges, sampled, 4
    )
    expected = np.where(dilated(noisy), 100 - 16, 0) + np.where(edges, 12, 0)
    np.testing.assert_array_equal(traced, expected)
    np.testing.assert_array_equal(refined, expected > 0)


def test_edges_are_not_refined_beyond_the_largest_number_of_rays():
    everywhere = np.ones((H, W), bool)
    rays = EdgeRays(most=4, tolerance=0.0, exposure_ev=0.0)
    assert not rays.refine(None, everywhere, everywhere, everywhere, 4).any()


def test_edges_matter_where_the_display_shows_them():
    color = np.zeros((H, W, 3), np.float32)
    color[:, 15:] = 0.05
    dark, bright, white = (
        EdgeRays(128, 0.02, 0.0, beneath=np.full((H, W), value, np.float32)).matters(color)
        for value in (0.0, 0.6, 2.0)
    )
    expected = np.zeros((H, W), bool)
    expected[:, 14:16] = True
    np.testing.assert_array_equal(dark, expected)
    assert not bright.any()  # sRGB of 0.60 and 0.65: a difference of 0.03
    assert not white.any()


def test_what_is_displayed_beneath_an_estimate_lowers_its_visible_deviation():
    shading = Shading(np.full((H, W, 3), 0.02, np.float32), np.full((H, W), 1e-4, np.float32))
    alone, above = (displayed_deviation(shading, 0.0, beneath=value) for value in (0.0, 0.5))
    # sRGB of 0.01 and 0.03; of 0.51 and 0.53
    np.testing.assert_allclose(alone, (0.1901 - 0.0998) / 2.0, atol=1e-3)
    np.testing.assert_allclose(above, (0.7536 - 0.7411) / 2.0, atol=1e-3)
