"""The table of sensitivities, and both CSFs on it."""

import numpy as np
import pytest

from studies.observers import sensitivity
from studies.observers.mode import MODERN, PAPER


def test_sensitivities_of_modelfest_are_those_of_its_targets():
    found = sensitivity.measure("modelfest", PAPER)
    at_4_cpd = found.observers[(found.frequency_cpd == 4.0) & (found.area_deg2 > 0.7)]
    assert 20.0 * np.log10(at_4_cpd) == pytest.approx(42.13, abs=0.01)  # target 4


@pytest.mark.parametrize(("study", "count"), [("robson1966", 66), ("laird2006", 6), ("modelfest", 10)])
def test_gratings_of_half_to_12_cpd_count(study, count):
    found = sensitivity.measure(study, PAPER)
    assert len(found.observers) == count
    assert found.frequency_cpd.min() >= 0.5
    assert found.frequency_cpd.max() <= 12.0


def test_eq_4_misses_moving_gratings_and_castle_does_not():
    paper, modern = (sensitivity.measure("laird2006", mode).rms_db for mode in (PAPER, MODERN))
    assert paper == pytest.approx(16.7, abs=0.1)
    assert modern < 3.0
