"""The plots show what the summary says: the axes are read, not the pixels."""

import json

import numpy as np
import pytest

from enfilade.errors import RunFolderError
from enfilade.reports.charts import frame_edges
from enfilade.reports.plots import plan_figure, plot_plan, plot_run, walkthrough_figure
from made_up_runs import made_up_plan, made_up_summary


def lines(ax):
    return {line.get_label(): line.get_xydata() for line in ax.lines}


def test_velocity_is_drawn_with_keyframes_marked():
    summary = made_up_summary()
    ax = walkthrough_figure(summary).axes[0]
    drawn = lines(ax)
    np.testing.assert_allclose(
        drawn["mean over the image"], [[r["frame"], r["velocity_deg_s"]] for r in summary["per_frame"]]
    )
    keyframes = [r["frame"] for r in summary["per_frame"] if r["keyframe"]]
    assert drawn["keyframes"][:, 0].tolist() == keyframes
    assert ax.get_ylabel() == "velocity, deg/s"


def test_predictions_before_and_after_splitting():
    summary = made_up_summary()
    drawn = lines(walkthrough_figure(summary).axes[1])
    before = [(s["middle"], s["percent_visible"]) for s in summary["segments"] if s["depth"] == 0]
    after = sorted((s["middle"], s["percent_visible"]) for s in summary["segments"] if not s["is_split"])
    assert drawn["pursuit, before"].tolist() == [list(p) for p in before]
    assert drawn["pursuit, after splitting"].tolist() == [list(p) for p in after]
    np.testing.assert_allclose(
        drawn["no pursuit, before"][:, 1], 0.4 * np.array([visible for _, visible in before])
    )
    assert set(drawn["split above 10 %"][:, 1]) == {10.0}


def test_segments_without_a_middle_are_left_out():
    summary = made_up_summary()
    kept = len(lines(walkthrough_figure(summary).axes[1])["pursuit, before"])
    empty = {"first": 1, "last": 2, "middle": None, "depth": 0, "is_split": False, "percent_visible": 0.0}
    summary["segments"].append(empty)
    assert len(lines(walkthrough_figure(summary).axes[1])["pursuit, before"]) == kept


def test_the_threshold_is_that_of_the_run():
    drawn = lines(walkthrough_figure({**made_up_summary(), "split_percent": 12.5}).axes[1])
    assert set(drawn["split above 12.5 %"][:, 1]) == {12.5}


def test_predictions_that_were_not_made_are_left_out():
    summary = made_up_summary()
    for segment in summary["segments"]:
        segment["percent_visible_no_pursuit"] = None
    assert "no pursuit, before" not in lines(walkthrough_figure(summary).axes[1])


def test_traced_pixels_are_stacked_by_reason():
    summary = made_up_summary()
    ax = walkthrough_figure(summary).axes[-1]
    tops = {patch.get_label(): patch.get_data() for patch in ax.patches}
    assert list(tops) == ["slow", "specular", "holes", "keyframes"]
    traced = [row["traced"] for row in summary["per_frame"]]
    np.testing.assert_allclose(tops["keyframes"].values, traced)
    np.testing.assert_allclose(tops["keyframes"].baseline, tops["holes"].values)
    assert ax.get_ylim() == (0.0, 100.0)
    assert lines(ax)["mean 34.1 %"][0, 1] == pytest.approx(34.13)


def test_every_panel_has_units_and_a_legend():
    figure = walkthrough_figure(made_up_summary())
    assert len(figure.axes) == 3
    assert figure.axes[-1].get_xlabel() == "frame"
    for ax in figure.axes:
        assert any(unit in ax.get_ylabel() for unit in ("deg/s", "%"))
        assert ax.get_legend() is not None


def test_a_reference_run_has_no_predictions_and_no_marks():
    figure = walkthrough_figure(made_up_summary(method="reference"))
    assert len(figure.axes) == 2
    assert "keyframes" not in lines(figure.axes[0])


def test_a_single_frame_can_be_drawn():
    summary = {**made_up_summary(1), "segments": []}
    assert len(walkthrough_figure(summary).axes) == 2


@pytest.mark.parametrize(
    ("frames", "edges"),
    [([7], [6.5, 7.5]), ([1, 2, 3], [0.5, 1.5, 2.5, 3.5]), ([1, 5, 9], [-1.0, 3.0, 7.0, 11.0])],
)
def test_frame_edges(frames, edges):
    assert frame_edges(frames).tolist() == edges


def test_plot_run_writes_into_the_run_folder(tmp_path):
    (tmp_path / "summary.json").write_text(json.dumps(made_up_summary()))
    files = plot_run(tmp_path)
    assert files == [tmp_path / "plots" / "walkthrough.png"]
    first = files[0].read_bytes()
    assert first.startswith(b"\x89PNG")
    assert plot_run(tmp_path)[0].read_bytes() == first


@pytest.mark.parametrize("text", [None, "{not json"])
def test_a_run_without_a_readable_summary(tmp_path, text):
    if text is not None:
        (tmp_path / "summary.json").write_text(text)
    with pytest.raises(RunFolderError, match=r"summary\.json"):
        plot_run(tmp_path)


def test_plan_with_holes_of_a_few_frames(tmp_path):
    plan = made_up_plan()
    top, bottom = plan_figure(plan).axes
    assert lines(top)["keyframes"][:, 0].tolist() == plan["keyframes"]
    assert lines(bottom)["holes (estimate)"].tolist() == [[11, 2.0], [31, 2.0], [50, 2.0]]
    np.testing.assert_allclose(lines(bottom)["slow"][:, 1], plan["slow_percent"])
    assert plot_plan(plan, tmp_path / "new" / "plan.png").exists()


def test_plan_with_holes_per_frame():
    plan = {**made_up_plan(), "hole_percent": [1.0] * 60}
    assert len(lines(plan_figure(plan).axes[1])["holes (estimate)"]) == 60


def test_plan_without_any_holes_looked_for():
    plan = {**made_up_plan(), "hole_percent": [None] * 60}
    assert "holes (estimate)" not in lines(plan_figure(plan).axes[1])
