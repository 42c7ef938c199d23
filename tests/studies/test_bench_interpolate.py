"""FFmpeg's minterpolate between keyframes."""

from fractions import Fraction

import numpy as np
import pytest

from studies.bench.interpolate import interpolate, why_no_interpolation

pytestmark = pytest.mark.skipif(bool(why_no_interpolation()), reason="this FFmpeg lacks minterpolate")
HEIGHT, WIDTH = 48, 64


def _bar(column: float) -> np.ndarray:
    image = np.full((HEIGHT, WIDTH, 3), 0.05, np.float32)
    image[12:36, round(column) : round(column) + 10] = 0.8
    return image


def _place(image: np.ndarray) -> float:
    light = image[24].mean(axis=-1) - 0.05
    return float((light * np.arange(WIDTH)).sum() / light.sum())


def test_a_bar_moves_evenly_between_unevenly_spaced_keyframes():
    keyframes = {n: _bar(8 + 2 * n) for n in (3, 8, 12, 17)}
    made = dict(interpolate(keyframes, Fraction(24)))
    assert sorted(made) == list(range(3, 18))
    places = [_place(made[n]) for n in sorted(made)]
    # blocks of 8 pixels at the least are what it moves
    assert np.abs(np.diff(places) - 2.0).max() < 4.0
    assert places[-1] - places[0] == pytest.approx(28.0, abs=0.2)


def test_keyframes_come_back_rounded_to_8_bits():
    keyframes = {0: _bar(10), 4: _bar(20), 9: _bar(30)}
    made = dict(interpolate(keyframes, Fraction(30)))
    for number, image in keyframes.items():
        assert np.abs(made[number] - image).max() < 0.02


def test_a_still_picture_stays():
    made = dict(interpolate({5: _bar(10), 9: _bar(10)}, Fraction(30000, 1001)))
    assert sorted(made) == [5, 6, 7, 8, 9]
    for image in made.values():
        assert np.abs(image - _bar(10)).max() < 0.02
