"""Figures of a run from its ledger, and the clock of its tasks."""

from __future__ import annotations

import pytest

from enfilade.files import write_json
from enfilade.runs import stopwatch
from enfilade.runs.folder import RunFolder
from enfilade.runs.job import JOB_FILE
from enfilade.runs.statistics import statistics
from enfilade.runs.stopwatch import Stopwatch
from enfilade.viewing import Viewing

PIXELS = 10 * 10
IDENTITY = {
    "method": {"name": "paper", "revision": 1},
    "path": {"frames": [5, 7, 9], "size": [10, 10], "fps": 24.0},
}
FACTS = [
    ("analysis", 5, {"frames": [{"speed_px": speed} for speed in (1.0, 2.0, 3.0)]}),
    ("keyframes", 5, {"rays": {"camera": 400}, "dropped": 2}),
    ("segments", 5, {"segments": [{"first": 5, "last": 9}], "rays": {"camera": 100, "metric": 50}}),
    ("frames", 5, {"provenance": {"keyframe": 100, "slow": 0, "specular": 0, "disoccluded": 0}}),
    ("frames", 9, {"provenance": {"keyframe": 0, "slow": 10, "specular": 6, "disoccluded": 4}, "dropped": 1}),
]


@pytest.fixture
def run(tmp_path):
    with RunFolder.create(tmp_path / "run", IDENTITY) as run:
        tables = {"viewing": {"distance_m": 1.0}, "video": {}}
        write_json(run.folder / JOB_FILE, {"scene": {"file": "scene.xml"}, "settings": tables})
        yield run


def test_statistics_of_a_running_run(run):
    for name, frame, facts in FACTS:
        cost = {name: {"wall_s": 1.0, "cpu_s": 2.0}, "files": {"wall_s": 0.5, "cpu_s": 0.25}}
        run.finish({"pass": name, "frame": frame, **facts, "files": {}, "cost": cost})
    found = statistics(run)
    assert (found["method"], found["frames"], found["size"], found["fps"]) == ("paper", 3, [10, 10], 24.0)
    assert found["traced_percent"] == {
        "slow": 5.0,
        "specular": 3.0,
        "disoccluded": 2.0,
        "keyframe": 50.0,
        "total": 60.0,
    }
    table = found["time_s"]
    assert (table["total_s"], table["per_frame_s"], table["cpu_s"]) == (7.5, 2.5, 11.25)
    assert table["stages"]["frames"] == {"wall_s": 2.0, "cpu_s": 4.0}
    viewing = Viewing(10, 10, distance_m=1.0, fps=24.0)  # which the method does not read
    assert [(row["frame"], row["velocity_deg_s"], row["traced"]) for row in found["per_frame"]] == [
        (5, viewing.velocity_deg_s(1.0), 100.0),
        (9, viewing.velocity_deg_s(3.0), 20.0),
    ]
    assert found["rays_per_frame"] == [{"frame": 5, "camera": 5.0, "metric": 0.5}]
    assert found["rays"] == pytest.approx({"camera": 5.0 / 3, "metric": 0.5 / 3})
    assert (found["segments"], found["dropped_samples"], found["video"]) == ([{"first": 5, "last": 9}], 3, "")
    assert found["black_frames"] == []


def test_statistics_of_a_run_that_has_just_begun(run):
    found = statistics(run)
    assert (
        found["per_frame"],
        found["rays"],
        found["traced_percent"]["total"],
        found["time_s"]["total_s"],
    ) == (
        [],
        {},
        0,
        0,
    )


def test_the_clock_counts_each_part_without_the_parts_inside(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(stopwatch.time, "perf_counter", lambda: now[0])
    monkeypatch.setattr(stopwatch.time, "process_time", lambda: 3.0 * now[0])
    clock = Stopwatch()
    with clock.timed("frames"):
        now[0] += 1.0
        for _ in range(2):
            with clock.timed("trace"):
                now[0] += 2.0
                with clock.timed("files"):
                    now[0] += 0.5
        now[0] += 1.0
    taken = clock.take()
    assert {part: spent["wall_s"] for part, spent in taken.items()} == {
        "files": 1.0,
        "trace": 4.0,
        "frames": 2.0,
    }
    assert taken["trace"]["cpu_s"] == 12.0
    assert clock.take() == {}


def test_the_clock_counts_tasks_that_fail():
    clock = Stopwatch()
    with pytest.raises(ZeroDivisionError), clock.timed("frames"):
        raise ZeroDivisionError
    assert list(clock.take()) == ["frames"]
