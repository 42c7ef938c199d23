"""Synthetic examples of flicker."""

import numpy as np
import pytest

from studies.observers.flicker import EXAMPLES, SHARE, Pair, sequences


@pytest.mark.parametrize("example", EXAMPLES)
def test_the_blur_has_the_larger_error_in_each_frame(example):
    for reference, flickering, steady in sequences(example):
        flicker, blur = (np.mean((i.astype(float) - reference) ** 2) for i in (flickering, steady))
        assert flicker == pytest.approx(SHARE * blur, rel=0.02)


@pytest.mark.parametrize("example", EXAMPLES)
def test_the_error_changes_from_frame_to_frame(example):
    frames = sequences(example)
    _, pan_px = EXAMPLES[example]
    first, second = (
        np.roll(flickering - reference, -frame * pan_px, axis=1)
        for frame, (reference, flickering, _) in enumerate(frames[:2])
    )
    assert np.corrcoef(first.ravel(), second.ravel())[0, 1] < 0.1


def test_ratio():
    assert Pair(flicker_jnd=3.0, blur_jnd=2.0).ratio == 1.5
