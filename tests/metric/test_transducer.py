"""Masking by a transducer: its twin, threshold, facilitation, slope, symmetry."""

import numpy as np
import pytest
import scipy.ndimage
from hypothesis import given
from hypothesis import strategies as st

from enfilade.metric.aperture import APERTURE_SIGMA_DEG, Aperture
from enfilade.metric.transducer import Transducer, energy_difference
from twins import transducer as twin

NARROW = Transducer(semi_saturation=0.7, neighbour_fraction=0.0)  # fitted without neighbouring bands


@pytest.mark.parametrize("count", [1, 3])
def test_twin(count):
    ppd, shape, random = 28.0, (48, 64), np.random.default_rng(8)
    aperture = Aperture(shape, ppd, APERTURE_SIGMA_DEG)
    shown, energies = [], []
    for _ in range(count):
        smooth = scipy.ndimage.gaussian_filter(random.standard_normal((2, 6, *shape)), (0, 0, 1.5, 1.5))
        reference = (12.0 * smooth[0]).astype(np.float32)
        test = (reference + 8.0 * smooth[1] * (np.arange(shape[1]) > 30)).astype(np.float32)
        shown.append((reference, test))
        channels = zip(reference, test, strict=True)
        maps = [
            [aperture.coarse(m, 1) for m in energy_difference(*(c.copy() for c in pair))] for pair in channels
        ]
        energies.append(aperture.integrate(np.stack(maps, axis=1), 1))
    places = [(0, 32), (24, 32), (24, 40), (40, 8), (24, 56)]
    found, expected = np.zeros(len(places)), np.zeros(len(places))
    for k in range(count):
        jnd = Transducer().difference(energies[k], energies[max(k - 1, 0) : k] + energies[k + 1 : k + 2])
        found += [jnd[:, y // aperture.reduction, x // aperture.reduction].sum() for y, x in places]
        neighbours = shown[max(k - 1, 0) : k] + shown[k + 1 : k + 2]
        expected += [twin.band_jnd(shown[k], neighbours, y, x, ppd) for y, x in places]
    # The aperture is sampled at every eighth pixel.
    np.testing.assert_allclose(found, expected, rtol=0.04, atol=0.03 * max(expected))


def jnd(mask, target):
    """J of a target on a mask in one of six orientations, both in thresholds and in phase."""
    energies = np.zeros((3, 6, 1), np.float32)
    energies[:, 2] = energy_difference(*(np.float32([value]) for value in (mask, mask + target)))
    return float(NARROW.difference(energies).sum())


def threshold(mask):
    low, high = 1e-3, 1e3
    for _ in range(40):
        middle = np.sqrt(low * high)
        low, high = (low, middle) if jnd(mask, middle) > 1 else (middle, high)
    return high


def test_a_faint_mask_facilitates_and_a_strong_one_hides():
    assert jnd(0.0, 1.0) == pytest.approx(1.0)
    assert 0.8 < min(threshold(mask) for mask in (0.3, 0.4, 0.5, 0.6)) < 0.96
    assert threshold(10.0) > 3.0
    # On logarithmic axes thresholds rise with slope 0.6 (Legge and Foley 1980).
    assert np.log2(threshold(80.0) / threshold(40.0)) == pytest.approx(0.6, abs=0.03)


@given(mask=st.floats(-30, 30), target=st.floats(-30, 30))
def test_swapping_changes_nothing(mask, target):
    assert jnd(mask + target, -target) == pytest.approx(jnd(mask, target), rel=1e-3, abs=1e-4)
    assert jnd(mask, 0.0) == 0.0


def test_another_pattern_of_equal_energy_is_seen():
    # The mask's sign turned: no energy more or less, but a difference of twice the mask.
    assert jnd(3.0, -6.0) > jnd(3.0, 1.0) > 0


def test_a_mask_of_another_orientation_hides_nothing():
    energies = np.zeros((3, 6, 1), np.float32)
    energies[:, 1] = energy_difference(np.float32([0.0]), np.float32([1.0]))
    energies[:2, 4] = 50.0**2
    assert NARROW.difference(energies)[1] == pytest.approx(1.0)
