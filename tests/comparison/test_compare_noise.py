"""Two references measure their noise: floor, significance, and PSNR without it."""

import numpy as np
import pytest

from enfilade.comparison.noise import NoiseFloor
from enfilade.errors import ImageError
from enfilade.kernels.tone import srgb_encode
from support.sequences import SIZE, compared, textured

FRAMES = 3
SIGMA = 0.02  # of linear values around 0.2: 2.8 % of white, encoded


def noisy(seed, sigma=SIGMA):
    random = np.random.default_rng(seed)
    clean = textured()
    return [(clean + random.normal(0.0, sigma, clean.shape)).astype(np.float32) for _ in range(FRAMES)]


@pytest.fixture
def references(sequence):
    return sequence("a", noisy(1)), sequence("b", noisy(2))


def against(test, references):
    return compared(test, references[0], second_reference=references[1], flow="none")


def test_psnr_is_without_the_noise_of_the_references(sequence, references):
    wrong = textured() * np.float32(1.1)
    found = against(sequence("wrong", [wrong] * FRAMES), references)
    error = srgb_encode(wrong) - srgb_encode(textured())
    truth_db = -10.0 * np.log10(np.mean(error**2))
    # The noise of the product is 0.028^2/sqrt(27648 values) = 5e-6 beside an error of 4e-4: 0.1 dB.
    assert found.psnr_db == pytest.approx(truth_db, abs=0.3)
    one = compared(sequence("again", [wrong] * FRAMES), references[0], flow="none")
    assert one.psnr_db < truth_db - 3.0


def test_a_test_without_error_is_within_the_noise(sequence, references):
    found = against(sequence("clean", [textured()] * FRAMES), references)
    floor = found.to_dict()["noise_floor"]
    # The noise of the mean of both is half their difference from each other; the transducer bends it.
    assert found.score / floor["score_jnd"] == pytest.approx(0.575, rel=0.1)
    assert floor["significance"] == "below"
    assert "a test without any error scores a third to two thirds of it" in found.noise_note
    assert len(floor["per_frame_jnd"]) == FRAMES
    assert floor["score_jnd"] == compared(references[0], references[1], flow="none").score


@pytest.mark.parametrize("sigma", [0.0005, 0.002, 0.05])
def test_faint_and_strong_noise_leave_a_third_to_two_thirds(sequence, sigma):
    references = sequence("a", noisy(1, sigma)), sequence("b", noisy(2, sigma))
    found = against(sequence("clean", [textured()] * FRAMES), references)
    assert 1.0 / 3.0 < found.score / found.noise_floor.score < 2.0 / 3.0
    assert "a third to two thirds" in found.noise_note


def test_a_test_as_noisy_as_the_references_is_undecided(sequence, references):
    found = against(sequence("third", noisy(3)), references)
    assert found.noise_floor.significance(found.score) == "undecided"
    assert ", undecided" in found.meaning
    assert f"{found.noise_floor.score:.2f} JND" in found.noise_note


def test_a_strong_error_stands_out(sequence, references):
    found = against(sequence("bad", noisy(3, sigma=5.0 * SIGMA)), references)
    assert found.to_dict()["noise_floor"]["significance"] == "above"
    assert "undecided" not in found.meaning


def test_verdicts_are_a_third_of_the_floor_apart():
    floor = NoiseFloor((30.0, 30.0), percent_visible=90.0, squared_error=0.01)
    assert [floor.significance(s) for s in (19.9, 20.1, 30.0, 39.9, 40.1)] == [
        "below", "undecided", "undecided", "undecided", "above",
    ]  # fmt: skip


def test_the_first_reference_is_not_identical_to_the_mean(references):
    found = against(references[0], references)
    assert not found.is_identical
    assert found.score > 0.0


def test_references_that_are_not_independent_are_refused(sequence, references):
    with pytest.raises(ImageError, match=r"two references are equal in frame 1 .*another --seed"):
        against(references[1], (references[0], references[0]))
    black = sequence("black", [np.zeros((*SIZE, 3), np.float32)])
    found = against(black, (black, black))  # nothing to be noisy
    assert found.meaning == "identical"


def test_a_second_reference_must_match(sequence, references):
    short = sequence("short", noisy(4)[:2])
    with pytest.raises(ImageError, match=r"test has 3 frames .* second reference 2"):
        against(references[0], (references[1], short))
