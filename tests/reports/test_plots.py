"""PNG files of runs and plans."""

import pytest

from enfilade.errors import RunFolderError
from enfilade.reports.plots import plot_plan, plot_run, walkthrough_figure
from support.synthetic_runs import synthetic_plan, synthetic_run, synthetic_summary


@pytest.mark.parametrize(("method", "count"), [("paper", 3), ("decoupled", 2), ("reference", 2)])
def test_every_panel_has_a_heading_a_unit_and_a_legend(method, count):
    figure = walkthrough_figure(synthetic_summary(method=method), 10.0)
    assert len(figure.axes) == count
    assert figure.axes[-1].get_xlabel() == "frame"
    assert figure.axes[0].get_ylabel() == "deg/s"
    assert figure.axes[0].get_title(loc="left") == "(a) Image velocity"
    assert all(ax.get_legend() is not None for ax in figure.axes)


def test_plot_run_writes_into_the_run_folder(copied):
    files = plot_run(copied)
    assert files == [copied / "plots" / "walkthrough.png"]
    first = files[0].read_bytes()
    assert first.startswith(b"\x89PNG")
    assert plot_run(copied)[0].read_bytes() == first
    assert plot_plan(synthetic_plan(), copied / "new" / "plan.png").read_bytes().startswith(b"\x89PNG")


def test_before_the_first_frame_there_is_nothing_to_draw(tmp_path):
    assert plot_run(synthetic_run(tmp_path / "run", finished=())) == []
    with pytest.raises(RunFolderError, match="no run folder"):
        plot_run(tmp_path)
