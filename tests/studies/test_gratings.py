"""Frames of gratings against facts that have a closed form."""

import numpy as np
import pytest

from enfilade.metric import Aqm, SequenceAqm
from studies.observers.gratings import (
    DRIFT_FRAMES,
    FPS,
    LEAST_FLICKER_FRAMES,
    PIXELS_PER_DEGREE,
    STIMULI,
    Grating,
)
from studies.observers.sensitivity import gratings
from studies.observers.threshold import sequence_threshold


def frequency_cpd(pattern, pixels_per_degree):
    """Peak of the spectrum along the middle row."""
    row = pattern[pattern.shape[0] // 2]
    spectrum = np.abs(np.fft.rfft(row, 16 * len(row)))
    return np.argmax(spectrum) / (16 * len(row)) * pixels_per_degree


@pytest.mark.parametrize("study", STIMULI)
def test_bars_are_upright_and_of_the_gratings_frequency(study):
    for grating in gratings(study)[::5]:
        if grating.frequency_cpd * np.sqrt(grating.area_deg2) < 4.0:
            continue  # the spectrum of a few periods is too broad for the tolerance
        stimulus = STIMULI[study](grating)
        pattern = stimulus.patterns[0]
        found = frequency_cpd(pattern, stimulus.viewing.pixels_per_degree)
        assert found == pytest.approx(grating.frequency_cpd, rel=0.02)
        assert np.abs(pattern).max() == pytest.approx(
            1.0, abs=0.05
        )  # pixels miss the crest by up to 0.1 period


@pytest.mark.parametrize("study", ["robson1966_cpd", "rovamo1993"])
def test_fields_are_squares_of_the_experiments_area_within_the_image(study):
    for grating in gratings(study):
        stimulus = STIMULI[study](grating)
        inside = stimulus.patterns[0] != 0.0
        side_px = np.sqrt(grating.area_deg2) * stimulus.viewing.pixels_per_degree
        assert np.count_nonzero(inside.any(axis=1)) == pytest.approx(side_px, abs=2.0)  # whole pixels
        assert not inside[:, [0, -1]].any()


def test_flicker_lasts_a_quarter_of_a_period_and_has_the_gratings_rate():
    for hertz in (0.5, 8.0, 32.0):
        stimulus = STIMULI["robson1966_hz"](Grating(4.0, hertz, 20.0, 6.25, 1.0))
        assert len(stimulus.patterns) >= max(LEAST_FLICKER_FRAMES, 0.25 * FPS / hertz)
        assert stimulus.step_px == 0.0
        first = stimulus.patterns[0]
        contrasts = [np.vdot(first, pattern) / np.vdot(first, first) for pattern in stimulus.patterns]
        times_s = np.arange(len(contrasts)) / FPS
        np.testing.assert_allclose(contrasts, np.cos(2.0 * np.pi * hertz * times_s), atol=1e-12)


def test_the_mean_of_a_flickering_field_is_constant():
    for grating in gratings("robson1966_cpd"):
        for pattern in STIMULI["robson1966_cpd"](grating).patterns:
            assert abs(pattern.mean()) < 1e-12


def test_a_drifting_grating_moves_to_the_right_behind_its_window():
    # 4 cpd at 24 Hz: 6 deg/s, 2 pixels a frame.
    stimulus = STIMULI["laird2006"](Grating(4.0, 24.0, 60.0, 4.75, 1.0))
    assert len(stimulus.patterns) == DRIFT_FRAMES
    assert stimulus.step_px == pytest.approx(2.0)
    x = (np.arange(240) - 119.5) / PIXELS_PER_DEGREE
    envelope = np.exp(-0.5 * x**2 * np.pi / 4.75)
    first, second = (pattern[120] / envelope for pattern in stimulus.patterns[:2])
    np.testing.assert_allclose(second[2:], first[:-2], atol=1e-9)
    # The window's energy is half of pi sigma^2 = 4.75 deg2, but for what the image cuts off (a few percent).
    energy = sum(np.sum(pattern**2) for pattern in stimulus.patterns) / DRIFT_FRAMES / PIXELS_PER_DEGREE**2
    assert energy == pytest.approx(4.75 / 2.0, rel=0.05)


def test_at_the_threshold_of_a_sequence_its_largest_difference_is_1_jnd():
    stimulus = STIMULI["robson1966_hz"](Grating(4.0, 16.0, 20.0, 6.25, 1.0))
    observer = Aqm.modern(stimulus.viewing)
    contrast = sequence_threshold(observer, stimulus.patterns, 20.0, guess=0.02)
    metric, background = SequenceAqm(observer), np.full((128, 128), 20.0, np.float32)
    tests = (20.0 * (1.0 + contrast * pattern) for pattern in stimulus.patterns)
    largest = max(float(metric.compare(test.astype(np.float32), background).jnd.max()) for test in tests)
    assert largest == pytest.approx(1.0, abs=0.02)  # 0.05 dB of contrast, doubled by the square law
