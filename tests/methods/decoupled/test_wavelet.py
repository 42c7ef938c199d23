"""Edge-avoiding wavelets against loops, fireflies, and soft edges."""

import dataclasses

import numpy as np
import pytest

from enfilade.arrays import image, lanes, matrix3
from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.decoupled.wavelet import (
    Guide,
    firefly_weights,
    redistribute_fireflies,
    smooth,
)
from twins import wavelet as twin

HEIGHT, WIDTH = 18, 24
CAMERA = Camera(look_at((0, 0, 4), (0, 0, 0)), 40, WIDTH, HEIGHT)
OPTIONS = {"levels": 3, "deviations": 3.0}


@dataclasses.dataclass
class Scene:
    """A wall with a step in depth and a tilted part, two shapes, and light with noise."""

    color: np.ndarray
    variance: np.ndarray
    depth: np.ndarray
    normal: np.ndarray
    shape_index: np.ndarray

    def smoothed(self, **options):
        guide = Guide(
            lanes(self.depth),
            lanes(self.normal),
            lanes(self.shape_index),
            matrix3(CAMERA.direction_from_pixel),
            WIDTH,
            HEIGHT,
        )
        color, variance = smooth(lanes(self.color), lanes(self.variance), guide, **{**OPTIONS, **options})
        return image(color, HEIGHT, WIDTH), image(variance, HEIGHT, WIDTH)


@pytest.fixture
def scene():
    rng = np.random.default_rng(3)
    depth = np.full((HEIGHT, WIDTH), 4.0, np.float32)
    depth[:, 16:] = 4.5
    normal = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    normal[..., 2] = 1.0
    normal[12:] = (0.0, 0.6, 0.8)
    shape_index = np.ones((HEIGHT, WIDTH), np.uint32)
    shape_index[:, :6] = 2
    light = np.where(np.arange(WIDTH) < 11, 1.0, 3.0)[None, :, None]
    noise = rng.normal(0.0, 0.1, (HEIGHT, WIDTH, 1))
    color = (light + noise * (1.0, 0.9, 0.8)).astype(np.float32)
    return Scene(color, np.full((HEIGHT, WIDTH), 0.01, np.float32), depth, normal, shape_index)


def test_smoothing_matches_loops(scene):
    color, variance = scene.smoothed()
    wanted, wanted_variance = twin.smooth(
        *(a.astype(float) for a in (scene.color, scene.variance, scene.depth, scene.normal)),
        scene.shape_index,
        CAMERA.direction_from_pixel,
        levels=3,
        deviations=3.0,
        plane=0.01,
        exponent=64.0,
    )
    np.testing.assert_allclose(color, wanted, rtol=2e-4)
    np.testing.assert_allclose(variance, wanted_variance, rtol=2e-3)


def test_pixels_without_a_shape_stay_as_they_are(scene):
    scene.shape_index[4:9, 5:20] = 0
    outside = scene.shape_index == 0
    color, variance = scene.smoothed()
    np.testing.assert_array_equal(color[outside], scene.color[outside])
    np.testing.assert_array_equal(variance[outside], scene.variance[outside])
    scene.color[outside] = 100.0
    np.testing.assert_array_equal(scene.smoothed()[0][~outside], color[~outside])
    assert (color[~outside] != scene.color[~outside]).any(axis=1).mean() > 0.95
    scene.shape_index[:] = 0
    np.testing.assert_array_equal(scene.smoothed()[0], scene.color)


def wall(height, width):
    """A plain wall that fills the image."""
    normal = np.zeros((height, width, 3), np.float32)
    normal[..., 2] = 1.0
    return Guide(
        lanes(np.full((height, width), 4.0, np.float32)),
        lanes(normal),
        lanes(np.ones((height, width), np.uint32)),
        matrix3(Camera(CAMERA.world_from_camera, 40, width, height).direction_from_pixel),
        width,
        height,
    )


def grey(light):
    return (light[..., None] * np.ones(3)).astype(np.float32)


def on_a_wall(light, variance, **options):
    """Smoothed grey light on a plain wall, (H, W), and its variance."""
    color, variance = lanes(grey(light)), lanes(variance.astype(np.float32))
    color, variance = smooth(color, variance, wall(*light.shape), **{**OPTIONS, **options})
    return image(color, *light.shape)[..., 0], image(variance, *light.shape)


