"""CPU time at equal quality, by arithmetic that can be done by hand."""

import math

import pytest

from studies.bench.measures import LEAST_ERROR, QUALITIES
from studies.bench.ratios import Point, cost_at, front, mean_ratio, ratios

# Monte Carlo: four times the paths, half the error.
BASELINES = [Point(10.0, 0.4), Point(40.0, 0.2), Point(160.0, 0.1)]


def test_a_point_that_a_cheaper_one_beats_is_off_the_front():
    points = [Point(2.0, 0.5), Point(1.0, 0.6), Point(3.0, 0.7), Point(4.0, 0.1)]
    assert front(points) == [Point(1.0, 0.6), Point(2.0, 0.5), Point(4.0, 0.1)]


def test_between_points_both_axes_are_logarithmic():
    cost, kind = cost_at(BASELINES, 0.1 * math.sqrt(2.0))
    assert cost == pytest.approx(80.0)
    assert kind == "equal"
    assert cost_at(BASELINES, 0.5) == (10.0, "at most")
    assert cost_at(BASELINES, 0.05) == (160.0, "at least")


def row(name, family, cpu_s, flip, undecided=(), seeds=()):
    """A configuration; `seeds` are pairs of CPU seconds and values."""
    return {
        "name": name,
        "family": family,
        "cost": {"cpu_s": cpu_s},
        "values": {"flip": flip},
        "seeds": [{"cpu_s": cpu, "values": {"flip": of}} for cpu, of in seeds or [(cpu_s, flip)]],
        "undecided": undecided,
    }


def baselines():
    return [
        row("denoised-2", "denoised", 10.0, [0.4, 0.4]),
        row("denoised-8", "denoised", 40.0, [0.2, 0.2]),
        row("traced-64", "traced", 400.0, [0.3, 0.3]),
    ]


@pytest.mark.parametrize(
    ("cpu_s", "flip", "times", "kind"),
    [
        (5.0, 0.2, 8.0, "equal"),
        (5.0, 0.1, 8.0, "at least"),
        (5.0, 0.5, 2.0, "at most"),
        (10.0, 0.2 * math.sqrt(2.0), 2.0, "equal"),
    ],
)
def test_the_strongest_baseline_counts_whatever_its_family(cpu_s, flip, times, kind):
    found = ratios([*baselines(), row("decoupled-15", "decoupled", cpu_s, [flip, flip])], ["flip"])
    assert list(found) == ["decoupled-15"]
    assert found["decoupled-15"]["flip"]["times"] == pytest.approx(times)
    assert found["decoupled-15"]["flip"]["kind"] == kind


def test_windows_that_agree_have_no_interval_and_others_enclose_the_ratio():
    same = ratios([*baselines(), row("a", "decoupled", 5.0, [0.3, 0.3])], ["flip"])["a"]["flip"]
    assert same["low"] == pytest.approx(same["times"])
    assert same["high"] == pytest.approx(same["times"])
    mixed = ratios([*baselines(), row("a", "paper", 5.0, [0.22, 0.38])], ["flip"])["a"]["flip"]
    assert mixed["low"] < mixed["times"] < mixed["high"]
    assert mixed["times"] == pytest.approx(same["times"])
    assert ratios(baselines(), ["flip"]) == {}
    assert ratios([row("a", "decoupled", 5.0, [0.3])], ["flip"]) == {}


def test_intervals_contain_seeds():
    """With windows that agree, two seeds are left: both as drawn or the mean, deviating by sqrt(2)."""
    seeds = [(4.0, [0.2, 0.2]), (6.0, [0.2, 0.2])]
    one = row("a", "decoupled", 5.0, [0.2, 0.2], seeds=seeds)
    found = ratios([*baselines(), one], ["flip"])["a"]["flip"]
    assert found["times"] == pytest.approx(8.0)
    reach = 1.5 ** (0.5 * math.sqrt(2.0))  # each seed is sqrt(1.5) from their geometric mean
    assert (found["low"], found["high"]) == (pytest.approx(8.0 / reach), pytest.approx(8.0 * reach))
    seeds = [(5.0, [0.25, 0.25]), (5.0, [0.35, 0.35])]
    one = row("a", "decoupled", 5.0, [0.3, 0.3], seeds=seeds)
    found = ratios([*baselines(), one], ["flip"])["a"]["flip"]
    reach = (0.35 / 0.25) ** math.sqrt(2.0)  # cost falls with the square of the error; two seeds, sqrt(2)
    middle = found["times"]
    assert (found["low"], found["high"]) == (pytest.approx(middle / reach), pytest.approx(middle * reach))


def test_errors_of_scores():
    """Averages are of JOD and of squared errors, not of decibels."""
    assert QUALITIES["cvvdp"].error([9.0, 8.0]) == pytest.approx(1.5)
    assert QUALITIES["cvvdp"].score([9.0, 8.0]) == pytest.approx(8.5)
    assert QUALITIES["psnr"].score([1e-2, 3e-2]) == pytest.approx(-10.0 * math.log10(2e-2))
    assert QUALITIES["psnr"].error([1e-6, -2e-6]) == LEAST_ERROR  # within the noise


def test_means_over_scenes():
    one = {"times": 2.0, "kind": "equal", "low": 1.0, "high": 3.0, "is_decided": True}
    sure = [one | {"times": times, "low": times, "high": times} for times in (2.0, 0.5)]
    found = mean_ratio(sure)
    assert found["times"] == pytest.approx(1.0)
    assert found["kind"] == "equal"
    assert (found["low"], found["high"]) == (pytest.approx(0.5), pytest.approx(2.0))
    alone = mean_ratio([one])  # has the interval of its scene
    assert (alone["low"], alone["high"]) == (pytest.approx(1.0, rel=0.1), pytest.approx(3.0, rel=0.1))
    assert mean_ratio([one, one | {"kind": "at least"}])["kind"] == "at least"
    assert mean_ratio([one | {"kind": "at most"}, one | {"kind": "at least"}])["kind"] is None
