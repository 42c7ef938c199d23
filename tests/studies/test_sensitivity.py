"""The table of gratings, and sensitivities of the metric to some of them."""

import numpy as np
import pytest

from enfilade.monitor import Silence
from studies.observers import sensitivity
from studies.observers.gratings import STIMULI
from studies.observers.mode import MODERN, PAPER
from studies.observers.threshold import rms_db


def measured(study, mode, *chosen):
    gratings = sensitivity.gratings(study)
    return sensitivity.measure(study, [gratings[index] for index in chosen], mode, Silence())


@pytest.mark.parametrize(
    ("study", "count"), [("robson1966_cpd", 40), ("robson1966_hz", 26), ("laird2006", 6), ("rovamo1993", 29)]
)
def test_gratings_of_half_to_12_cpd_count(study, count):
    found = sensitivity.gratings(study)
    assert len(found) == count
    assert min(grating.frequency_cpd for grating in found) >= 0.5
    assert max(grating.frequency_cpd for grating in found) <= 12.0


def test_every_study_has_its_stimulus():
    assert set(STIMULI) == {"robson1966_cpd", "robson1966_hz", "laird2006", "rovamo1993"}


def test_the_error_is_that_of_the_threshold():
    found = sensitivity.Sensitivities(*np.ones((3, 2)), np.array([10.0, 10.0]), np.array([100.0, 1.0]))
    np.testing.assert_allclose(found.error_db, [20.0, -20.0])
    assert rms_db(found.error_db) == pytest.approx(20.0)


def test_a_drifting_grating_is_seen_worse_the_faster_it_is():
    # 4 cpd at 10 and 30 Hz: the observers' sensitivity falls from 105 to 11.
    slow, fast = measured("laird2006", MODERN, 0, 2).metric
    assert slow > 4.0 * fast


def test_the_papers_mode_loses_fast_gratings():
    # Eq. 4 falls off too early: at 4 cpd and 30 Hz sensitivity is far below that of the observers.
    assert measured("laird2006", PAPER, 2).error_db[0] < -6.0


def test_sensitivity_is_measured_at_each_distance():
    # The smallest fields at 0.5 and 8 cpd, each with its own pixels per degree.
    gratings = sensitivity.gratings("rovamo1993")
    first = [next(i for i, g in enumerate(gratings) if g.frequency_cpd == cpd) for cpd in (0.5, 8.0)]
    found = measured("rovamo1993", PAPER, *first)
    assert found.frequency_cpd.tolist() == [0.5, 8.0]
    assert np.abs(found.error_db).max() < 10.0
