"""Errors of the bench against Cycles have no part of the references' noise."""

import numpy as np
import pytest

from studies.bench.cycles import errors_of


def test_errors_are_those_of_the_image_alone():
    rng = np.random.default_rng(0)
    truth = np.full((200, 200, 3), 0.3, np.float32)

    def noisy(deviation):
        return (truth + rng.normal(0.0, deviation, truth.shape)).astype(np.float32)

    displayed, relative = errors_of(noisy(0.02), noisy(0.03), noisy(0.03))
    assert relative == pytest.approx(0.02**2 / (0.3**2 + 0.01), rel=0.1)
    slope = 1.055 / 2.4 * 0.3 ** (1.0 / 2.4 - 1.0)  # of the sRGB curve there
    assert displayed == pytest.approx((0.02 * slope) ** 2, rel=0.15)
    assert errors_of(truth, noisy(0.03), noisy(0.03))[1] == pytest.approx(0.0, abs=0.01 * 0.03**2 / 0.1)
