"""CPU time at equal quality, by arithmetic that can be done by hand."""

import math

import pytest

from studies.bench.__main__ import missed
from studies.bench.ratios import Point, cost_at, front, ratio_at, ratio_over, ratios

# Monte Carlo: four times the paths, half the error.
BASELINE = [Point(10.0, 0.4), Point(40.0, 0.2), Point(160.0, 0.1)]


def test_a_point_that_a_cheaper_one_beats_is_off_the_front():
    points = [Point(2.0, 0.5), Point(1.0, 0.6), Point(3.0, 0.7), Point(4.0, 0.1)]
    assert front(points) == [Point(1.0, 0.6), Point(2.0, 0.5), Point(4.0, 0.1)]


def test_between_points_both_axes_are_logarithmic():
    cost, kind = cost_at(BASELINE, 0.1 * math.sqrt(2.0))
    assert cost == pytest.approx(80.0)
    assert kind == "equal"
    assert cost_at(BASELINE, 0.5) == (10.0, "at most")
    assert cost_at(BASELINE, 0.05) == (160.0, "at least")


@pytest.mark.parametrize(
    ("decoupled", "times", "least", "kind"),
    [
        ([Point(p.cpu_s / 5.0, p.error) for p in BASELINE], 5.0, 5.0, "equal"),
        ([Point(5.0, 0.4), Point(320.0, 0.1)], 1.0, 0.5, "equal"),  # curves that cross
        ([Point(8.0, 0.05), Point(16.0, 0.02)], 20.0, 20.0, "at least"),  # no quality in common
        ([Point(1.0, 0.9), Point(2.0, 0.8)], 5.0, 5.0, "at most"),
        ([Point(1.0, 0.0)], 160.0, 160.0, "at least"),  # identical sequences
    ],
)
def test_ratios_over_common_qualities(decoupled, times, least, kind):
    ratio = ratio_over(BASELINE, decoupled)
    assert ratio.times == pytest.approx(times)
    assert ratio.least == pytest.approx(least)
    assert ratio.kind == kind


def test_against_one_rival_a_margin_counts():
    decoupled = [Point(1.0, 0.4), Point(4.0, 0.2)]
    assert ratio_at(BASELINE[2], decoupled).kind == "at most"
    near = ratio_at(BASELINE[2], decoupled, margin=0.1)
    assert (near.kind, near.times) == ("equal", pytest.approx(40.0))
    assert ratio_at(BASELINE[2], decoupled, margin=0.5).kind == "at least"


def row(name, family, cpu_s, jnd, psnr_db):
    return {"name": name, "family": family, "cost": {"cpu_s": cpu_s}, "scores": {"aqm": jnd, "psnr": psnr_db}}


def test_ratios_of_synthetic_configurations():
    rows = [
        row("traced-256", "traced", 100.0, 1.0, 40.0),
        row("denoised-4", "denoised", 20.0, 1.0, 40.0),
        row("paper-64", "paper", 30.0, 2.0, 30.0),
        row("decoupled-a", "decoupled", 5.0, 1.05, 40.0),
        row("decoupled-b", "decoupled", 10.0, 0.5, 50.0),
    ]
    found = ratios(rows, ["aqm", "psnr"])
    # Within 0.1 JND of its score the cheapest is good enough; PSNR has no margin.
    assert found["traced"]["traced-256"]["aqm"] == {"times": 20.0, "least": 20.0, "kind": "at least"}
    assert found["traced"]["traced-256"]["psnr"]["times"] == pytest.approx(20.0)
    assert found["paper"] == {"paper-64": ["decoupled-a", "decoupled-b"]}
    both = [found["denoised"]["by_measure"][name]["times"] for name in ("aqm", "psnr")]
    assert both[1] == pytest.approx(4.0)
    assert found["denoised"]["geometric_mean"] == pytest.approx(math.sqrt(both[0] * both[1]))
    assert ratios(rows[:1], ["aqm"]) == {"traced": {}, "denoised": {}, "paper": {}}


@pytest.mark.parametrize(
    ("jnd", "psnr_db", "kind"),
    [
        (1.0, 40.0, "equal"),
        (1.0, 50.0, "at least"),
        (2.0, 40.0, "at most"),
        (0.5, 50.0, "at least"),
        (0.5, 30.0, None),
    ],
)
def test_a_mean_is_a_bound_where_a_ratio_is_one(jnd, psnr_db, kind):
    rows = [row("denoised-4", "denoised", 20.0, 1.0, 40.0), row("a", "decoupled", 5.0, jnd, psnr_db)]
    assert ratios(rows, ["aqm", "psnr"])["denoised"]["kind"] == kind


@pytest.mark.parametrize(
    ("mean", "kind", "is_met"),
    [
        (3.5, "equal", True),
        (3.5, "at least", True),
        (3.5, "at most", False),
        (3.5, None, False),
        (2.5, "at least", False),
    ],
)
def test_a_mean_that_is_only_bounded_from_above_meets_nothing(mean, kind, is_met):
    many = {"times": 40.0, "least": 40.0, "kind": "equal"}
    denoised = {"by_measure": {"aqm": many}, "geometric_mean": mean, "kind": kind, "least": 40.0}
    found = missed("room", {"traced": {"traced-256": {"aqm": many}}, "denoised": denoised, "paper": {}})
    assert len(found) == (0 if is_met else 1)
    assert all("3 times less CPU time than denoised" in text for text in found)
