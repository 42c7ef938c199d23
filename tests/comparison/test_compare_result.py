"""Scores in words, and PSNR."""

import math
from dataclasses import replace

import numpy as np
import pytest

from enfilade.comparison import psnr_db
from enfilade.comparison.result import words_of
from support.sequences import compared, textured


def test_meaning_grows_with_the_score():
    steps = (0.0, 0.1, 0.5, 1.0, 2.0, 3.1, 8.1, 16.1, 32.1)
    words = [words_of(score) for score in steps]
    assert len(dict.fromkeys(words)) == len(steps)
    assert words_of(0.0049) == words[0]  # printed as 0.00
    assert words_of(3.0) == words[4] == "obvious overall"
    assert words_of(1000.0) == words[-1] == "extreme overall"


def test_only_equal_pixels_are_identical(sequence):
    good = textured()
    same, brighter, hue = good.copy(), good.copy(), good.copy()
    good[:8, :8], same[:8, :8], brighter[:8, :8] = 2.0, 2.0, 3.0  # white on the display, and beyond
    hue[..., 2] += np.float32(1e-4)
    reference = sequence("good", [good])
    found = {
        name: compared(sequence(name, [image]), reference).to_dict()
        for name, image in (("same", same), ("brighter", brighter), ("hue", hue))
    }
    assert (found["same"]["meaning"], found["same"]["is_identical"]) == ("identical", True)
    assert found["brighter"]["score_jnd"] == 0.0
    assert found["brighter"]["psnr_db"] is None
    for name in ("brighter", "hue"):
        assert "identical" not in found[name]["meaning"].removeprefix("not identical")
        assert not found[name]["is_identical"]


def test_a_plain_spot_in_one_of_many_frames_is_named(sequence):
    good = [textured()] * 2
    bad = [image.copy() for image in good]
    bad[1][20:28, 30:38] *= 0.3
    found = compared(sequence("bad", bad), sequence("good", good), flow="none")
    same, spot = found.frames
    assert found.to_dict()["largest_jnd"] == spot.largest_jnd > 5.0
    assert found.meaning.endswith(f"; up to {spot.largest_jnd:.1f} JND in 0002.exr")
    small = replace(spot, name="frame 999 of films/long.mp4", score=1.64, largest_jnd=11.6)
    long = replace(found, frames=(*[same] * 999, small))
    assert long.score == pytest.approx(0.23, abs=0.005)
    assert long.meaning == "next to none overall; up to 11.6 JND in frame 999"


def test_a_spot_that_is_visible_is_never_without_a_visible_difference(sequence):
    good = [textured()]
    bad = [good[0].copy()]
    bad[0][20:22, 30:32] *= 0.7
    found = compared(sequence("bad", bad), sequence("good", good), flow="none")
    (spot,) = found.frames
    assert spot.percent_visible > 0.0
    same = replace(spot, percent_visible=0.0, score=0.0, largest_jnd=0.0)
    long = replace(found, frames=(*[same] * 999, replace(spot, score=0.01)))
    assert long.score < 0.005
    assert long.meaning == f"next to none overall; up to {spot.largest_jnd:.1f} JND in 0001.exr"


def test_what_is_nowhere_visible_names_no_frame(sequence):
    faint = textured(level=0.2004)
    found = compared(sequence("faint", [faint]), sequence("good", [textured()]))
    assert found.score > 0.0
    assert found.frames[0].percent_visible == 0.0
    assert found.meaning == words_of(found.score)


def test_psnr():
    assert psnr_db(0.01) == pytest.approx(20.0)
    assert psnr_db(0.0) == math.inf
