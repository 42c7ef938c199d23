"""Places on colour scales, and their colours."""

import numpy as np
import pytest

from enfilade.reports.scales import DIFFERENCE, VELOCITY, VISIBLE


@pytest.mark.parametrize("scale", [VELOCITY, DIFFERENCE, VISIBLE])
def test_a_scale_rises_from_0_to_1_and_stays(scale):
    place = scale.place(np.array([*scale.colors, 10.0 * scale.top], np.float32))
    assert place[0] == 0.0
    assert place[-2:] == pytest.approx([1.0, 1.0])
    assert (np.diff(place[:-1]) > 0.1).all()  # ticks that can be told apart
    np.testing.assert_allclose(scale.place(scale.values(9)), np.linspace(0.0, 1.0, 9), atol=1e-6)


def test_strong_differences_have_other_colours_than_moderate_ones():
    painted = VISIBLE.paint(np.float32([[4.0, 16.0, 32.0, 64.0]]))[0].astype(int)
    steps = np.abs(np.diff(painted, axis=0)).sum(axis=1)
    assert (steps > 60).all()  # of 765: told apart at a glance


@pytest.mark.parametrize("scale", [VELOCITY, DIFFERENCE])
def test_colours_are_those_at_the_ticks_and_grow_lighter(scale):
    painted = scale.paint(np.array([*scale.colors], np.float32)[None])[0].astype(int)
    expected = [list(bytes.fromhex(color)) for color in scale.colors.values()]
    np.testing.assert_allclose(painted, expected, atol=2)
    lightness = scale.paint(scale.values(200)[None])[0].astype(float) @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(lightness) > -1.0).all()
