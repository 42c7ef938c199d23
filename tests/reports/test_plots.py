"""The PNG file of a plan."""

import pytest

from enfilade.reports.charts import draw, legend, new_figure
from enfilade.reports.panels import run_panels
from enfilade.reports.plots import plot_plan
from support.synthetic_runs import synthetic_plan, synthetic_summary


@pytest.mark.parametrize(("method", "count"), [("paper", 3), ("decoupled", 2), ("reference", 2)])
def test_panels_of_every_method_can_be_drawn(method, count):
    panels = run_panels(synthetic_summary(method=method), 10.0)
    figure, axes = new_figure("walkthrough", [panel.title for panel in panels])
    for ax, panel in zip(axes, panels, strict=True):
        draw(ax, panel)
        legend(ax)
    assert len(figure.axes) == count
    assert figure.axes[-1].get_xlabel() == "frame"
    assert figure.axes[0].get_title(loc="left") == "(a) Image velocity"
    assert all(ax.get_legend() is not None for ax in figure.axes)


def test_a_plot_is_a_png_file(tmp_path):
    file = plot_plan(synthetic_plan(), tmp_path / "new" / "plan.png")
    assert file.read_bytes().startswith(b"\x89PNG")
