"""Reconstruction of pixels: the filter that it converges to, its noise, and lists of pixels."""

from __future__ import annotations

import math

import drjit as dr
import numpy as np
import pytest

from enfilade.arrays import Array3f, matrix3
from enfilade.camera.pinhole import Camera, look_at
from enfilade.kernels.estimate import Estimate, Samples
from enfilade.methods.decoupled.reconstruction import ReconstructedEstimate, smoothed
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from twins.reconstruction import reconstructed

WIDTH, HEIGHT = 24, 16
CAMERA = Camera(look_at((0, 0, 5), (0, 0, 0)), 40.0, WIDTH, HEIGHT)
INNER = np.s_[1:-1, 1:-1]  # at the border the filter ends with the image


def at_image(rays):
    """Image coordinates of camera rays, pixels."""
    x, y, z = matrix3(CAMERA.pixel_from_direction) @ rays.direction
    return x / z, y / z


def half_plane(edge, angle=0.0):
    """White on one side of a line through (edge, 8)."""

    def radiance(rays, sampler):
        x, y = at_image(rays)
        side = (x - edge) * math.cos(angle) + (y - 8.0) * math.sin(angle)
        return Array3f(dr.select(side > 0.0, 1.0, 0.0))

    return radiance


def noise(rays, sampler):
    """0 or 1, of equal probability, in stripes far below a pixel."""
    x, y = at_image(rays)
    phase = 913.7 * x + 571.3 * y
    return Array3f(dr.select(phase - dr.floor(phase) > 0.5, 1.0, 0.0))


def opened(radiance, where=None, *, paths_in_flight=1 << 20, seed=1, **options):
    where = np.ones((HEIGHT, WIDTH), bool) if where is None else where
    pixels = np.flatnonzero(where).astype(np.uint32)
    key = RandomKey(seed, 0, Purpose.DIFFUSE)
    return ReconstructedEstimate(
        CAMERA, pixels, radiance, paths_in_flight=paths_in_flight, random=key, **options
    )


def filtered(radiance, *, spp, seed=1):
    """The same by filter importance sampling."""
    pixels = np.arange(WIDTH * HEIGHT, dtype=np.uint32)
    key = RandomKey(seed, 0, Purpose.DIFFUSE)
    found = Estimate(
        CAMERA, pixels, radiance, paths_in_flight=1 << 20, pixel_filter=PixelFilter.GAUSSIAN, random=key
    )
    found.add(spp)
    return found


def grey(estimate):
    return estimate.shading.color[:, 0].reshape(HEIGHT, WIDTH)


def coverage(edge):
    """Of pixels beyond a vertical edge, by the Gaussian of half a pixel that ends at one and a half."""
    scale, column = 0.5 * math.sqrt(2.0), np.arange(WIDTH) + 0.5
    cut = [max(-1.5, min(1.5, edge - x)) for x in column]
    return np.array([0.5 * (1.0 - math.erf(x / scale) / math.erf(1.5 / scale)) for x in cut])


@pytest.mark.parametrize("has_background", [False, True])
def test_it_is_that_of_the_twin_for_lists_with_unequal_numbers_of_paths(has_background):
    rng = np.random.default_rng(3)
    listed, more = rng.random((2, HEIGHT, WIDTH)) < 0.6
    background = rng.random((HEIGHT, WIDTH)).astype(np.float32) if has_background else None
    samples = {}

    def radiance(rays, sampler):
        x, y = at_image(rays)
        value = 0.5 + 0.5 * dr.sin(3.0 * x) * dr.cos(2.0 * y)
        for u, v, s in zip(*map(np.array, (x, y, value)), strict=True):
            samples.setdefault((math.floor(v), math.floor(u)), []).append((u, v, s))
        return Array3f(value)

    layers = None if background is None else [np.repeat(background[..., None], 3, axis=2)]
    estimate = opened(radiance, listed, background=layers)
    estimate.add(4, rng.random(listed.sum()) < 0.8)  # the others have no paths
    estimate.add(12, more[listed])
    expected = np.array(reconstructed((HEIGHT, WIDTH), samples, background))
    np.testing.assert_allclose(estimate.shading.color[:, 1], expected[listed], atol=2e-5)


def test_it_converges_to_the_gaussian_filter():
    edge = 11.3
    estimate = opened(half_plane(edge))
    estimate.add(256)
    np.testing.assert_allclose(
        grey(estimate)[INNER], np.broadcast_to(coverage(edge), (HEIGHT, WIDTH))[INNER], atol=0.01
    )


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2])
def test_edges_have_less_than_half_the_noise_of_filter_importance_sampling(angle):
    true = filtered(half_plane(11.3, angle), spp=4096)
    errors = []
    for seed in range(2, 10):
        shared = opened(half_plane(11.3, angle), seed=seed)
        shared.add(16)
        errors.append(
            [
                np.square(grey(of) - grey(true))[INNER].mean()
                for of in (shared, filtered(half_plane(11.3, angle), spp=16, seed=seed))
            ]
        )
    ours, theirs = np.sqrt(np.mean(errors, axis=0))
    assert ours < 0.5 * theirs


