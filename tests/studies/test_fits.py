"""Cross-validation of fits: small tables by hand, and the metric's constants."""

import numpy as np
import pytest

from enfilade.metric import Transducer
from enfilade.metric.aperture import APERTURE_SIGMA_DEG
from studies.observers.fits import APERTURES_DEG, TRANSDUCERS, fit

CANDIDATES = ((1.0,), (2.0,))


def test_each_measurement_is_evaluated_with_the_fit_of_the_others():
    # All but the last are fitted best by 1; the last alone makes 2 the best fit of all.
    errors = np.array([[0.5, -0.5, 0.5, 9.0], [1.0, -1.0, 1.0, 0.0]])
    found = fit("constant", "data", CANDIDATES, (2.0,), errors)
    assert found.rms_db == pytest.approx(np.sqrt(3 / 4))
    assert found.cross_validation_rms_db == pytest.approx(np.sqrt((1 + 1 + 1 + 81) / 4))
    assert (found.least, found.most) == ((1.0,), (2.0,))


def test_the_gain_is_that_of_the_others():
    errors = np.array([[1.0, 3.0, 8.0], [10.0, 20.0, 60.0]])
    found = fit("constant", "data", CANDIDATES, (1.0,), errors, has_gain=True)
    assert found.rms_db == pytest.approx(np.std([1.0, 3.0, 8.0]))
    assert found.cross_validation_rms_db == pytest.approx(np.sqrt((4.5**2 + 1.5**2 + 6**2) / 3))
    assert found.least == found.most == (1.0,)


def test_the_metrics_constants_are_among_the_candidates():
    transducer = Transducer()
    assert (transducer.neighbour_fraction, transducer.semi_saturation) in TRANSDUCERS
    assert APERTURE_SIGMA_DEG in APERTURES_DEG
    # Not at the ends of the range, beyond which the best could lie.
    assert transducer.neighbour_fraction not in {TRANSDUCERS[0][0], TRANSDUCERS[-1][0]}
    assert transducer.semi_saturation not in {TRANSDUCERS[0][1], TRANSDUCERS[-1][1]}
