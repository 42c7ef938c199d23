"""Tables 1 and 2 hold the figures of the summary."""

import pytest

from enfilade.reports.tables import comparison_table, percent, plan_tables, run_tables, seconds
from made_up_runs import made_up_plan, made_up_summary
from printed import as_text
from studies.bench.tables import bench_tables


def rows(table):
    return [line.split() for line in as_text(table).splitlines() if line.strip()]


def test_table_1_has_the_papers_columns():
    table = rows(run_tables(made_up_summary())[0])
    assert table[1] == ["method", "slow", "specular", "occlusion", "keyframes", "total"]
    assert table[-1] == ["paper", "20.0", "7.9", "0.43", "5.8", "34.1"]


def test_rays_are_listed_where_they_are_counted():
    table = rows(run_tables(made_up_summary(method="decoupled"))[0])
    assert table[1] == ["method", "camera", "lobes", "light", "drafts", "total"]
    assert table[-1] == ["decoupled", "12.50", "3.00", "2.00", "1.00", "18.50"]


def test_table_2_lists_the_stages_and_adds_up():
    table = rows(run_tables(made_up_summary())[1])
    assert ["fill", "2.5", "min", "4.8", "min", "1.25", "s", "62.5"] in table
    assert table[-1] == ["total", "4.0", "min", "7.2", "min", "2.00", "s", "100.0"]


def test_frames_may_be_a_list():
    summary = {**made_up_summary(), "frames": list(range(1, 61))}
    assert ["fill", "2.5", "min", "4.8", "min", "2.50", "s", "62.5"] in rows(run_tables(summary)[1])


def test_plan():
    walk, forecast = (as_text(table) for table in plan_tables(made_up_plan()))
    assert "60 frames, 4 initial keyframes: 1, 21, 41, 60" in walk
    assert "123,456,789" in forecast
    assert "8.5 min" in forecast


def test_a_rehearsed_plan():
    forecast = {
        "rays": {"camera": 12.0, "lobes": 3.0, "light": 2.0, "drafts": 1.5},
        "paths": 16,
        "seconds": 7200.0,
        "cpu_seconds": 14000.0,
        "rehearsed_frames": 9,
        "rehearsed_size": [365, 274],
    }
    plan = {**made_up_plan(), "method": "decoupled", "forecast": forecast}
    table = rows(plan_tables(plan)[1])
    assert ["rays", "per", "pixel", "and", "frame", "18.5"] in table
    assert ["time", "2.00", "h"] in table
    assert table[-1] == ["Rehearsed", "with", "9", "frames", "at", "365x274."]


def test_names_are_text_and_not_markup():
    row = {"name": "shots/shot[final].0001.exr", "score_jnd": 1.0, "steady_jnd": 1.0, "transient_jnd": 0.0}
    row |= {"psnr_db": None, "percent_visible": 2.0, "velocity_deg_s": 0.5}
    found = {**row, "per_frame": [row], "percent_visible": {"mean": 2.0}, "size": [64, 48], "fps": 24.0}
    text = as_text(comparison_table({**found, "pixels_per_degree": 28.0, "mode": "modern"}))
    assert "shot[final].0001.exr" in text
    bench = {"scene": "shot[final]/scene.xml", "frames": [1], "size": [64, 48], "judges": {}}
    bench |= {"contestants": []}
    reference = {"floor": None, "filters": ["box"], "spp": 4}
    verdict = {"traced": {}, "denoised": {}, "paper": {}}
    (table,) = bench_tables({**bench, "reference": reference, "verdict": verdict})
    assert "shot[final]/scene.xml, 1 frames" in as_text(table)


def test_many_keyframes_are_cut_short():
    plan = {**made_up_plan(), "keyframes": list(range(1, 61, 2))}
    assert "21, 23, ... 59" in as_text(plan_tables(plan)[0])


@pytest.mark.parametrize(
    ("value", "text"),
    [(7200.0, "2.00 h"), (150.0, "2.5 min"), (99.5, "99.50 s"), (0.1, "0.10 s"), (0.0123, "12.3 ms")],
)
def test_seconds(value, text):
    assert seconds(value) == text


@pytest.mark.parametrize(("value", "text"), [(0.0, "0.0"), (0.3, "0.30"), (40.81, "40.8"), (100.0, "100.0")])
def test_percent(value, text):
    assert percent(value) == text
