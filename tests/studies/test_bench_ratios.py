"""CPU time at equal quality, by arithmetic that can be done by hand."""

import math

import pytest

from studies.bench.equal import Point, cost_at, front, ratio_at, ratio_over
from studies.bench.judging import without_silent
from studies.bench.verdict import verdict

# Monte Carlo: four times the paths, half the error.
RIVAL = [Point(10.0, 0.4), Point(40.0, 0.2), Point(160.0, 0.1)]


def _faster(points, times):
    return [Point(p.cpu_s / times, p.error) for p in points]


def test_a_point_that_a_cheaper_one_beats_is_off_the_front():
    assert front([Point(2.0, 0.5), Point(1.0, 0.6), Point(3.0, 0.7), Point(4.0, 0.1)]) == [
        Point(1.0, 0.6),
        Point(2.0, 0.5),
        Point(4.0, 0.1),
    ]


def test_between_points_both_axes_are_logarithmic():
    cost, kind = cost_at(RIVAL, 0.1 * math.sqrt(2.0))
    assert cost == pytest.approx(80.0)
    assert kind == "equal"
    assert cost_at(RIVAL, 0.5) == (10.0, "at most")
    assert cost_at(RIVAL, 0.05) == (160.0, "at least")


def test_a_curve_five_times_faster_is_five_times_faster():
    ratio = ratio_over(RIVAL, _faster(RIVAL, 5.0))
    assert ratio.kind == "equal"
    assert ratio.times == pytest.approx(5.0)
    assert ratio.least == pytest.approx(5.0)


def test_curves_that_cross_are_averaged_and_the_least_is_told():
    ours = [Point(5.0, 0.4), Point(320.0, 0.1)]  # twice as fast at one end, half as fast at the other
    ratio = ratio_over(RIVAL, ours)
    assert ratio.times == pytest.approx(1.0)
    assert ratio.least == pytest.approx(0.5)


def test_curves_without_a_common_quality_give_a_bound():
    better = ratio_over(RIVAL, [Point(8.0, 0.05), Point(16.0, 0.02)])
    assert (better.kind, better.times) == ("at least", 20.0)
    worse = ratio_over(RIVAL, [Point(1.0, 0.9), Point(2.0, 0.8)])
    assert (worse.kind, worse.times) == ("at most", 5.0)
    assert better.text() == "≥ 20.0"
    assert worse.text() == "≤ 5.00"


def test_identical_sequences_are_better_than_all():
    ratio = ratio_over(RIVAL, [Point(1.0, 0.0)])
    assert (ratio.kind, ratio.times) == ("at least", 160.0)


def test_against_one_rival_a_margin_counts():
    ours = [Point(1.0, 0.4), Point(4.0, 0.2)]
    assert ratio_at(RIVAL[2], ours).kind == "at most"
    near = ratio_at(RIVAL[2], ours, margin=0.1)
    assert (near.kind, near.times) == ("equal", pytest.approx(40.0))
    assert ratio_at(RIVAL[2], ours, margin=0.5).kind == "at least"


def _row(name, family, cpu_s, jnd, psnr_db):
    return {
        "name": name,
        "family": family,
        "cost": {"cpu_s": cpu_s},
        "scores": {"aqm": jnd, "psnr": psnr_db},
    }


def test_the_verdict_of_made_up_contestants():
    rows = [
        _row("traced-256", "traced", 100.0, 1.0, 40.0),
        _row("denoised-4", "denoised", 20.0, 1.0, 40.0),
        _row("paper-64", "paper", 30.0, 2.0, 30.0),
        _row("decoupled-a", "decoupled", 5.0, 1.05, 40.0),
        _row("decoupled-b", "decoupled", 10.0, 0.5, 50.0),
    ]
    found = verdict(rows, ["aqm", "psnr"])
    # within 0.1 JND of its score the cheapest is good enough already; PSNR has no margin
    assert found["traced"]["traced-256"]["aqm"] == {"times": 20.0, "least": 20.0, "kind": "at least"}
    assert found["traced"]["traced-256"]["psnr"]["times"] == pytest.approx(20.0)
    assert found["paper"] == {"paper-64": ["decoupled-a", "decoupled-b"]}
    denoised = found["denoised"]
    assert denoised["by_judge"]["psnr"]["times"] == pytest.approx(4.0)
    both = denoised["by_judge"]["aqm"]["times"] * denoised["by_judge"]["psnr"]["times"]
    assert denoised["geometric_mean"] == pytest.approx(math.sqrt(both))


@pytest.mark.parametrize(
    ("psnr_db", "kind"),
    [
        ((40.0, 40.0), "equal"),
        ((40.0, 50.0), "at least"),
        ((40.0, 30.0), "at most"),
    ],
)
@pytest.mark.parametrize("jnd", [1.0, 0.5, 2.0])
def test_a_mean_is_a_bound_where_a_ratio_is_one(psnr_db, kind, jnd):
    """One judge is equal, or a bound in either way; the other one too."""
    theirs, ours = psnr_db
    rows = [
        _row("denoised-4", "denoised", 20.0, 1.0, theirs),
        _row("decoupled-a", "decoupled", 5.0, jnd, ours),
    ]
    found = verdict(rows, ["aqm", "psnr"])["denoised"]
    other = {1.0: "equal", 0.5: "at least", 2.0: "at most"}[jnd]
    assert [found["by_judge"][judge]["kind"] for judge in ("aqm", "psnr")] == [other, kind]
    bounds = {kind, other} - {"equal"}
    assert found["kind"] == (None if len(bounds) > 1 else bounds.pop() if bounds else "equal")


def test_a_judge_of_changes_that_saw_none_is_left_out():
    values = {"aqm": [1.0, 1.0], "psnr": [None, None], "temporal": [None, None], "cvvdp": [None, None]}
    row = {"name": "a", "scores": dict.fromkeys(values, 0.0), "per_frame": values}
    rows, names, reasons = without_silent([row, row], list(values))
    # PSNR of identical frames and a judge of whole sequences have no numbers of frames either
    assert names == ["aqm", "psnr", "cvvdp"]
    assert [list(r[key]) for r in rows for key in ("scores", "per_frame")] == [names] * 4
    assert [reason.partition(":")[0] for reason in reasons] == ["the judge 'temporal' is left out"]
    heard = {**row, "per_frame": {**values, "temporal": [None, 0.1]}}
    assert without_silent([heard], list(values)) == ([heard], list(values), [])
    assert without_silent([], list(values)) == ([], list(values), [])


def test_without_our_own_there_is_no_verdict():
    assert verdict([_row("traced-4", "traced", 1.0, 1.0, 40.0)], ["aqm"]) == {
        "traced": {},
        "denoised": {},
        "paper": {},
    }
