"""Measures of sequences: nothing for identical ones, more for more noise, and what each is blind to."""

import math
import sys

import numpy as np
import pytest

from enfilade.comparison.measures import (
    Flip,
    Psnr,
    display_pair,
    open_measure,
)
from enfilade.errors import InputError, SettingsError
from support.displayed_frames import HEIGHT, VIEWING, WIDTH, noise, pair, picture


def test_psnr_of_a_known_error():
    reference = np.full((HEIGHT, WIDTH, 3), 0.5, np.float32)
    measure = Psnr()
    values = [measure.measure(pair(reference + np.float32(off), reference)) for off in (0.1, 0.05)]
    assert values == pytest.approx([20.0, 26.02], abs=0.01)
    # of the mean of both squared errors
    assert measure.pool(values) == pytest.approx(-10.0 * math.log10((0.01 + 0.0025) / 2.0), abs=0.01)
    assert math.isinf(measure.measure(pair(reference, reference)))


def test_flip_is_that_of_its_own_package_at_our_pixels_per_degree():
    evaluate = pytest.importorskip("flip_evaluator").evaluate
    a, b = picture(), picture() + noise(3, 0.1)
    seen = pair(b, a)
    want = evaluate(seen.reference, seen.test, "LDR", True, False, True, {"ppd": VIEWING.pixels_per_degree})[
        1
    ]
    assert Flip(VIEWING).measure(seen) == pytest.approx(want)


def test_without_its_package_flip_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    with pytest.raises(SettingsError, match=r"pip install flip-evaluator"):
        Flip(VIEWING)


def test_without_its_package_colorvideovdp_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "pycvvdp", None)
    with pytest.raises(SettingsError, match="pip install cvvdp"):
        open_measure("cvvdp", VIEWING)


def test_an_unknown_measure_is_refused_with_the_known_ones():
    with pytest.raises(SettingsError, match="choose one of flip, psnr, cvvdp"):
        open_measure("taste", VIEWING)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_no_colour_is_refused(bad):
    image = picture()
    image[3, 4, 1] = bad
    with pytest.raises(InputError, match="the test holds pixels"):
        display_pair(image, picture(), VIEWING)
    with pytest.raises(InputError, match="shape"):
        display_pair(picture()[:-1], picture(), VIEWING)


def test_frames_are_exposed_and_clipped():
    bright = np.full((HEIGHT, WIDTH, 3), 0.75, np.float32)
    seen = display_pair(bright, -bright, VIEWING, exposure_ev=1.0)
    assert seen.test.max() == pytest.approx(1.0)
    assert seen.reference.max() == 0.0
    assert seen.test_cd_m2[0, 0] == pytest.approx(VIEWING.peak_cd_m2)
    assert seen.reference_cd_m2[0, 0] == pytest.approx(VIEWING.black_cd_m2)