def test_the_variance_is_that_of_independent_samples():
    images, variances = [], []
    for seed in range(200):
        estimate = opened(noise, seed=seed)
        estimate.add(64)
        images.append(grey(estimate))
        variances.append(estimate.shading.variance.reshape(HEIGHT, WIDTH)[INNER].mean())
    # The integral of the squared filter is 0.322: white noise of a deviation of one half.
    expected = 0.25 / 64 * 0.322
    assert np.mean(variances) == pytest.approx(expected, rel=0.03)
    assert np.var(images, axis=0)[INNER].mean() == pytest.approx(expected, rel=0.1)


def test_a_constant_stays_up_to_the_border_and_in_lists():
    where = np.random.default_rng(1).random((HEIGHT, WIDTH)) < 0.3
    for mask in (None, where):
        estimate = opened(lambda *_: Array3f(0.25, 0.5, 0.75), mask)
        estimate.add(4)
        np.testing.assert_allclose(
            estimate.shading.color,
            np.broadcast_to([0.25, 0.5, 0.75], (len(estimate.shading.color), 3)),
            rtol=1e-6,
        )
        assert not estimate.shading.variance.any()


def test_pixels_without_paths_have_the_background():
    where = np.zeros((HEIGHT, WIDTH), bool)
    where[8, 6:10] = True
    background = np.full((HEIGHT, WIDTH, 3), 0.5, np.float32)
    estimate = opened(lambda *_: Array3f(1.0), where, background=[background])
    assert (estimate.shading.color == 0.5).all()
    estimate.add(4, np.array([False, True, True, False]))
    centre = math.erf(0.5 / math.sqrt(0.5)) / math.erf(1.5 / math.sqrt(0.5))
    side = (1.0 - centre) / 2.0
    share = np.array([side, side + centre, side + centre, side]) * centre
    np.testing.assert_allclose(estimate.shading.color[:, 0], 0.5 + 0.5 * share, rtol=1e-5)


def test_neither_batches_nor_calls_change_the_result():
    whole = opened(half_plane(11.3, 0.3))
    whole.add(32)
    batched = opened(half_plane(11.3, 0.3), paths_in_flight=640)
    batched.add(32)
    np.testing.assert_array_equal(whole.shading.color, batched.shading.color)
    np.testing.assert_array_equal(whole.shading.variance, batched.shading.variance)
    divided = opened(half_plane(11.3, 0.3))
    divided.add(8)
    divided.add(24)
    np.testing.assert_allclose(whole.shading.color, divided.shading.color, rtol=0, atol=1e-6)


def test_paths_that_are_not_finite_do_not_count():
    def radiance(rays, sampler):
        is_bad = sampler.copy().next_1d() < 0.3
        return Samples((Array3f(dr.select(is_bad, math.nan, 2.0)), Array3f(dr.select(is_bad, 1.0, 3.0))))

    estimate = opened(radiance, layers=2)
    estimate.add(16)
    first, second = estimate.shadings
    np.testing.assert_allclose(first.color, 2.0, rtol=1e-6)
    np.testing.assert_allclose(second.color, 3.0, rtol=1e-6)
    assert 0.2 < estimate.count.dropped / estimate.count.rays < 0.4


def test_means_of_single_pixels_are_those_of_the_box_filter():
    def radiance(rays, sampler):
        return Samples(tuple(half_plane(edge)(rays, sampler) for edge in (11.3, 7.8, 3.1)))

    ours = opened(radiance, auxiliary=2, reconstructed=2)
    pixels, key = np.arange(WIDTH * HEIGHT, dtype=np.uint32), RandomKey(1, 0, Purpose.DIFFUSE)
    options = {"paths_in_flight": 1 << 20, "pixel_filter": PixelFilter.BOX, "random": key}
    box = Estimate(CAMERA, pixels, radiance, auxiliary=2, **options)
    for estimate in (ours, box):
        estimate.add(8)
    assert len(ours.shadings) == 2
    for found, expected in zip(ours.unfiltered, box.shadings, strict=True):
        np.testing.assert_allclose(found.color, expected.color, rtol=1e-6)
    np.testing.assert_allclose(
        smoothed(ours.unfiltered[1].color.reshape(HEIGHT, WIDTH, 3))[INNER],
        ours.shadings[1].color.reshape(HEIGHT, WIDTH, 3)[INNER],
        atol=0.3,
    )


def test_radiance_that_follows_the_place_has_no_offset():
    # A ramp: a filter whose pixels were shifted by a tenth of a pixel would show.
    estimate = opened(lambda rays, _: Array3f(at_image(rays)[0], at_image(rays)[1], 0.0))
    estimate.add(64)
    color = estimate.shading.color.reshape(HEIGHT, WIDTH, 3)[INNER]
    row, column = np.mgrid[1 : HEIGHT - 1, 1 : WIDTH - 1] + 0.5
    np.testing.assert_allclose(color[..., 0], column, atol=0.02)
    np.testing.assert_allclose(color[..., 1], row, atol=0.02)
