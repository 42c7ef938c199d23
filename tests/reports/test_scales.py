"""Places on a scale, and its colours."""

import numpy as np
import pytest

from enfilade.reports.scales import DIFFERENCE, VELOCITY


@pytest.mark.parametrize("scale", [VELOCITY, DIFFERENCE])
def test_a_scale_rises_from_0_to_1_and_stays(scale):
    place = scale.place(np.array([*scale.ticks, 10.0 * scale.top], np.float32))
    assert place[0] == 0.0
    assert place[-2:] == pytest.approx([1.0, 1.0])
    assert (np.diff(place[:-1]) > 0.03).all()  # ticks that can be told apart


@pytest.mark.parametrize("scale", [VELOCITY, DIFFERENCE])
def test_ends_have_the_colours_of_the_legend_and_grow_lighter(scale):
    values = np.linspace(0.0, scale.top, 200, dtype=np.float32)[None]
    painted = scale.paint(values)
    assert painted.shape == (1, 200, 3)
    assert [bytes(painted[0, i].tolist()).hex() for i in (0, -1)] == [scale.colors[0], scale.colors[-1]]
    lightness = painted[0].astype(float) @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(lightness) > -1.0).all()
