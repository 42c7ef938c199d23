"""The chart of a bench: quality over CPU time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from enfilade.reports.charts import BLUE, GREEN, INK, ORANGE, VERMILION, Figure, save
from studies.bench.ratios import DECOUPLED, Point, front

DPI = 130
PANEL_IN = (5.6, 4.1)
STYLES: dict[str, dict[str, Any]] = {  # by family; they differ in marker and line, too
    "traced": {"color": "#7A7A7A", "marker": "o", "linestyle": "--", "label": "path tracing"},
    "denoised": {
        "color": ORANGE,
        "marker": "s",
        "linestyle": "-.",
        "label": "path tracing, Open Image Denoise",
    },
    "interpolated": {"color": VERMILION, "marker": "X", "linestyle": "none", "label": "minterpolate"},
    "paper": {"color": GREEN, "marker": "^", "linestyle": ":", "label": "enfilade, paper (2000)"},
    "decoupled": {"color": BLUE, "marker": "D", "linestyle": "-", "label": "enfilade, decoupled"},
}
BELOW = ("traced", "denoised")  # families whose labels are below their points
LABELLED = ("", "high")  # variants with labels; the others are close to them
TICKS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)


def plot_bench(found: Mapping[str, Any], file: Path) -> Path:
    """Draw a panel for each measure of ``bench.json``, CPU time to the right, quality upwards, as PNG."""
    measures, machine = found["measures"], found["machine"]
    columns = 2 if len(measures) > 1 else 1
    rows = -(-len(measures) // columns)
    figure = Figure(figsize=(PANEL_IN[0] * columns, PANEL_IN[1] * rows + 0.9), dpi=DPI, layout="constrained")
    figure.suptitle(
        f"{found['scene']}, {len(found['frames'])} frames of {'x'.join(map(str, found['size']))}\n"
        f"references of {found['reference']['spp']} paths a pixel; {machine['processor']}, "
        f"cores: {machine['cores']}; {found['date']}",
        fontsize=11,
        color=INK,
    )
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax, (name, of) in zip(axes, measures.items(), strict=False):
        _panel(ax, found, name, of)
    for ax in axes[len(measures) :]:
        ax.set_visible(False)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=9.5, frameon=False)
    return save(figure, file)


def _panel(ax: Any, found: Mapping[str, Any], name: str, of: Mapping[str, Any]) -> None:
    ax.set_title(f"{of['title']}, {of['unit']}", loc="left", fontsize=11, color=INK)
    ax.set_title("better ↑", loc="right", fontsize=9, color=INK)
    sign = -1.0 if of["is_more_better"] else 1.0
    for family in STYLES:
        points = {
            c["name"]: (Point(c["cost"]["cpu_s"], sign * c["scores"][name]), c)
            for c in found["configurations"]
            if c["family"] == family and c["scores"][name] is not None
        }
        if points:
            _curve(ax, list(points.values()), family, sign)
    floors = [floor[name] for floor in found["reference"]["noise_floor"].values() if floor.get(name)]
    for label, floor in zip(("noise floor", ""), floors, strict=False):
        dots = (0, (1, 3))
        ax.axhline(floor, color="#7A7A7A", linewidth=1.0, linestyle=dots, label=label or None, zorder=2)
    ax.set_xscale("log")
    scales: list[tuple[Any, tuple[float, ...]]] = [(ax.xaxis, (1.0, 2.0, 5.0))]
    if not of["is_more_better"]:
        ax.set_yscale("log")
        ax.invert_yaxis()
        scales.append((ax.yaxis, TICKS))
    for axis, ticks in scales:
        axis.set_major_locator(LogLocator(subs=ticks))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_locator(NullLocator())
    ax.set_xlabel("CPU time of all frames, s", fontsize=9.5, color=INK)
    ax.grid(color="#E4E4E4", linewidth=0.7)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
    ax.tick_params(colors=INK, labelsize=8.5)
    ax.margins(x=0.08, y=0.1)


def _curve(ax: Any, points: Sequence[tuple[Point, Any]], family: str, sign: float) -> None:
    """Draw a curve through the Pareto front of a family; other configurations are open marks."""
    style, is_decoupled = STYLES[family], family == DECOUPLED
    best = front([point for point, _ in points])
    look = {"color": style["color"], "marker": style["marker"], "markersize": 8 if is_decoupled else 6.5}
    ax.plot(
        [p.cpu_s for p in best],
        [sign * p.error for p in best],
        **(look | {"linestyle": style["linestyle"], "label": style["label"]}),
        linewidth=2.6 if is_decoupled else 1.5,
        markeredgecolor="white",
        markeredgewidth=0.8,
        zorder=4 if is_decoupled else 3,
    )
    is_below = family in BELOW
    for point, of in points:
        position = point.cpu_s, sign * point.error
        if point not in best:
            ax.plot(*position, **look, linestyle="none", markerfacecolor="white", zorder=3)
        if of["variant"] in LABELLED:
            label = of["name"].rpartition("-")[2] if family in (DECOUPLED, "paper") else str(of["spp"])
            text = {"ha": "center", "va": "top" if is_below else "bottom", "fontsize": 7, "zorder": 5}
            offset = {"xytext": (0, -7 if is_below else 7), "textcoords": "offset points"}
            ax.annotate(label, position, color=style["color"], **text, **offset)
