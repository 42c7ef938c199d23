"""Foley's stimuli, and a masked threshold."""

import numpy as np
import pytest

from studies.observers.foley import (
    FREQUENCY_CPD,
    PIXELS_PER_DEGREE,
    SIGMA_DEG,
    SIZE_PX,
    Masking,
    gabor_and_sine,
)
from studies.observers.mode import PAPER
from studies.observers.screen import screen
from studies.observers.tables import read_columns
from studies.observers.threshold import threshold_contrast


def test_target_and_mask_are_in_phase_and_of_contrast_1():
    gabor, sine = gabor_and_sine()
    assert gabor.max() == sine.max() == 1.0
    assert (gabor * sine >= 0.0).all()
    assert np.sum(gabor**2) / PIXELS_PER_DEGREE**2 == pytest.approx(np.pi * SIGMA_DEG**2 / 2.0, rel=0.01)
    periods = np.argmax(np.abs(np.fft.rfft(sine[0])))
    assert periods == SIZE_PX / PIXELS_PER_DEGREE * FREQUENCY_CPD


def test_the_table_has_ten_masks():
    _, observers = read_columns("foley.csv", "mask_db", "threshold_db")
    assert len(observers["mask_db"]) == 10
    assert (np.diff(observers["mask_db"]) > 0).all()


def test_a_strong_mask_raises_the_threshold():
    observer = PAPER.aqm(screen(SIZE_PX, PIXELS_PER_DEGREE))
    gabor, sine = gabor_and_sine()
    alone = threshold_contrast(observer, gabor, 32.0)
    masked = threshold_contrast(observer, gabor, 32.0, mask=0.3 * sine)
    assert masked > 2.0 * alone


def test_errors_are_the_metrics_less_the_observers():
    masking = Masking(np.array([-20.0, -10.0]), np.array([-25.0, -15.0]), np.array([-22.0, -19.0]), 0.0)
    np.testing.assert_allclose(masking.error_db, [3.0, -4.0])
    assert masking.rms_db == pytest.approx(np.sqrt(12.5))
