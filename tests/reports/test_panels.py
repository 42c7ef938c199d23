"""Charts of runs and plans, and their SVG: series are read, not pixels."""

from xml.etree.ElementTree import fromstring

import numpy as np
import pytest

from enfilade.reports.charts import PALETTE, Panel, Series, draw, new_figure, svg
from enfilade.reports.panels import plan_panels, quality_panel, run_panels, time_panel
from support.synthetic_runs import synthetic_plan, synthetic_summary


def panels(split_percent=None, **terms):
    return {panel.name: panel for panel in run_panels(synthetic_summary(**terms), split_percent)}


def values(panel):
    return {series.name: dict(series.values) for series in panel.series}


def test_velocity_with_keyframes():
    rows, drawn = synthetic_summary()["per_frame"], values(panels()["velocity"])
    assert drawn["mean over the image"] == {row["frame"]: row["velocity_deg_s"] for row in rows}
    assert list(drawn["keyframes"]) == [row["frame"] for row in rows if row["keyframe"]]


def test_predictions_before_and_after_splitting():
    segments, panel = synthetic_summary()["segments"], panels(12.5)["predictions"]
    before = {s["middle"]: s["percent_visible"] for s in segments if s["depth"] == 0}
    after = {s["middle"]: s["percent_visible"] for s in segments if not s["is_split"]}
    assert values(panel)["pursuit, before split"] == before
    assert values(panel)["pursuit, after split"] == after
    at_rest = values(panel)["at rest, before split"]
    assert at_rest == pytest.approx({middle: 0.4 * visible for middle, visible in before.items()})
    assert panel.level == (12.5, "split above 12.5 %")
    assert "1 of 8 segments were split" in panel.text
    assert panels()["predictions"].level is None


def test_segments_without_a_middle_or_a_second_prediction():
    summary = synthetic_summary()
    empty = {"first": 1, "last": 2, "middle": None, "depth": 0, "is_split": False, "percent_visible": 0.0}
    summary["segments"] = [{**s, "percent_visible_no_pursuit": None} for s in summary["segments"]] + [empty]
    panel = run_panels(summary)[-1]
    assert list(values(panel)) == ["pursuit, before split", "pursuit, after split"]
    assert None not in values(panel)["pursuit, before split"]


def test_traced_pixels_by_reason_and_rays_by_kind():
    paper, decoupled = panels(), panels(method="decoupled")
    assert list(values(paper["traced"])) == ["slow", "specular", "disoccluded", "keyframe"]
    assert paper["traced"].level == (34.13, "mean 34.1 %")
    assert "traced" not in decoupled
    assert list(values(decoupled["rays"])) == ["irradiance", "camera"]  # no specular ray was sent
    assert values(decoupled["rays"])["irradiance"][2] == 0.0
    assert decoupled["rays"].top > 52.5


def test_a_reference_has_no_marks_and_no_predictions():
    reference = panels(method="reference")
    assert list(reference) == ["velocity", "traced"]
    assert list(values(reference["velocity"])) == ["mean over the image"]


def test_time_by_pass_without_analysis_and_video():
    cost = {"gbuffer": {"wall_s": 1.0}, "trace": {"wall_s": 2.0}}
    names = ("analysis", "hash_grid", "frames", "clips", "video")
    panel = time_panel([{"pass": name, "frame": 3, "cost": cost} for name in names], {"frames": 1.0})
    assert values(panel) == {"hash grid": {3: 3.0}, "frames": {3: 3.0}}
    assert panel.series[1].color == PALETTE[0]  # as of rays of that name


def test_quality_and_plan():
    rows = [{"number": 7, "score_jnd": 0.4}, {"number": 9, "score_jnd": 0.2}]
    panel = quality_panel({"per_frame": rows, "noise_floor": None})
    assert values(panel) == {"score": {7: 0.4, 9: 0.2}}
    assert panel.top > 1.0  # small scores look small
    assert panel.level is None  # 1 JND is the threshold of a pixel, not of a pooled score
    velocity, pixels = plan_panels(synthetic_plan())
    assert list(values(velocity)["keyframes"]) == [1, 21, 41, 60]
    assert list(values(pixels)["slow"].values()) == synthetic_plan()["slow_percent"]


def bars(*series):
    return Panel("bars", "Bars", "%", "", tuple(Series(*of, "bar") for of in series), 100.0, (5.0, "mean"))


def test_bars_are_stacked_and_stand_where_frames_are():
    _, (ax,) = new_figure("title", ["bars"])
    draw(ax, bars(("a", "#111111", {1: 3.0, 2: 4.0, 7: 5.0}), ("b", "#222222", {1: 1.0, 2: 2.0, 7: 3.0})))
    lower, upper = (patch.get_data() for patch in ax.patches)
    assert lower.edges.tolist() == [0.5, 1.5, 1.5, 2.5, 6.5, 7.5]
    assert lower.values.tolist() == [3.0, 0.0, 4.0, 0.0, 5.0]
    np.testing.assert_allclose(upper.baseline, lower.values)
    np.testing.assert_allclose(upper.values[::2], [4.0, 6.0, 8.0])


def test_svg_takes_the_colours_of_the_page_and_shares_no_names():
    one = bars(("a", "#112233", {5: 3.0}))
    text, other = svg(one, (4.5, 9.5)), svg(Panel("other", "", "", "", one.series, 9.0), (4.5, 9.5))
    root = fromstring(text)
    assert {"5", "6", "9", "100"} <= {of.text for of in root.iter("{http://www.w3.org/2000/svg}text")}
    assert "#112233" in text
    assert "currentColor" in text
    assert "#333333" not in text
    assert "<metadata" not in text
    names, others = ({of.get("id") for of in fromstring(t).iter()} - {None} for t in (text, other))
    assert not names & others
    assert svg(one, (4.5, 9.5)) == text
