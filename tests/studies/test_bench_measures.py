"""Measures of the bench: nothing for identical sequences, more for noise, nothing for the reference's."""

import math
from dataclasses import replace

import numpy as np
import pytest

from enfilade.errors import EnfiladeError
from enfilade.metric import Pursuit
from studies.bench import colorvideovdp
from studies.bench.measures import (
    LEAST_ERROR,
    QUALITIES,
    Flicker,
    RelativeSquaredError,
    SquaredError,
    open_measure,
)
from support.displayed_frames import VIEWING, noise, pair, picture

FRAMES = 4
SHIFT = 1.5  # pixels a frame
NAMES = [name for name in QUALITIES if name != "cvvdp"]


def sequence(size):
    """A moving picture with independent noise in each frame."""
    pairs = []
    for frame in range(FRAMES):
        reference = picture(SHIFT * frame)
        test = reference + noise(frame, size) if size else reference
        pairs.append(pair(test, reference, shift=SHIFT, is_first=frame == 0))
    return pairs


def shown(pairs):
    return [(one.test.astype(np.float16), one.reference.astype(np.float16)) for one in pairs]


def value(measure, pairs):
    for one in pairs:
        measure.add(one)
    return measure.value()


@pytest.mark.parametrize("name", NAMES)
def test_identical_sequences_have_no_error_and_more_noise_has_more(name):
    if name == "flip":
        pytest.importorskip("flip_evaluator")

    def error(size):
        return QUALITIES[name].error([value(open_measure(name, VIEWING, Pursuit.BOTH), sequence(size))])

    assert error(0.0) == LEAST_ERROR
    errors = [error(size) for size in (0.01, 0.03, 0.1)]
    assert LEAST_ERROR < errors[0] < errors[1] < errors[2]


@pytest.mark.skipif(bool(colorvideovdp.why_missing()), reason="ColorVideoVDP is set up by make judge")
def test_colorvideovdp_judges_several_sequences_in_its_own_environment():
    jods = colorvideovdp.predict_jod([shown(sequence(size)) for size in (0.0, 0.01, 0.1)], VIEWING)
    assert jods[0] == pytest.approx(10.0, abs=1e-3)
    assert 10.0 > jods[1] > jods[2]


def test_a_missing_colorvideovdp_is_named_and_a_failing_one_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(colorvideovdp, "ENVIRONMENT", tmp_path)
    assert "make judge" in colorvideovdp.why_missing()
    (tmp_path / "bin").mkdir()
    python = tmp_path / "bin" / "python"
    python.write_text("#!/bin/sh\necho 'no torch' >&2\nexit 3\n")
    python.chmod(0o755)
    with pytest.raises(EnfiladeError, match=r"ColorVideoVDP failed: no torch; .*make judge"):
        colorvideovdp.predict_jod([shown(sequence(0.0))], VIEWING)


def test_squared_errors_of_a_known_error():
    constant = [pair(picture() + 0.1, picture(), is_first=frame == 0) for frame in range(2)]
    assert QUALITIES["psnr"].score([value(SquaredError(), constant)]) == pytest.approx(20.0, abs=1e-3)
    grey = [
        replace(constant[0], linear=np.float32(1.1) * half, linear_reference=half, linear_halves=(half, half))
        for half in constant[0].halves
    ]
    expected = np.mean((0.1 * grey[0].linear_halves[0]) ** 2 / (grey[0].linear_halves[0] ** 2 + 0.01))
    assert value(RelativeSquaredError(), grey) == pytest.approx(float(expected), rel=1e-3)


def test_steady_errors_do_not_flicker_patches_do_and_fine_noise_averages_out():
    stain = np.zeros_like(picture())
    stain[8:24, 16:40] = 0.1  # whole blocks
    steady = [pair(picture() + stain, picture(), is_first=f == 0) for f in range(4)]
    assert value(Flicker(), steady) == pytest.approx(0.0, abs=1e-12)
    blinking = [pair(picture() + stain * (f % 2), picture(), is_first=f == 0) for f in range(4)]
    share = 2 * 3 / (6 * 8)
    assert value(Flicker(), blinking) == pytest.approx(share * 0.01, rel=1e-4)
    noisy = [pair(picture() + noise(f, 0.05), picture(), is_first=f == 0) for f in range(8)]
    assert math.sqrt(value(Flicker(), noisy)) == pytest.approx(0.05 * math.sqrt(2.0) / 8.0, rel=0.06)


def test_a_cut_is_no_flicker():
    cuts = [pair(picture() + noise(1, 0.1), picture(), is_first=True) for _ in range(2)]
    assert value(Flicker(), [replace(cuts[0], test=cuts[0].test * 0.5), cuts[1]]) == 0.0


@pytest.mark.parametrize("kind", [SquaredError, RelativeSquaredError, Flicker])
def test_noise_of_the_reference_does_not_count(kind):
    """A test with noise of 0.05 has the same value against clean and against noisy halves."""
    clean, noisy = [], []
    for frame in range(12):
        seen = pair(picture() + noise(frame, 0.05), picture(), is_first=frame == 0)
        added = [noise(100 * k + frame, 0.05) for k in (1, 2)]
        clean.append(seen)
        noisy.append(
            replace(
                seen,
                halves=tuple(half + more for half, more in zip(seen.halves, added, strict=True)),
                linear_halves=tuple(
                    half + more for half, more in zip(seen.linear_halves, added, strict=True)
                ),
            )
        )
    # 110,592 products of deviation 0.05^2 (blocks: 1,584)
    assert value(kind(), noisy) == pytest.approx(value(kind(), clean), rel=0.15)


def test_the_relative_error_of_the_truth_is_none():
    added = [[noise(100 * k + f, 0.1) * picture() for k in (1, 2)] for f in range(12)]
    exact = [pair(picture(), picture()) for _ in added]
    seen = [
        replace(of, linear_halves=tuple(of.linear + n for n in two))
        for of, two in zip(exact, added, strict=True)
    ]
    assert abs(value(RelativeSquaredError(), seen)) < 5e-4
