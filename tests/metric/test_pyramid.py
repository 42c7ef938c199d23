"""Half and double size."""

import numpy as np
import pytest

from enfilade.metric.pyramid import Pyramid, double, halve, halved_shape

SHAPES = [(1, 1), (1, 8), (2, 3), (7, 16), (12, 33)]


@pytest.mark.parametrize("shape", SHAPES)
def test_halve_averages_around_every_second_pixel(shape):
    fine = np.random.default_rng(3).random(shape).astype(np.float32)
    coarse = halve(fine)
    assert coarse.shape == halved_shape(shape, 2)
    assert halve(coarse).shape == Pyramid(fine).at(4).shape == halved_shape(shape, 4)
    padded = np.pad(fine, ((1, 3), (1, 3)), mode="edge").astype(float)
    for row, column in np.ndindex(coarse.shape):
        around = padded[2 * row : 2 * row + 3, 2 * column : 2 * column + 3]
        weights = np.outer([1, 2, 1], [1, 2, 1]) / 16
        assert coarse[row, column] == pytest.approx((around * weights).sum(), rel=1e-5)


@pytest.mark.parametrize("shape", SHAPES)
def test_double_is_exact_on_planes(shape):
    rows, columns = (np.arange(n) for n in halved_shape(shape, 2))
    coarse = (2.0 * rows[:, None] - 6.0 * columns).astype(np.float32)
    expected = np.arange(shape[0])[:, None] - 3.0 * np.arange(shape[1])
    np.testing.assert_allclose(double(coarse, shape), expected, atol=1e-4)
