"""A comparison over time: score with its steady and transient parts, visible pixels, and each band."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.reports import charts

LEAST_TOP_JND = 1.25  # of the axis: small scores look small
LEAST_TOP_PERCENT = 1.0
PARTS = (  # key, name in the legend, colour, mark
    ("score_jnd", "score", charts.INK, "line"),
    ("steady_jnd", "steady part", charts.BLUE, "dashed"),
    ("transient_jnd", "transient part", charts.VERMILION, "dashed"),
)


def plot_comparison(found: Mapping[str, Any], file: Path) -> Path:
    """Draw a comparison, ``SequenceDifference.to_dict()``, into a PNG file.

    Raises
    ------
    RunFolderError
        The file can't be written.
    """
    return charts.save(time_figure(found), file)


def time_figure(found: Mapping[str, Any]) -> charts.Figure:
    """Score, visible pixels and bands over the frames, on a shared axis."""
    rows = found["per_frame"]
    width, height = found["size"]
    title = (
        f"{found['score_jnd']:.2f} JND ({found['meaning']})\n{len(rows)} frames, {width}x{height}, "
        f"{found['fps']:g} fps, {found['pixels_per_degree']:.1f} pixels per degree, mode {found['mode']}"
    )
    panels = (_score_panel(rows, found), _percent_panel(rows))
    figure, axes = charts.new_figure(
        title, [*(panel.title for panel in panels), "bands of spatial frequencies"]
    )
    for ax, panel in zip(axes, panels, strict=False):
        charts.draw(ax, panel)
        ax.set_ylabel(panel.unit)
    for ax in axes[:2]:
        charts.legend(ax)
    _draw_bands(figure, axes[2], rows, found["bands_cpd"])
    return figure


def _score_panel(rows: Sequence[Mapping[str, Any]], found: Mapping[str, Any]) -> charts.Panel:
    parts = PARTS if any(row["transient_jnd"] for row in rows) else PARTS[:1]
    series = tuple(charts.Series(name, color, _values(rows, key), mark) for key, name, color, mark in parts)
    score, floor = found["score_jnd"], found["noise_floor"]
    if floor:
        floors = dict(zip(series[0].values, floor["per_frame_jnd"], strict=True))
        series += (charts.Series("noise floor", charts.ORANGE, floors, "square"),)
    top = 1.08 * max(LEAST_TOP_JND, *(value for of in series for value in of.values.values()))
    return charts.Panel(
        "score", "score of each frame", "JND", "", series, top, (score, f"sequence {score:.2f}")
    )


def _percent_panel(rows: Sequence[Mapping[str, Any]]) -> charts.Panel:
    values = _values(rows, "percent_visible")
    mean = sum(values.values()) / len(values)
    top = min(1.1 * max(LEAST_TOP_PERCENT, *values.values()), 100.0)
    series = (charts.Series("visible", charts.SKY, values, "bar"),)
    return charts.Panel(
        "percent", "pixels above 1 JND", "% of pixels", "", series, top, (mean, f"mean {mean:.1f} %")
    )


def _values(rows: Sequence[Mapping[str, Any]], key: str) -> dict[int, float]:
    return {int(row["number"]): float(row[key]) for row in rows}


def _draw_bands(
    figure: charts.Figure, ax: Any, rows: Sequence[Mapping[str, Any]], bands: Sequence[list[float]]
) -> None:
    """Draw the larger of the steady and the transient difference, by frame and band."""
    parts = [np.array([row[key] for row in rows]).T for key in ("steady_bands_jnd", "transient_bands_jnd")]
    jnd = np.maximum(*parts)
    numbers, top = [float(row["number"]) for row in rows], float(jnd.max()) or 1.0  # any, if nothing differs
    if len(numbers) == 1:  # one column would have no width
        numbers, jnd = [numbers[0] - 0.25, numbers[0] + 0.25], jnd.repeat(2, axis=1)
    mesh = ax.pcolormesh(
        numbers, range(len(bands)), jnd, cmap="cividis", vmin=0.0, vmax=top, shading="nearest"
    )
    names = [f"below {high:.2g}" if low == 0.0 else f"{low:.2g} to {high:.2g}" for low, high in bands]
    ax.set_yticks(range(len(bands)), names)
    ax.invert_yaxis()
    ax.grid(visible=False)
    ax.set_ylabel("cycles per degree")
    bar = figure.colorbar(mesh, ax=ax, pad=0.01, aspect=14)
    bar.set_label("JND, the larger of\nsteady and transient", fontsize=8, color=charts.INK)
    bar.ax.tick_params(colors=charts.INK, labelsize=8)
