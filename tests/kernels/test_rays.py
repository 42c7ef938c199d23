"""Rays through image points, and the distributions of the pixel filters."""

import math

import numpy as np
import pytest

from enfilade.arrays import Array2f, Float, UInt
from enfilade.camera.pinhole import Camera, look_at
from enfilade.kernels.random import one_sequence
from enfilade.kernels.rays import box_offsets, camera_rays, gaussian_offsets, points_at

COUNT = 1 << 18


def squares(count=COUNT):
    return one_sequence(count).next_2d()


def test_directions_have_unit_depth_and_pass_through_their_point():
    camera = Camera(look_at((1, 2, 3), (-1, 0, 0.5)), 47.0, 64, 48)
    x, y = np.array([0, 64, 32, 11.3], np.float32), np.array([0, 48, 24, 40.1], np.float32)
    got = np.array(camera_rays(camera, Array2f(x, y)).direction).T
    np.testing.assert_allclose(-got @ camera.world_from_camera[:3, 2], 1.0, rtol=1e-6)
    image = got @ camera.pixel_from_direction.T
    np.testing.assert_allclose(image[:, :2], np.stack([x, y], axis=1), atol=2e-5)  # float32 of 64 px


def test_points_project_to_the_centres_of_their_pixels():
    camera = Camera(look_at((1, 2, 3), (-1, 0, 0.5)), 47.0, 64, 48)
    pixels, depths = np.array([0, 70, 64 * 48 - 1]), np.array([1.0, 3.0, 20.0])
    got = np.array(points_at(camera, Float(depths), UInt(pixels))).T
    x, y, depth = camera.pixel_from_direction @ (got - camera.eye).T
    np.testing.assert_allclose(depth, depths, rtol=1e-5)
    np.testing.assert_allclose([x / depth, y / depth], [pixels % 64 + 0.5, pixels // 64 + 0.5], atol=1e-3)
    assert np.array(points_at(camera, Float(2.0))).shape == (3, 64 * 48)


def test_box_offsets_are_uniform_over_the_pixel():
    offsets = np.array(box_offsets(squares())).astype(float)
    assert offsets.min() >= -0.5
    assert offsets.max() < 0.5
    error = 5 / math.sqrt(COUNT)  # five standard errors, in standard deviations
    assert np.abs(offsets.mean(axis=1)).max() < error * math.sqrt(1 / 12)
    np.testing.assert_allclose(offsets.var(axis=1), 1 / 12, rtol=error)
    assert abs(np.corrcoef(offsets)[0, 1]) < error
    counts, _ = np.histogram(offsets[0], 64, (-0.5, 0.5))
    chi2 = ((counts - COUNT / 64) ** 2 / (COUNT / 64)).sum()
    assert chi2 < 63 + 5 * math.sqrt(2 * 63)


@pytest.mark.parametrize(("sigma", "radius"), [(0.5, 1.5), (0.5, 0.5), (1.5, 4.5)])
def test_gaussian_offsets_are_a_gaussian_cut_at_the_radius(sigma, radius):
    offsets = np.array(gaussian_offsets(squares(), sigma=sigma, radius=radius)).astype(float)
    assert np.abs(offsets).max() <= radius * (1 + 1e-4)  # erfinv in float32
    edges = np.linspace(-radius, radius, 41)
    cdf = np.array([math.erf(e / sigma / math.sqrt(2)) for e in edges])
    expected = COUNT * np.diff(cdf) / (cdf[-1] - cdf[0])
    for axis in offsets:
        counts, _ = np.histogram(np.clip(axis, -radius, radius), edges)
        chi2 = ((counts - expected) ** 2 / expected).sum()
        assert abs(chi2 - 39) < 5 * math.sqrt(2 * 39)
    assert abs(np.corrcoef(offsets)[0, 1]) < 5 / math.sqrt(COUNT)
