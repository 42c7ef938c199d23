"""Departures from the paper, by name."""

import pytest

from enfilade.errors import InputError
from enfilade.metric import Aqm, MetricOptions
from enfilade.viewing import Viewing


def test_modern_departs_everywhere_and_the_paper_nowhere():
    paper, modern = MetricOptions.paper(), MetricOptions.modern()
    for departure in MetricOptions.departures():
        assert getattr(paper, departure) != getattr(modern, departure)
    for departure in MetricOptions.departures():
        modern = modern.without(departure)
    assert modern == paper


def test_the_paper_is_what_one_gets_unasked():
    assert Aqm(Viewing(16, 12)).options == MetricOptions.paper() == MetricOptions()


def test_wrong_names_list_the_known_ones():
    with pytest.raises(InputError, match=r"'colour'.*csf, luminance_adaptive"):
        MetricOptions.modern().without("colour")
    with pytest.raises(InputError, match="give 'paper' or 'castle'"):
        MetricOptions(csf="barten")
