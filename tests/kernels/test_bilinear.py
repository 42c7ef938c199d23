"""Bilinear interpolation against its twin."""

import numpy as np
import pytest

from enfilade.arrays import Float, image, lanes, pixel_grid
from enfilade.kernels.bilinear import bilinear_taps, sample
from twins.bilinear import interpolated

H, W = 7, 9
RANDOM = np.random.default_rng(3)
VALUES = RANDOM.random((H, W, 3)).astype(np.float32)


def positions(count=500):
    """Anywhere in the image and a little beyond its border."""
    x = RANDOM.uniform(-2, W + 2, count).astype(np.float32)
    y = RANDOM.uniform(-2, H + 2, count).astype(np.float32)
    return x, y


def test_interpolation_matches_its_twin():
    x, y = positions()
    got = np.array(sample(lanes(VALUES), Float(x), Float(y), width=W, height=H)).T
    expected = np.array([interpolated(VALUES, float(a), float(b)) for a, b in zip(x, y, strict=True)])
    np.testing.assert_allclose(got, expected, atol=1e-6)  # four products and sums of numbers up to 1


@pytest.mark.parametrize("channels", [1, 2, 3])
def test_values_at_pixel_centres_are_exact(channels):
    values = VALUES[..., :channels]
    _, column, row = pixel_grid(H, W)
    got = sample(
        lanes(np.ascontiguousarray(values[..., 0] if channels == 1 else values)),
        Float(column) + 0.5,
        Float(row) + 0.5,
        width=W,
        height=H,
    )
    assert image(got, H, W).tobytes() == np.ascontiguousarray(values).tobytes()


def test_positions_off_by_float32_rounding_count_as_centres():
    x, y = np.float32(1919.5) * np.float32(1 + 6e-8), np.float32(5.5)
    taps = bilinear_taps(Float(x), Float(y), width=1920, height=1080)
    weights = {int(tap.lane[0]): float(tap.weight[0]) for tap in taps if tap.weight[0] != 0.0}
    assert weights == {5 * 1920 + 1919: 1.0}


def test_weights_sum_to_one_and_are_not_negative():
    x, y = positions()
    weights = np.array([np.array(t.weight) for t in bilinear_taps(Float(x), Float(y), width=W, height=H)])
    assert (weights >= 0.0).all()
    assert (weights.sum(axis=0) == 1.0).all()  # multiples of 1/65536: exact


def test_a_linear_ramp_is_reproduced():
    ramp = np.tile(np.arange(W, dtype=np.float32) + 0.5, (H, 1))
    x = np.array([0.5, 0.75, 4.0, 8.5], np.float32)
    got = sample(lanes(ramp), Float(x), Float(3.3), width=W, height=H)
    np.testing.assert_allclose(np.array(got), x, atol=1e-6)


def test_beyond_the_border_the_outermost_pixel_is_repeated():
    x = np.array([-5, 0.2, W - 0.1, W + 40], np.float32)
    got = np.array(sample(lanes(VALUES[..., 0]), Float(x), Float(2.5), width=W, height=H))
    np.testing.assert_array_equal(got, VALUES[2, [0, 0, W - 1, W - 1], 0])
