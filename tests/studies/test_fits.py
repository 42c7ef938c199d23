"""Fits with a part left out: by hand on small tables, and that the metric has what they are about."""

import numpy as np
import pytest

from enfilade.metric import Transducer
from enfilade.metric.aperture import APERTURE_SIGMA_DEG
from studies.observers.fits import APERTURES_DEG, TRANSDUCERS, fit

CANDIDATES = ((1.0,), (2.0,))


def test_a_measurement_that_alone_asks_for_a_number_is_judged_without_it():
    # All but the last ask for 1; the last alone would have the whole fit ask for 2.
    errors = np.array([[0.5, -0.5, 0.5, 9.0], [1.0, -1.0, 1.0, 0.0]])
    found = fit("number", "made up", CANDIDATES, (2.0,), errors)
    assert found.rms_db == pytest.approx(np.sqrt(3 / 4))
    assert found.left_out_rms_db == pytest.approx(np.sqrt((1 + 1 + 1 + 81) / 4))
    assert (found.least, found.most) == ((1.0,), (2.0,))


def test_the_gain_is_the_others():
    errors = np.array([[1.0, 3.0, 8.0], [10.0, 20.0, 60.0]])
    found = fit("number", "made up", CANDIDATES, (1.0,), errors, has_gain=True)
    assert found.rms_db == pytest.approx(np.std([1.0, 3.0, 8.0]))
    assert found.left_out_rms_db == pytest.approx(np.sqrt((4.5**2 + 1.5**2 + 6**2) / 3))
    assert found.least == found.most == (1.0,)


def test_what_the_metric_has_is_among_the_candidates():
    has = Transducer()
    assert (has.neighbour_fraction, has.semi_saturation) in TRANSDUCERS
    assert APERTURE_SIGMA_DEG in APERTURES_DEG
    # And not at the end of what was tried, where the best could lie beyond.
    assert has.neighbour_fraction not in {TRANSDUCERS[0][0], TRANSDUCERS[-1][0]}
    assert has.semi_saturation not in {TRANSDUCERS[0][1], TRANSDUCERS[-1][1]}
