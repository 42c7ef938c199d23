"""Scores in words, and PSNR."""

import math

import pytest

from enfilade.pipeline.compare import meaning, psnr_db


def test_meaning_grows_with_the_score():
    words = [meaning(score) for score in (0.0, 1e-9, 0.25, 0.5, 1.0, 2.0, 3.0, 3.1, 100.0)]
    assert words[0] == "identical"
    assert words[1] == words[2] == "nobody notices it"
    assert "half of the cases" in words[3]
    assert "three of four" in words[4]
    assert words[5] == words[6]
    assert words[7] == words[8] == "obvious at first sight"
    assert len(dict.fromkeys(words)) == 6


def test_psnr():
    assert psnr_db(0.01) == pytest.approx(20.0)
    assert psnr_db(0.0) == math.inf
