"""The PNG file of a plan, and charts of runs."""

import pytest

from enfilade.reports import plots
from enfilade.reports.charts import svg
from enfilade.reports.panels import plan_panels, run_panels
from enfilade.reports.plots import plot_plan
from support.synthetic_runs import FRAMES, synthetic_plan, synthetic_summary


@pytest.mark.parametrize(("method", "count"), [("paper", 3), ("decoupled", 2), ("reference", 2)])
def test_a_run_has_charts_with_axes(method, count):
    panels = run_panels(synthetic_summary(method=method), 10.0)
    assert len(panels) == count
    drawn = [svg(panel, (FRAMES[0] - 0.5, FRAMES[-1] + 0.5)) for panel in panels]
    assert all(chart.lstrip().startswith("<svg") and "<path" in chart for chart in drawn)
    assert len(set(drawn)) == count


def test_panels_of_a_plan_have_a_heading_a_unit_and_a_legend(tmp_path, monkeypatch):
    figures = []
    monkeypatch.setattr(plots.charts, "save", lambda figure, file: figures.append(figure) or file)
    plan = synthetic_plan()
    plot_plan(plan, tmp_path / "plan.png")
    axes, panels = figures[0].axes, plan_panels(plan)
    assert [ax.get_ylabel() for ax in axes] == [panel.unit for panel in panels]
    assert all(ax.get_title(loc="left") for ax in axes)
    assert all(ax.get_legend() is not None for ax in axes)
    assert axes[-1].get_xlabel() == "frame"


def test_a_plot_is_a_png_file(tmp_path):
    file = plot_plan(synthetic_plan(), tmp_path / "new" / "plan.png")
    assert file.read_bytes().startswith(b"\x89PNG")