def test_the_variance_of_the_result_is_that_of_its_noise():
    light = np.random.default_rng(7).normal(0.5, 0.1, (96, 128))
    inside = slice(20, -20), slice(20, -20)
    for levels in (1, 2, 4):
        smoothed, variance = on_a_wall(light, np.full(light.shape, 0.01), levels=levels, deviations=100.0)
        deviation = np.sqrt(variance[inside].mean())
        assert 0.8 < deviation / smoothed[inside].std() < 1.25


def test_energy_of_rare_bright_paths_is_kept():
    """One path in eight finds light; four paths a pixel."""
    light = (np.random.default_rng(8).random((96, 128, 4)) < 0.125).mean(axis=2)
    smoothed, _ = on_a_wall(light, light * (1.0 - light) / 3.0, levels=4)
    assert abs(smoothed.mean() / light.mean() - 1.0) < 0.005
    assert smoothed.std() < 0.35 * light.std()


def test_noise_is_smoothed_and_edges_stay(scene):
    color, variance = scene.smoothed(levels=4)
    inside = color[2:10, 1:4]
    assert inside.std() < 0.5 * scene.color[2:10, 1:4].std()
    assert variance.mean() < 0.2 * scene.variance.mean()
    assert np.abs(color[:, 10].mean() - 1.0) < 0.05
    assert np.abs(color[:, 11].mean() - 3.0 * 0.9) < 0.4


def test_images_without_noise_are_unchanged(scene):
    scene.color[:] = np.where(np.arange(WIDTH) % 2, 1.0, 1.1)[None, :, None]
    scene.variance[:] = 0.0
    color, _ = scene.smoothed()
    np.testing.assert_allclose(color, scene.color, rtol=1e-5)


def test_energy_is_kept_where_noise_borders_on_no_noise(scene):
    """A noisy pixel among black ones without noise."""
    scene.normal[:], scene.depth[:], scene.shape_index[:] = (0.0, 0.0, 1.0), 4.0, 1
    scene.color[:], scene.variance[:] = 0.0, 0.0
    scene.color[9, 12], scene.variance[9, 12] = 1.0, 1.0
    color, _ = scene.smoothed(levels=1)
    assert 0.7 < color.sum() / scene.color.sum() < 1.3


def test_fireflies_are_clamped_to_their_brightest_neighbour():
    color = np.ones((5, 9, 3), np.float32)
    color[2, 3] = color[0, 8] = color[2, 6] = 50.0  # one of them at the corner
    color[1, 3] = 1.5
    weights = image(firefly_weights(lanes(color), width=9, height=5), 5, 9)
    expected = color.copy()
    expected[2, 3], expected[0, 8], expected[2, 6] = 3.0, 2.0, 2.0
    np.testing.assert_allclose(color * weights[..., None], expected, rtol=1e-5)


def redistributed(light, variance, **options):
    options = {"levels": 4, **options}
    color, variance = redistribute_fireflies(
        lanes(grey(light)), lanes(variance.astype(np.float32)), wall(*light.shape), **options
    )
    return image(color, *light.shape)[..., 0], image(variance, *light.shape)


def test_fireflies_are_redistributed_and_keep_their_energy():
    """One pixel in a hundred is a firefly: alone, in pairs, at the border."""
    rng = np.random.default_rng(11)
    light = np.ones((96, 128))
    light.ravel()[rng.choice(light.size, light.size // 100, replace=False)] = 60.0
    variance = np.where(light > 1.0, 900.0, 0.0)
    got, left = redistributed(light, variance)
    assert got.mean() == pytest.approx(light.mean(), rel=0.02)
    assert np.percentile(got, 99.9) < 4.0
    assert left.max() < 0.01 * variance.max()


def test_bright_lines_and_spots_are_not_fireflies():
    light = np.ones((24, 32))
    light[10, 4:20] = light[15:17, 9:11] = 50.0  # a thin line, and a spot of four pixels
    got, _ = redistributed(light, np.zeros_like(light))
    line, spot = got[10, 5:19], got[15:17, 9:11]
    np.testing.assert_allclose(line, 50.0, rtol=0.02)
    np.testing.assert_allclose(spot, 50.0, rtol=0.02)
