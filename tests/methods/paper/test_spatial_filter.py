"""Gaussian convolution of varying width against its twin."""

import numpy as np
import pytest

from enfilade.arrays import image, lanes
from enfilade.methods.paper.spatial_filter import blur_axis, reconstruct
from twins.blur import blurred, blurred_rows

H, W = 21, 26
ROUNDING = 2e-6  # of values up to 1: some 11 products, added and divided in float32


def noise_image():
    return np.random.default_rng(11).random((H, W, 3)).astype(np.float32)


def supports():
    yield "at rest", np.full((H, W), 3.0, np.float32)
    yield "even", np.full((H, W), 4.0, np.float32)
    yield "fast", np.full((H, W), 11.0, np.float32)
    yield "wider than the image", np.full((H, W), 31.0, np.float32)
    yield "one pixel", np.full((H, W), 1.0, np.float32)
    yield "varying", np.random.default_rng(12).uniform(1, 12, (H, W)).astype(np.float32)


@pytest.mark.parametrize(("name", "support"), list(supports()), ids=lambda v: v if isinstance(v, str) else "")
def test_convolution_matches_its_twin(name, support):
    np.testing.assert_allclose(
        reconstruct(noise_image(), support), blurred(noise_image(), support), atol=ROUNDING
    )


@pytest.mark.parametrize("axis", [0, 1])
def test_each_axis_matches_its_twin(axis):
    support = np.linspace(1, 11, H * W, dtype=np.float32).reshape(H, W)
    got = image(blur_axis(lanes(noise_image()), lanes(support), width=W, height=H, axis=axis), H, W)
    if axis == 0:
        expected = blurred_rows(noise_image(), support)
    else:
        expected = blurred_rows(noise_image().swapaxes(0, 1), support.T).swapaxes(0, 1)
    np.testing.assert_allclose(got, expected, atol=ROUNDING)


@pytest.mark.parametrize(("name", "support"), list(supports()), ids=lambda v: v if isinstance(v, str) else "")
def test_a_constant_image_stays_constant(name, support):
    color = np.full((H, W, 3), 0.7, np.float32)
    np.testing.assert_allclose(reconstruct(color, support), color, rtol=ROUNDING)


def test_a_support_of_one_changes_nothing():
    color = noise_image()
    np.testing.assert_array_equal(reconstruct(color, np.ones((H, W), np.float32)), color)


def test_the_impulse_response_is_the_gaussian():
    color = np.zeros((H, W, 3), np.float32)
    color[10, 13] = 1.0
    row = reconstruct(color, np.full((H, W), 9.0, np.float32))[10, :, 0]
    ratios = row[13 : 13 + 5] / row[13]
    np.testing.assert_allclose(ratios, np.exp(-0.5 * (np.arange(5) / 1.5) ** 2), rtol=1e-5)  # sigma 9 / 6
    assert not row[: 13 - 4].any()
    assert not row[13 + 5 :].any()


def test_images_of_one_column_or_row():
    for size in ((1, 9), (9, 1), (1, 1)):
        color = np.random.default_rng(1).random((*size, 3)).astype(np.float32)
        support = np.full(size, 7.0, np.float32)
        np.testing.assert_allclose(reconstruct(color, support), blurred(color, support), atol=ROUNDING)
