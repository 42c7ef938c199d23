"""Amplitude nonlinearity."""

import numpy as np
import pytest

from enfilade.metric.amplitude import contrast_gain, response


def test_formula():
    level = np.array([0.01, 1.0, 20.0, 100.0, 5000.0])
    expected = 100 * level / (level + 12.6 * level**0.63)
    np.testing.assert_allclose(response(level.astype(np.float32)), expected, rtol=1e-5)
    assert response(np.zeros(3, np.float32)).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(("level", "gain"), [(20.0, 0.298), (100.0, 0.258)])
def test_gain_is_the_slope_on_logarithmic_axes(level, gain):
    low, high = response(np.float32([0.99 * level, 1.01 * level])).astype(float)
    assert contrast_gain(level) == pytest.approx(gain, abs=5e-4)
    assert np.log(high / low) / np.log(1.01 / 0.99) == pytest.approx(gain, rel=3e-3)
