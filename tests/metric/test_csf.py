"""Eq. 4 against its table."""

import numpy as np
import pytest

from enfilade.metric.csf import spatiovelocity_sensitivity

# Eq. 4 evaluated by hand to the digits shown: (v deg/s, (S at 0.5, 1, 2, 4, 8, 16 cpd)).
TABLE = [
    (0.15, (15.770, 51.294, 135.670, 237.282, 181.453, 26.528)),
    (1.00, (37.974, 108.186, 219.522, 225.961, 59.852, 1.050)),
    (5.00, (111.04, 169.555, 98.835, 8.396, 0.015, 0.0)),
]
PEAKS = [(0.15, 4.835, 245.44), (1.00, 2.947, 250.64), (5.00, 1.038, 169.79)]


@pytest.mark.parametrize(("velocity", "row"), TABLE)
def test_table(velocity, row):
    for frequency, sensitivity in zip((0.5, 1.0, 2.0, 4.0, 8.0, 16.0), row, strict=True):
        got = spatiovelocity_sensitivity(frequency, velocity)
        assert got == pytest.approx(sensitivity, rel=1e-4, abs=5e-4)


@pytest.mark.parametrize(("velocity", "frequency", "sensitivity"), PEAKS)
def test_peaks(velocity, frequency, sensitivity):
    frequencies = np.linspace(0.5, 6, 5501)
    curve = np.array([spatiovelocity_sensitivity(f, velocity) for f in frequencies])
    assert frequencies[curve.argmax()] == pytest.approx(frequency, abs=2e-3)
    assert curve.max() == pytest.approx(sensitivity, rel=1e-4)


def test_arrays_keep_their_type():
    speeds = np.float32([0.15, 1.0, 5.0])
    curve = spatiovelocity_sensitivity(2.0, speeds)
    assert curve.dtype == np.float32
    np.testing.assert_allclose(curve, [135.670, 219.522, 98.835], rtol=1e-5)
