"""The time left is what is left at the pace of the ledger, and unknown where nothing tells."""

import pytest

from enfilade.reports.forecast import forecast


def line(unit, wall_s, stage="trace", **more):
    return {"unit": unit, "files": {}, "cost": {stage: {"wall_s": wall_s, "cpu_s": wall_s}}, **more}


def raw(number, wall_s, *, is_keyframe=False):
    sources = {"keyframe": 100 * is_keyframe, "reused": 0}
    return line(f"raw {number}", wall_s, "files" if is_keyframe else "warp", frame=number, sources=sources)


def of(method, lines, count=10, **who):
    return forecast({"method": method, "path": {"frames": list(range(1, count + 1))}}, lines, **who)


def test_a_reference_at_its_pace():
    found = of("reference", [line("survey", 1.0), *(line(f"frame {i}", 2.0) for i in range(1, 5))])
    assert found.left_s == pytest.approx(6 * 2.0)
    assert "last 4 frames" in found.text
    steps = {step.name: (step.done, step.total, step.wall_s) for step in found.steps}
    assert steps["frames"] == (4, 10, 8.0)
    assert steps["video"] == (0, 1, 0.0)


def test_in_betweens_and_antialiasing_add_up_and_keyframes_do_not_count():
    lines = [raw(1, 0.0, is_keyframe=True), raw(2, 3.0), raw(3, 3.0), line("frame 1", 0.5)]
    assert of("paper", lines).left_s == pytest.approx(7 * 3.0 + 9 * 0.5)


def test_frames_that_repeat_another_do_not_count():
    whole = {"keyframe": 0, "hole": 0, "reused": 100}
    copies = [line(f"raw {i}", 0.01, "files", sources=whole) for i in (3, 4, 5)]
    assert of("paper", [raw(2, 3.0), *copies]).left_s == pytest.approx(6 * 3.0)
    reused = line("raw 2", 3.0, "warp", sources=whole)  # nothing had to be traced, but it is no copy
    assert of("paper", [reused, *copies]).left_s == pytest.approx(6 * 3.0)


@pytest.mark.parametrize(
    ("workers", "rounds", "words"),
    [(0, 6, "2 frames, one after the other"), (1, 6, "2 frames"), (4, 2, "2 frames, 4 at a time")],
)
def test_units_are_done_side_by_side(workers, rounds, words):
    found = of("reference", [line(f"frame {i}", 5.0) for i in (1, 2)], count=8, workers=workers)
    assert found.left_s == pytest.approx(rounds * 5.0)
    assert found.text == f"at the pace of the last {words}"


def test_shading_counts_and_so_does_the_average_over_time():
    lines = [line(f"raw {number}", 2.0) for number in range(1, 5)]
    found = of("decoupled", [line("light 1-10", 9.0), *lines, line("frame 1", 0.5)])
    assert found.left_s == pytest.approx(6 * 2.0 + 9 * 0.5)
    assert found.text == "at the pace of the last 4 shaded frames"
    assert "the average over time left out" in of("decoupled", lines).text
    assert {step.name: step.total for step in found.steps}["frames shaded"] == 10


def test_only_antialiasing_is_left():
    lines = [raw(i, 3.0) for i in range(1, 11)]
    assert of("paper", lines).left_s is None
    found = of("paper", [*lines, line("frame 1", 0.5)])
    assert found.left_s == pytest.approx(9 * 0.5)
    assert "last 1 frames" in found.text


def test_before_the_first_frame_nothing_is_known():
    verdict = {"is_split": False}
    lines = [line("keyframe 1", 4.0), line("segment 1-5", 1.0, first=1, last=5, verdict=verdict)]
    found = of("paper", lines)
    assert found.left_s is None
    assert found.text.startswith("50 % of the path is judged, which took 5 s")
    assert of("decoupled", lines[:1]).left_s is None


def test_a_finished_run():
    assert (
        of(
            "paper",
            [line(f"{k} {i}", 1.0, sources={"keyframe": 0}) for k in ("raw", "frame") for i in range(1, 11)],
        ).left_s
        == 0.0
    )


def test_units_of_a_later_version_are_listed():
    assert "glow" in [step.name for step in of("decoupled", [line("glow 1", 1.0)]).steps]
