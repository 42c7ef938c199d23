"""The change of an error that moves by fractions of a pixel."""

import numpy as np
import pytest

from enfilade.metric import SequenceAqm
from enfilade.viewing import Viewing

SHAPE = (128, 160)
VIEWING = Viewing(640, 480).cropped(SHAPE[1], SHAPE[0])


def transient_jnd(judge, period_px, step_px):
    """Transient part of a grating of 4 cd/m2 on 40 that sticks to a surface which moves to the right."""
    reference = np.full(SHAPE, 40.0, np.float32)
    flow = np.zeros((*SHAPE, 2), np.float32)
    flow[..., 0] = -step_px
    for frame in range(3):
        x = np.arange(SHAPE[1]) - frame * step_px
        test = reference + 4.0 * np.sin(2.0 * np.pi * x / period_px)
        found = judge.judge(test.astype(np.float32), reference, backward_flow_px=flow, is_cut=frame == 0)
    return found.transient.score


@pytest.fixture(scope="module")
def judge():
    return SequenceAqm(VIEWING)


@pytest.mark.parametrize(("period_px", "most_jnd"), [(4, 0.35), (6, 0.13), (12, 0.02)])
def test_between_pixels_a_fine_steady_error_changes_a_little(judge, period_px, most_jnd):
    # what bilinear samples lose of a sine half way between pixels: 29 % at 4 pixels a period, 3 % at 12
    assert 0.0 < transient_jnd(judge, period_px, 1.5) < most_jnd


def test_at_whole_pixels_it_does_not(judge):
    assert transient_jnd(judge, 4, 2.0) < 1e-3
