"""Plots of a run and of a plan as PNG files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from enfilade.reports import charts
from enfilade.reports.panels import plan_panels, run_panels
from enfilade.runs.folder import RunFolder
from enfilade.runs.statistics import statistics


def plot_run(folder: Path) -> list[Path]:
    """Draw the charts of a run, as far as it is finished, into its folder ``plots``.

    Returns
    -------
    list of Path
        The PNG files; none before the first frame is finished.

    Raises
    ------
    RunFolderError
        It is no run folder, is damaged, or can't be written.
    """
    run = RunFolder.read(folder)
    summary = statistics(run)
    if not summary["per_frame"]:
        return []
    figure = walkthrough_figure(summary, split_percent_of(run.identity))
    return [charts.save(figure, folder / "plots" / "walkthrough.png")]


def plot_plan(plan: Mapping[str, Any], file: Path) -> Path:
    """Draw a plan, ``Plan.to_dict()``, into a PNG file."""
    title = f"plan, method {plan['method']}, {len(plan['frames'])} frames"
    return charts.save(_figure(title, plan_panels(plan)), file)


def split_percent_of(identity: Mapping[str, Any]) -> float | None:
    """Visible pixels, percent, above which a run splits segments; None if its method has no such setting."""
    found: float | None = identity["settings"].get("masks", {}).get("split_percent")
    return found


def walkthrough_figure(summary: Mapping[str, Any], split_percent: float | None = None) -> charts.Figure:
    """Charts of :func:`~enfilade.reports.panels.run_panels` on a shared axis (Figs. 12, 13)."""
    width, height = summary["size"]
    count = len(summary["per_frame"])
    title = f"method {summary['method']}, {count} frames, {width}x{height}"
    return _figure(title, run_panels(summary, split_percent))


def _figure(title: str, panels: Sequence[charts.Panel]) -> charts.Figure:
    figure, axes = charts.new_figure(title, [panel.title for panel in panels])
    for ax, panel in zip(axes, panels, strict=True):
        charts.draw(ax, panel)
        ax.set_ylabel(panel.unit)
        charts.legend(ax)
    return figure
