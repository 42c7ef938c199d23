"""Differences of noisy images without their noise."""

import numpy as np
import pytest

from studies.blender.measures import compare

RNG = np.random.default_rng(1)
Y, X = np.mgrid[0:48, 0:64] / 48.0
PICTURE = np.repeat((0.3 + 0.2 * np.sin(9.0 * X) * np.sin(7.0 * Y))[..., None], 3, -1).astype(np.float32)


def noisy(picture):
    return tuple((picture + RNG.normal(0.0, 0.02, picture.shape)).astype(np.float32) for _ in range(2))


def test_noise_is_no_difference():
    result = compare(noisy(PICTURE), noisy(PICTURE))
    assert result.mean_percent < 0.5  # 0.02 / 0.3 over 6000 values: 0.1 %
    assert result.structure < 0.005


def test_brightness_and_structure_are_told_apart():
    brighter = compare((PICTURE, PICTURE), (1.05 * PICTURE, 1.05 * PICTURE))
    assert brighter.mean_percent == pytest.approx(5.0, rel=0.01)
    assert brighter.structure < 0.02
    flipped = compare(noisy(PICTURE), noisy(PICTURE[::-1]))
    assert flipped.structure > 0.1
