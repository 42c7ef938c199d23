"""castleCSF against measured sensitivities, and its shape."""

import numpy as np
import pytest

from enfilade.metric.castlecsf import castlecsf_sensitivity, transient_sensitivity

# Both as in castleCSF's aggregated data (MIT licence): (cpd, Hz, 1 / contrast, cd/m2, deg2).
# Laird et al. 2006: gratings that move over a resting eye.
LAIRD = [
    (cpd, hertz, sensitivity, 60.0, 4.7529)
    for cpd, hertz, sensitivity in (
        (4, 10, 104.713),
        (4, 20, 32.359),
        (4, 30, 10.965),
        (8, 10, 42.658),
        (8, 20, 10.965),
        (8, 30, 6.607),
    )
]
# Watson and Ahumada 2005, ModelFest: Gabors of sigma 0.5 deg.
GABORS = [
    (cpd, 0.0, 10 ** (decibel / 20), 30.0, np.pi * 0.25)
    for cpd, decibel in (
        (1.12, 36.419),
        (2.0, 39.206),
        (2.83, 41.263),
        (4.0, 42.13),
        (5.66, 39.838),
        (8.0, 36.872),
    )
]


@pytest.mark.parametrize(("measured", "rms_db"), [(LAIRD, 2.0), (GABORS, 3.0)])
def test_measured_sensitivities(measured, rms_db):
    cpd, hertz, sensitivity, luminance, area = np.array(measured).T
    error = 20 * np.log10(castlecsf_sensitivity(cpd, hertz, luminance, area) / sensitivity)
    assert np.sqrt(np.mean(np.square(error))) < rms_db


def test_sustained_and_transient_channels():
    steady, flicker = ((4.0, 0.0, 50.0, 1.0), (0.5, np.arange(1.0, 40.0, 0.5), 100.0, 4.0))
    assert castlecsf_sensitivity(*steady) > 100 * transient_sensitivity(*steady)
    # Coarse patterns are seen best when they flicker, at 9.5 Hz and 100 cd/m2.
    transient = transient_sensitivity(*flicker)
    assert flicker[1][transient.argmax()] == 9.5
    assert transient.max() > castlecsf_sensitivity(0.5, 0.0, 100.0, 4.0)
    assert (castlecsf_sensitivity(*flicker) > transient).all()


def test_sensitivity_grows_with_light_and_size():
    steps = np.geomspace(0.01, 100.0, 40)
    assert (np.diff(castlecsf_sensitivity(4.0, 1.0, steps, 1.0)) > 0).all()
    assert (np.diff(castlecsf_sensitivity(4.0, 1.0, 30.0, steps)) > 0).all()
    # Thresholds of small patches fall with the root of their area.
    few, more = castlecsf_sensitivity(4.0, 0.0, 30.0, np.array([1e-4, 4e-4]))
    assert more / few == pytest.approx(2.0, rel=1e-3)
    assert np.isfinite(castlecsf_sensitivity(4.0, np.array([0.0, 10.0]), 0.0, 1.0)).all()


def test_motion_hides_less_detail_than_eq_4_says():
    # At 5 deg/s and 8 cpd Eq. 4 has 0.015.
    assert 1.5 < castlecsf_sensitivity(8.0, 40.0, 100.0, np.pi * 0.25) < 6.0
