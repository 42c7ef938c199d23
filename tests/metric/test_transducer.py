"""Masking by a transducer: threshold, facilitation, slope, symmetry."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enfilade.metric.transducer import energy_difference, transduced_difference

ORIENTATIONS = 6
Z = 0.7  # what was fitted without broad masking


def jnd(mask, target):
    """J of a target on a mask in one of six orientations, both in thresholds and in phase."""
    energies = np.zeros((3, ORIENTATIONS, 1), np.float32)
    contrasts = (np.float32([value]) for value in (mask, mask + target))
    energies[:, 2] = energy_difference(*contrasts)
    return float(transduced_difference(*energies, semi_saturation=Z).sum())


def threshold(mask):
    low, high = 1e-3, 1e3
    for _ in range(40):
        middle = np.sqrt(low * high)
        low, high = (low, middle) if jnd(mask, middle) > 1 else (middle, high)
    return high


def test_one_jnd_at_threshold():
    assert jnd(0.0, 1.0) == pytest.approx(1.0)


def test_a_faint_mask_helps_and_a_strong_one_hides():
    assert 0.8 < min(threshold(mask) for mask in (0.3, 0.4, 0.5, 0.6)) < 0.96
    assert threshold(10.0) > 3.0
    # On logarithmic axes thresholds rise with slope 0.6 (Legge and Foley 1980).
    assert np.log2(threshold(80.0) / threshold(40.0)) == pytest.approx(0.6, abs=0.03)


@given(mask=st.floats(-30, 30), target=st.floats(-30, 30))
def test_swapping_changes_nothing(mask, target):
    assert jnd(mask + target, -target) == pytest.approx(jnd(mask, target), rel=1e-3, abs=1e-4)


@given(contrast=st.floats(-100, 100))
def test_nothing_is_nothing(contrast):
    assert jnd(contrast, 0.0) == 0.0


def test_another_pattern_of_equal_energy_is_seen():
    # The mask's sign turned: no energy more or less, but a difference of twice the mask.
    assert jnd(3.0, -6.0) > jnd(3.0, 1.0) > 0


def test_a_mask_of_another_orientation_hides_nothing():
    energies = np.zeros((3, ORIENTATIONS, 1), np.float32)
    energies[:, 1] = energy_difference(np.float32([0.0]), np.float32([1.0]))
    energies[:2, 4] = 50.0**2
    assert transduced_difference(*energies, semi_saturation=Z)[1] == pytest.approx(1.0)
