"""Scores in words, and PSNR."""

import math
from dataclasses import replace

import pytest

from enfilade.comparison import psnr_db
from enfilade.comparison.result import words_of
from support.sequences import compared, textured


def test_meaning_grows_with_the_score():
    words = [words_of(score) for score in (0.0, 1e-9, 0.25, 0.5, 1.0, 2.0, 3.0, 3.1, 100.0)]
    assert words[0] == "identical"
    assert words[1] == words[2] == "next to none overall"
    assert words[5] == words[6]
    assert words[7] == words[8] == "strong overall"
    assert len(dict.fromkeys(words)) == 6


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


def test_what_is_nowhere_visible_names_no_frame(sequence):
    faint = textured(level=0.2004)
    found = compared(sequence("faint", [faint]), sequence("good", [textured()]))
    assert found.score > 0.0
    assert found.frames[0].percent_visible == 0.0
    assert found.meaning == words_of(found.score)


def test_psnr():
    assert psnr_db(0.01) == pytest.approx(20.0)
    assert psnr_db(0.0) == math.inf
