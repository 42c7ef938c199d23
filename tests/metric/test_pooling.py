"""Probability, share, pooling."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enfilade.metric.pooling import detection_probability, percent_visible, raised, root


def test_calibration():
    # §6: 1 JND is 75 %, 2 JND are 93.75 %.
    assert detection_probability(np.float32([0, 1, 2])).tolist() == pytest.approx([0, 0.75, 0.9375])


@given(st.floats(2**-10, 1024, width=32))
def test_one_channel_is_itself(jnd):
    assert root(raised(np.float32([jnd]) ** 2))[0] == pytest.approx(jnd, rel=1e-5)


def test_channels_pool_with_exponent_3_5():
    pooled = root(raised(np.float32([1.0])) + raised(np.float32([1.0])))
    assert pooled[0] == pytest.approx(2 ** (1 / 3.5))


def test_percent_counts_judged_pixels_only():
    jnd = np.float32([[0.5, 2.0], [1.0, 3.0]])
    assert percent_visible(jnd, np.ones((2, 2), bool)) == 50.0
    assert percent_visible(jnd, np.array([[True, True], [True, False]])) == pytest.approx(100 / 3)
    assert percent_visible(jnd, np.zeros((2, 2), bool)) == 0.0
