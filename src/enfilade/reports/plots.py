"""The plot of a plan as a PNG file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from enfilade.reports import charts
from enfilade.reports.panels import plan_panels


def plot_plan(plan: Mapping[str, Any], file: Path) -> Path:
    """Draw a plan, ``Plan.to_dict()``, into a PNG file."""
    panels = plan_panels(plan)
    title = f"plan, method {plan['method']}, {len(plan['frames'])} frames"
    figure, axes = charts.new_figure(title, [panel.title for panel in panels])
    for ax, panel in zip(axes, panels, strict=True):
        charts.draw(ax, panel)
        ax.set_ylabel(panel.unit)
        charts.legend(ax)
    return charts.save(figure, file)
