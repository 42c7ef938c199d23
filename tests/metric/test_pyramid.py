"""Half and double size."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enfilade.metric.pyramid import double, halve, halve_periodic, halved_shape

sizes = st.integers(1, 33)


@given(sizes, sizes, st.integers(0, 99))
def test_halve_averages_around_every_second_pixel(height, width, seed):
    fine = np.random.default_rng(seed).random((height, width)).astype(np.float32)
    coarse = halve(fine)
    assert coarse.shape == halved_shape(fine.shape, 2)
    padded = np.pad(fine, ((1, 3), (1, 3)), mode="edge").astype(float)
    for row, column in np.ndindex(coarse.shape):
        around = padded[2 * row : 2 * row + 3, 2 * column : 2 * column + 3]
        weights = np.outer([1, 2, 1], [1, 2, 1]) / 16
        assert coarse[row, column] == pytest.approx((around * weights).sum(), rel=1e-5)


@given(sizes, sizes)
def test_sizes_of_repeated_halving_agree(height, width):
    once = halve(np.ones((height, width), np.float32))
    assert halve(once).shape == halved_shape((height, width), 4)


@given(sizes, sizes)
def test_double_is_exact_on_planes(height, width):
    rows, columns = (np.arange(n) for n in halved_shape((height, width), 2))
    coarse = (2.0 * rows[:, None] - 6.0 * columns).astype(np.float32)
    expected = np.arange(height)[:, None] - 3.0 * np.arange(width)
    np.testing.assert_allclose(double(coarse, (height, width)), expected, atol=1e-4)


def test_periodic_halving_keeps_the_mean():
    fine = np.random.default_rng(1).random((16, 24)).astype(np.float32)
    coarse = halve_periodic(fine)
    assert coarse.shape == (8, 12)
    assert coarse.mean() == pytest.approx(fine.mean(), rel=1e-5)
    around = np.roll(fine, (1, 1), (0, 1))[:3, :3].astype(float)
    assert coarse[0, 0] == pytest.approx((around * np.outer([1, 2, 1], [1, 2, 1])).sum() / 16)
