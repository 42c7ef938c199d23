"""Tables have the figures of the summary, for any method."""

from enfilade.reports.tables import comparison_table, measures_line, percent, result_line, run_tables, seconds
from support.console import as_text
from support.synthetic_runs import synthetic_summary


def rows(table):
    return [line.split() for line in as_text(table).splitlines() if line.strip()]


def test_pixels_are_listed_by_reason():
    table = rows(run_tables(synthetic_summary())[0])
    assert table[1] == ["method", "slow", "specular", "disoccluded", "keyframe", "total"]
    assert table[-1] == ["paper", "20.0", "7.9", "0.43", "5.8", "34.1"]


def test_rays_are_listed_where_they_are_counted():
    table = rows(run_tables(synthetic_summary(method="decoupled"))[0])
    assert table[1] == ["method", "irradiance", "camera", "specular", "total"]
    assert table[-1] == ["decoupled", "2.00", "12.50", "0.00", "14.50"]


def test_time_is_listed_by_stage_and_adds_up():
    table = rows(run_tables(synthetic_summary())[1])
    assert ["final", "gather", "2.5", "min", "4.8", "min", "1.25", "s", "62.5"] in table
    assert table[-1] == ["total", "4.0", "min", "7.2", "min", "2.00", "s", "100.0"]


def test_comparison():
    row = {"name": "shots/shot[final].0001.exr", "score_jnd": 1.0, "steady_jnd": 1.0, "transient_jnd": 0.0}
    row |= {"psnr_db": None, "is_identical": True, "percent_visible": 2.0, "velocity_deg_s": 0.5}
    found = {**row, "per_frame": [row] * 9, "percent_visible": {"mean": 2.0}, "size": [64, 48], "fps": 24.0}
    found |= {"pixels_per_degree": 28.0, "mode": "modern", "meaning": "noticed"}
    text = as_text(comparison_table(found))
    assert text.count("shot[final].0001.exr") == 8  # a name is no markup
    assert "the 8 frames with the largest score" in text
    assert "identical" in text
    equal_as_shown = [{**row, "is_identical": False}]
    text = as_text(comparison_table({**found, "is_identical": False, "per_frame": equal_as_shown}))
    assert "identical" not in text
    assert text.count("infinite") == 2
    assert result_line(found) == "1.00 JND (noticed); 2.0 % of the pixels above 1 JND"


def test_further_measures_have_their_units():
    scores = {"psnr": None, "cvvdp": 9.3124, "flip": 0.01234, "mine": 1.0}
    assert measures_line({"scores": scores}) == "psnr infinite, cvvdp 9.312 JOD, flip 0.01234, mine 1"
    assert measures_line({"scores": {}}) == ""


def test_numbers():
    assert [seconds(v) for v in (7200.0, 150.0, 99.5, 0.1)] == ["2.00 h", "2.5 min", "99.50 s", "0.10 s"]
    assert seconds(0.0123) == "12.3 ms"
    assert [percent(v) for v in (0.0, 0.3, 40.81, 100.0)] == ["0.0", "0.30", "40.8", "100.0"]
