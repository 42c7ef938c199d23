"""Foley's stimuli, and a masked threshold."""

import numpy as np
import pytest

from studies.observers.foley import (
    ANGLES_DEG,
    FREQUENCY_CPD,
    PIXELS_PER_DEGREE,
    SIGMA_DEG,
    SIZE_PX,
    Masking,
    gabor,
    sine,
)
from studies.observers.mode import PAPER
from studies.observers.screen import screen
from studies.observers.tables import read_columns
from studies.observers.threshold import threshold_contrast


def test_target_and_mask_are_in_phase_and_of_contrast_1():
    target, mask = gabor(), sine()
    assert target.max() == mask.max() == 1.0
    assert (target * mask >= 0.0).all()
    assert np.sum(target**2) / PIXELS_PER_DEGREE**2 == pytest.approx(np.pi * SIGMA_DEG**2 / 2.0, rel=0.01)
    periods = np.argmax(np.abs(np.fft.rfft(mask[0])))
    assert periods == SIZE_PX / PIXELS_PER_DEGREE * FREQUENCY_CPD


def test_a_mask_at_an_angle_is_turned_about_the_centre():
    centre = SIZE_PX // 2
    for angle_deg in ANGLES_DEG:
        assert sine(angle_deg)[centre, centre] == 1.0
    np.testing.assert_allclose(sine(90)[:, centre], sine(0)[centre], atol=1e-12)
    oblique = sine(45)
    np.testing.assert_allclose(oblique, oblique.T, atol=1e-12)
    np.testing.assert_allclose(oblique[1:, :-1], oblique[:-1, 1:], atol=1e-12)  # constant along x + y


@pytest.mark.parametrize(("angle_deg", "count"), [(0, 10), (45, 10), (90, 9)])
def test_the_table_has_the_masks_of_each_angle(angle_deg, count):
    _, table = read_columns("foley.csv", "mask_angle_deg", "mask_db")
    masks_db = table["mask_db"][table["mask_angle_deg"] == angle_deg]
    assert len(masks_db) == count
    assert (np.diff(masks_db) > 0).all()


def test_a_strong_mask_raises_the_threshold():
    observer = PAPER.aqm(screen(SIZE_PX, PIXELS_PER_DEGREE))
    alone = threshold_contrast(observer, gabor(), 32.0)
    masked = threshold_contrast(observer, gabor(), 32.0, mask=0.3 * sine())
    assert masked > 2.0 * alone


def test_errors_are_the_metrics_less_the_observers():
    masking = Masking(np.array([-20.0, -10.0]), np.array([-25.0, -15.0]), np.array([-22.0, -19.0]), 0.0)
    np.testing.assert_allclose(masking.error_db, [3.0, -4.0])
    assert masking.rms_db == pytest.approx(np.sqrt(12.5))
