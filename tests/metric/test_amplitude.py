"""Amplitude nonlinearity."""

import numpy as np
import pytest

from enfilade.metric.amplitude import contrast_shrinkage, response


@pytest.mark.parametrize("level", [0.01, 1.0, 20.0, 100.0, 5000.0])
def test_formula(level):
    expected = 100 * level / (level + 12.6 * level**0.63)
    assert response(np.float32([level]))[0] == pytest.approx(expected, rel=1e-5)


def test_black_is_defined():
    assert response(np.zeros(3, np.float32)).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(("level", "shrinkage"), [(20.0, 0.298), (100.0, 0.258)])
def test_shrinkage_table(level, shrinkage):
    assert contrast_shrinkage(level) == pytest.approx(shrinkage, abs=5e-4)


def test_shrinkage_is_the_slope_on_logarithmic_axes():
    low, high = response(np.float32([29.7, 30.3])).astype(float)
    assert np.log(high / low) / np.log(30.3 / 29.7) == pytest.approx(contrast_shrinkage(30.0), rel=1e-3)
