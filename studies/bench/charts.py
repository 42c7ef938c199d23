"""Charts of benches: quality over CPU time, with the baselines' Pareto front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from enfilade.reports.charts import BLUE, GREEN, INK, ORANGE, Figure, save, style_axes
from studies.bench.configurations import BASELINES
from studies.bench.measures import LEAST_ERROR, QUALITIES
from studies.bench.ratios import Point, front

DPI = 130
PANEL_IN = (4.4, 3.3)
PAGE_MEASURES = ("cvvdp", "psnr", "flip", "flicker")  # of the page of many scenes
COLUMNS = 3  # of the chart of one scene
STYLES: dict[str, dict[str, Any]] = {  # by family; they differ in marker, too
    "traced": {"color": "#7A7A7A", "marker": "o", "label": "path tracing"},
    "denoised": {"color": ORANGE, "marker": "s", "label": "path tracing, Open Image Denoise"},
    "paper": {"color": GREEN, "marker": "^", "label": "enfilade, paper (2000)"},
    "decoupled": {"color": BLUE, "marker": "D", "label": "enfilade, decoupled"},
}
FLOOR = "#7A7A7A"


def plot_bench(found: Mapping[str, Any], file: Path) -> Path:
    """Draw a panel for each measure of ``bench.json``, CPU time to the right, quality upwards, as PNG."""
    names, machine = list(found["measures"]), found["machine"]
    columns = min(COLUMNS, len(names))
    rows = -(-len(names) // columns)
    figure = Figure(figsize=(PANEL_IN[0] * columns, PANEL_IN[1] * rows + 0.9), dpi=DPI, layout="constrained")
    figure.suptitle(
        f"{_title(found)}; {machine['processor']}, cores: {machine['cores']}; {found['date']}",
        fontsize=11,
        color=INK,
    )
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax, name in zip(axes, names, strict=False):
        _panel(ax, found, name)
        ax.set_title(f"{QUALITIES[name].title}, {QUALITIES[name].unit}", loc="left", fontsize=11, color=INK)
    for ax in axes[len(names) :]:
        ax.set_visible(False)
    _legend(figure, axes[0])
    return save(figure, file)


def plot_page(benches: Sequence[Mapping[str, Any]], file: Path) -> Path:
    """Draw a row of panels for each bench, a column for each of the chief measures, as PNG."""
    names = [name for name in PAGE_MEASURES if all(name in found["measures"] for found in benches)]
    size = (PANEL_IN[0] * len(names), PANEL_IN[1] * len(benches) + 0.6)
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    axes = figure.subplots(len(benches), len(names), squeeze=False)
    for row, found in zip(axes, benches, strict=True):
        for ax, name in zip(row, names, strict=True):
            _panel(ax, found, name)
            ax.set_title(
                f"{QUALITIES[name].title}, {QUALITIES[name].unit}", loc="left", fontsize=9, color=INK
            )
        first = f"{QUALITIES[names[0]].title}, {QUALITIES[names[0]].unit}"
        row[0].set_title(f"{_title(found)}\n{first}", loc="left", fontsize=9, color=INK)
    _legend(figure, axes[0, 0])
    return save(figure, file)


def _title(found: Mapping[str, Any]) -> str:
    size = "x".join(map(str, found["size"]))
    paths = found["reference"]["spp"]
    frames = f"{len(found['frames'])} of {found['walkthrough_frames']} frames"
    return f"{found['scene']}, {frames} of {size}, reference {paths} paths"


def _legend(figure: Any, ax: Any) -> None:
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=9.5, frameon=False)


def _panel(ax: Any, found: Mapping[str, Any], name: str) -> None:
    quality, frames = QUALITIES[name], found["walkthrough_frames"]
    sign = -1.0 if quality.is_more_better else 1.0

    def place(row: Mapping[str, Any]) -> Point:
        return Point(row["cost"]["cpu_s"] / frames, sign * quality.score(row["values"][name]))

    rows = [row for row in found["configurations"] if quality.error(row["values"][name]) > LEAST_ERROR]
    best = front([place(row) for row in rows if row["family"] in BASELINES])
    ax.plot(
        [p.cpu_s for p in best], [sign * p.error for p in best],
        color=ORANGE, linewidth=1.8, label="baselines' Pareto front", zorder=2,
    )  # fmt: skip
    for family, style in STYLES.items():
        members = [(place(row), row) for row in rows if row["family"] == family]
        if not members:
            continue
        line = "-" if family == "decoupled" else "none"
        points = (
            sorted(point.cpu_s for point, _ in members),
            [sign * p.error for p, _ in sorted(members, key=lambda m: m[0].cpu_s)],
        )
        ax.plot(*points, **style, linestyle=line, markersize=6, markeredgecolor="white", zorder=4)
        for point, row in members:
            label = row["name"].removeprefix("denoised-").removeprefix("decoupled-").removeprefix("traced-")
            ax.annotate(
                label, (point.cpu_s, sign * point.error), color=style["color"], fontsize=5.5,
                xytext=(3, 3), textcoords="offset points", zorder=5,
            )  # fmt: skip
    if (floor := found["reference"]["noise_floor"].get(name)) is not None:
        ax.axhline(quality.score(floor), color=FLOOR, linewidth=1.0, linestyle=(0, (1, 3)), zorder=1)
    _axes(ax, is_more_better=quality.is_more_better)


def _axes(ax: Any, *, is_more_better: bool) -> None:
    ax.set_xscale("log")
    scales: list[tuple[Any, tuple[float, ...]]] = [(ax.xaxis, (1.0, 2.0, 5.0))]
    if not is_more_better:
        ax.set_yscale("log")
        ax.invert_yaxis()
        scales.append((ax.yaxis, (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
    for axis, ticks in scales:
        axis.set_major_locator(LogLocator(subs=ticks))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_locator(NullLocator())
    ax.set_title("better ↑", loc="right", fontsize=8, color=INK)
    ax.set_xlabel("CPU s a frame", fontsize=8, color=INK)
    style_axes(ax, text_pt=8)
    ax.margins(x=0.1, y=0.12)
