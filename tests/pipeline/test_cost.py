"""Costs by stage."""

import time

import pytest

from enfilade.pipeline.cost import Costs


def test_a_stage_inside_another_is_counted_once():
    costs = Costs()
    with costs.of("outer"):
        time.sleep(0.02)
        with costs.of("inner"):
            time.sleep(0.05)
        with costs.of("inner"):
            time.sleep(0.05)
    with costs.of("outer"):
        pass
    taken = costs.take()
    assert taken["inner"]["wall_s"] >= 0.1
    assert 0.02 <= taken["outer"]["wall_s"] < 0.09
    assert costs.take() == {}


def test_what_fails_is_counted_too():
    costs = Costs()
    with pytest.raises(RuntimeError), costs.of("outer"), costs.of("inner"):
        raise RuntimeError
    assert set(costs.take()) == {"outer", "inner"}
