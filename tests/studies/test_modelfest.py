"""The targets of ModelFest against facts that have a closed form, and thresholds."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from enfilade.metric import HalvesAqm, LuminanceHalves, Pursuit
from enfilade.monitor import Silence
from studies.observers import modelfest
from studies.observers.mode import PAPER
from studies.observers.modelfest import PIXELS_PER_DEGREE, SIZE_PX, Thresholds, target
from studies.observers.screen import screen
from studies.observers.threshold import response_jnd, threshold_contrast

NUMBERS = [n for n in range(1, 44) if n not in modelfest.IMAGES]
CENTRE = SIZE_PX // 2
PIXEL_DEG2 = PIXELS_PER_DEGREE**-2


def energy(pattern):
    return float(np.sum(pattern**2)) * PIXEL_DEG2


def test_41_targets_are_256_pixels_wide_and_of_contrast_1():
    assert len(NUMBERS) == 41
    for pattern in map(target, NUMBERS):
        assert pattern.shape == (256, 256)
        assert np.abs(pattern).max() == pytest.approx(1.0, abs=1e-3)


# The integral of cos^2 times a squared Gaussian is half of pi sx sy, up to exp(-(2 pi f s)^2).
@pytest.mark.parametrize(
    ("number", "deg2"),
    [(11, 0.28 * 0.28 / 2), (12, 0.14 * 0.14 / 2), (13, 0.07 * 0.07 / 2), (18, 0.28 * 0.14 / 2),
     (20, 0.14 * 0.28 / 2), (27, (8.43 / 60) ** 2), (28, (2.106 / 60) ** 2)],
)  # fmt: skip
def test_energy_of_gabors_and_gaussians(number, deg2):
    assert energy(target(number)) == pytest.approx(math.pi * deg2, rel=0.01)


@pytest.mark.parametrize(("number", "cpd"), [(4, 4.0), (6, 8.0), (8, 16.0)])
def test_gabors_peak_at_their_frequency_with_bars_that_lie(number, cpd):
    spectrum = np.abs(np.fft.rfft2(target(number), s=(1200, 1200)))  # a tenth of a cycle per degree a bin
    row, column = np.unravel_index(np.argmax(spectrum[:600]), (600, 601))
    assert (row / 10.0, column) == (pytest.approx(cpd, abs=0.1), 0)


def test_the_plaids_are_the_means_of_their_gabors():
    upright, oblique = target(37), target(36)
    lying = target(12)
    np.testing.assert_allclose(target(39), 0.5 * (upright + lying), atol=1e-12)
    np.testing.assert_allclose(target(38), 0.5 * (oblique + lying), atol=1e-12)
    np.testing.assert_allclose(upright[1:, 1:], lying[1:, 1:].T, atol=1e-12)


def test_lines_edges_and_discs():
    assert np.count_nonzero(target(31).any(axis=1)) == 1
    dipole = target(32)
    assert np.flatnonzero(dipole.any(axis=1)).tolist() == [CENTRE, CENTRE + 1]
    assert dipole[CENTRE, CENTRE] == 1.0
    assert dipole[CENTRE + 1, CENTRE] == pytest.approx(-1.0, abs=1e-3)
    edge = target(30)
    assert (edge[:CENTRE] < 0).all()
    assert (edge[CENTRE:] > 0).all()
    assert float(target(40).sum()) * PIXEL_DEG2 == pytest.approx(math.pi * 0.125**2, rel=0.02)


def test_five_gabors_in_phase_and_alternating_are_35_pixels_apart():
    same, alternating = target(33), target(34)
    apart_px = 0.35 * PIXELS_PER_DEGREE
    for place in range(-2, 3):
        column = CENTRE + round(place * apart_px)
        assert same[CENTRE, column] == pytest.approx(1.0, abs=1e-3)
        assert alternating[CENTRE, column] == pytest.approx((-1.0) ** place, abs=1e-3)


def test_the_checkerboards_fundamental_is_4_cpd_along_the_diagonals():
    spectrum = np.abs(np.fft.rfft2(target(42), s=(1200, 1200)))
    row, column = np.unravel_index(np.argmax(spectrum[:600]), (600, 601))
    assert math.hypot(row, column) / 10.0 == pytest.approx(4.0, abs=0.1)
    assert row == pytest.approx(column, abs=1)


def test_one_gain_is_taken_off():
    number = np.arange(3)
    observers = np.array([30.0, 20.0, 10.0])
    found = Thresholds(number, observers, observers - np.array([3.0, 4.0, 5.0]), np.ones(3))
    assert found.gain_db == pytest.approx(4.0)
    np.testing.assert_allclose(found.error_db, [1.0, 0.0, -1.0])
    assert found.rms_db == pytest.approx(math.sqrt(2.0 / 3.0))
    # Each error with the gain of the other two: 1.5, 0, -1.5.
    assert found.cross_validation_rms_db == pytest.approx(math.sqrt(1.5))


def test_round_gabors_up_to_12_cpd_are_evaluated_without_a_gain():
    number = np.array(NUMBERS)
    error = np.full(41, 5.0)
    error[np.isin(number, [1, 2, 3, 4, 5, 6, 7, 11, 12, 13])] = -3.0
    assert Thresholds(number, np.zeros(41), error, np.ones(41)).gabors_rms_db == pytest.approx(3.0)


def test_a_threshold_is_where_the_response_is_1_jnd():
    observer = PAPER.aqm(screen(SIZE_PX, PIXELS_PER_DEGREE))
    pattern = target(4)
    contrast = threshold_contrast(observer, pattern, 30.0, guess=0.2)
    background = np.full(pattern.shape, 30.0, np.float32)
    test = (30.0 * (1.0 + contrast * pattern)).astype(np.float32)
    assert response_jnd(observer, test, background) == pytest.approx(1.0, abs=0.01)
    assert 0.002 < contrast < 0.02  # observers: 0.0078


class LinearMetric:
    """A metric of half a JND for a contrast of 1."""

    def compare(self, test, background):
        return SimpleNamespace(jnd=0.5 * np.abs(test - background) / background)


def test_a_threshold_beyond_the_range_of_the_display_is_above_1():
    assert threshold_contrast(LinearMetric(), -target(29), 30.0) == pytest.approx(2.0, rel=1e-3)


class WithoutNoise:
    """The metric of halves for images without noise."""

    def __init__(self, viewing):
        self.viewing = viewing
        self._aqm = HalvesAqm(viewing)

    def compare(self, test, reference):
        images = LuminanceHalves(test, test), LuminanceHalves(reference, reference)
        (found,) = self._aqm.compare_each(*images, pursuits=[Pursuit.BOTH])
        return found


@pytest.mark.slow
def test_the_gain_of_the_metric_of_halves_is_that_of_modelfest():
    found = modelfest.measure(SimpleNamespace(name="halves", aqm=WithoutNoise), Silence())
    assert found.gain_db == pytest.approx(0.0, abs=0.02)  # GAIN_DB is applied already
    assert found.rms_db == pytest.approx(3.9, abs=0.1)
