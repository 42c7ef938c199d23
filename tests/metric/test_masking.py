"""Threshold elevation, against Foley's masks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enfilade.metric.masking import threshold_elevation

# Foley 1994, observer KMF: a 2 cpd Gabor on a sine of the same orientation, dB re contrast 1.
FOLEY_UNMASKED_DB = -31.67
FOLEY_MASK_DB = (-46.1, -42.1, -37.9, -33.9, -30.1, -26.0, -21.9, -17.8, -13.8, -9.7)
FOLEY_TARGET_DB = (-33.3, -34.3, -37.2, -33.7, -32.7, -29.5, -23.5, -21.6, -19.0, -15.7)


def test_foley():
    # In one channel: threshold = Te(mask in its own thresholds) * unmasked threshold. The curve has
    # no facilitation, which makes the largest part of the error.
    sensitivity = 10 ** (-FOLEY_UNMASKED_DB / 20)
    masker = 10 ** (np.float32(FOLEY_MASK_DB) / 20) * sensitivity
    target_db = 20 * np.log10(threshold_elevation(masker) / sensitivity)
    error = np.sqrt(np.mean((target_db - FOLEY_TARGET_DB) ** 2))
    assert error == pytest.approx(2.6, abs=0.1)


def test_formula():
    k1, k2 = 6 ** (1 - 1 / 0.3), 6 ** (1 / 0.3)
    expected = (1 + (k1 * (k2 * 5.0) ** 0.7) ** 4) ** 0.25
    assert threshold_elevation(np.float32([5.0]))[0] == pytest.approx(expected, rel=1e-5)
    assert threshold_elevation(np.zeros(2, np.float32)).tolist() == [1.0, 1.0]


@given(st.floats(0, 1e4, width=32), st.floats(0, 1e4, width=32), st.floats(0, 1))
def test_elevation_rises(one, other, slope):
    low, high = threshold_elevation(np.float32(sorted((one, other))), slope)
    assert 1.0 <= low <= high * (1 + 1e-6)
