"""castleCSF against measured sensitivities, and its shape."""

import numpy as np
import pytest

from enfilade.metric.castle import castle_sensitivity, sustained_sensitivity, transient_sensitivity

# Both as in castleCSF's aggregated data (MIT licence).
# Laird et al. 2006: gratings that move over a resting eye, 60 cd/m2, 4.753 deg2: (cpd, Hz, 1 / contrast).
LAIRD = (
    (4, 10, 104.713),
    (4, 20, 32.359),
    (4, 30, 10.965),
    (8, 10, 42.658),
    (8, 20, 10.965),
    (8, 30, 6.607),
)
# Watson and Ahumada 2005, ModelFest: (cpd, dB) of Gabors of sigma 0.5 deg at 30 cd/m2.
GABORS = ((1.12, 36.419), (2.0, 39.206), (2.83, 41.263), (4.0, 42.13), (5.66, 39.838), (8.0, 36.872))


def test_modelfest_gabors_within_3_db():
    error = [
        20 * np.log10(castle_sensitivity(cpd, 0.0, 30.0, np.pi * 0.25)) - measured for cpd, measured in GABORS
    ]
    assert np.sqrt(np.mean(np.square(error))) < 3.0


def test_laird_within_3_db():
    error = [
        20 * np.log10(castle_sensitivity(cpd, hertz, 60.0, 4.7529) / measured)
        for cpd, hertz, measured in LAIRD
    ]
    assert np.sqrt(np.mean(np.square(error))) < 2.0


def test_the_two_channels_add_up():
    arguments = 3.0, np.array([0.0, 2.0, 8.0, 20.0]), 50.0, 1.0
    both = sustained_sensitivity(*arguments) + transient_sensitivity(*arguments)
    np.testing.assert_array_equal(castle_sensitivity(*arguments), both)


def test_what_stays_and_what_changes():
    assert sustained_sensitivity(4.0, 0.0, 50.0, 1.0) > 100 * transient_sensitivity(4.0, 0.0, 50.0, 1.0)
    # Coarse patterns are seen best when they flicker, at 9.5 Hz and 100 cd/m2.
    hertz = np.arange(1.0, 40.0, 0.5)
    flicker = transient_sensitivity(0.5, hertz, 100.0, 4.0)
    assert hertz[flicker.argmax()] == 9.5
    assert flicker.max() > sustained_sensitivity(0.5, 0.0, 100.0, 4.0)


@pytest.mark.parametrize("axis", ["luminance", "area"])
def test_sensitivity_grows_with_light_and_size(axis):
    steps = np.geomspace(0.01, 100.0, 40)
    light, area = (steps, 1.0) if axis == "luminance" else (30.0, steps)
    assert (np.diff(castle_sensitivity(4.0, 1.0, light, area)) > 0).all()


def test_small_patches_need_contrast_with_the_root_of_their_area():
    few, more = castle_sensitivity(4.0, 0.0, 30.0, np.array([1e-4, 4e-4]))
    assert more / few == pytest.approx(2.0, rel=1e-3)


def test_darkness_is_defined():
    assert np.isfinite(castle_sensitivity(4.0, np.array([0.0, 10.0]), 0.0, 1.0)).all()


def test_motion_hides_less_detail_than_eq_4_says():
    # At 5 deg/s and 8 cpd Eq. 4 has 0.015.
    assert 1.5 < castle_sensitivity(8.0, 40.0, 100.0, np.pi * 0.25) < 6.0
