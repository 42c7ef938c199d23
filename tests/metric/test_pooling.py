"""Probability, percentages, pooling over channels and sizes."""

import numpy as np
import pytest

from enfilade.metric.pooling import Pool, percent_visible, raised


@pytest.mark.parametrize(("jnd", "probability"), [(0.0, 0.0), (1.0, 0.75), (2.0, 0.9375)])
def test_calibration(jnd, probability):
    # §6: 1 JND is 75 %, 2 JND are 93.75 %.
    pool = Pool(1, np.ones((2, 2), bool), 3.5)
    pool.add(1, raised(np.full((2, 2), jnd**2, np.float32)), 1)
    np.testing.assert_allclose(pool.comparison().probability, probability, rtol=1e-5)


def test_channels_pool_with_exponent_3_5():
    valid = np.ones((5, 6), bool)
    pool = Pool(2, valid, 3.5)
    for jnd in (1.0, 3.0):
        pool.add(1, raised(np.full((5, 6), jnd**2, np.float32)), 1)
    pool.add(2, raised(np.full((3, 4), 2.0**2, np.float32)), 2)
    found = pool.comparison()
    expected = (1 + 3**3.5 + 2**3.5) ** (1 / 3.5)
    np.testing.assert_allclose(found.jnd, expected, rtol=1e-5)
    assert found.score == found.steady.score == pytest.approx(expected, rel=1e-5)
    assert found.steady.band_jnd == pytest.approx(((1 + 3**3.5) ** (1 / 3.5), 2.0), rel=1e-5)
    assert found.transient.score == 0.0


def test_steady_and_transient_parts_add_up():
    pool = Pool(1, np.ones((4, 4), bool), 1.0)
    pool.add(1, np.full((4, 4), 2.0, np.float32), 1)
    pool.add(1, np.full((4, 4), 0.5, np.float32), 1, is_transient=True)
    found = pool.comparison()
    scores = found.steady.score, found.transient.score, found.score
    assert scores == pytest.approx((2.0, 0.5, 2.5), rel=1e-5)
    assert (found.steady.band_jnd, found.transient.band_jnd) == ((2.0,), (0.5,))


def test_percent_counts_valid_pixels_only():
    jnd = np.float32([[0.5, 2.0], [1.0, 3.0]])
    assert percent_visible(jnd, np.ones((2, 2), bool)) == 50.0
    assert percent_visible(jnd, np.array([[True, True], [True, False]])) == pytest.approx(100 / 3)
    assert percent_visible(jnd, np.zeros((2, 2), bool)) == 0.0
