"""The chart of a bench: quality over CPU time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from enfilade.reports.charts import BLUE, GREEN, INK, ORANGE, VERMILION, Figure, save

__all__ = ["STYLES", "plot_bench"]

DPI = 130
PANEL_IN = (5.6, 4.1)
GREY = "#7A7A7A"
STYLES: dict[str, dict[str, Any]] = {  # by family: told apart by marker and line as well as by colour
    "traced": {"color": GREY, "marker": "o", "linestyle": "--", "label": "path tracing every frame"},
    "denoised": {
        "color": ORANGE,
        "marker": "s",
        "linestyle": "-.",
        "label": "path tracing + Open Image Denoise",
    },
    "interpolated": {
        "color": VERMILION,
        "marker": "X",
        "linestyle": "none",
        "label": "keyframes + minterpolate",
    },
    "paper": {"color": GREEN, "marker": "^", "linestyle": ":", "label": "enfilade, paper (2000)"},
    "decoupled": {"color": BLUE, "marker": "D", "linestyle": "-", "label": "enfilade, decoupled"},
}
OURS = "decoupled"
BELOW = ("traced", "denoised")  # families whose labels stand below their points, out of the others' way
LABELLED = ("", "high")  # variants that are labelled: the others lie beside them
TICKS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)


def plot_bench(found: Mapping[str, Any], file: Path) -> Path:
    """Draw a panel for each judge, CPU time to the right, quality upwards.

    Parameters
    ----------
    found
        What ``bench.json`` holds.
    file
        Where the PNG goes.
    """
    judges = found["judges"]
    columns = 2 if len(judges) > 1 else 1
    rows = -(-len(judges) // columns)
    figure = Figure(figsize=(PANEL_IN[0] * columns, PANEL_IN[1] * rows + 0.9), dpi=DPI, layout="constrained")
    width, height = found["size"]
    machine, spp = found["machine"], found["reference"]["spp"]
    figure.suptitle(
        f"{found['scene']}, {len(found['frames'])} frames of {width}x{height}\n"
        f"references of {spp} paths a pixel; {machine['processor']}, cores: {machine['cores']}; "
        f"{found['date'][:10]}",
        fontsize=11,
        color=INK,
    )
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax, (judge, of) in zip(axes, judges.items(), strict=False):
        _panel(ax, found, judge, of)
    for ax in axes[len(judges) :]:
        ax.set_visible(False)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=9.5, frameon=False)
    return save(figure, file)


def _panel(ax: Any, found: Mapping[str, Any], judge: str, of: Mapping[str, Any]) -> None:
    ax.set_title(f"{of['title']}, {of['unit']}", loc="left", fontsize=11, color=INK)
    ax.set_title("better ↑", loc="right", fontsize=9, color=INK)
    for family, style in STYLES.items():
        points = [
            (c["cost"]["cpu_s"], c["scores"][judge], c)
            for c in found["contestants"]
            if c["family"] == family and c["scores"][judge] is not None
        ]
        if points:
            _curve(ax, points, family, style, is_more_better=of["is_more_better"])
    floor = found["reference"]["floor"].get(judge)
    if floor is not None:
        ax.axhline(
            floor, color=GREY, linewidth=1.0, linestyle=(0, (1, 3)), label="noise of the reference", zorder=2
        )
    ax.set_xscale("log")
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_locator(NullLocator())
    if not of["is_more_better"]:
        ax.set_yscale("log")
        ax.yaxis.set_major_locator(LogLocator(subs=TICKS))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.yaxis.set_minor_locator(NullLocator())
        ax.invert_yaxis()
    ax.set_xlabel("CPU time of all frames, s", fontsize=9.5, color=INK)
    ax.grid(color="#E4E4E4", linewidth=0.7)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
    ax.tick_params(colors=INK, labelsize=8.5)
    ax.margins(x=0.08, y=0.1)


def _curve(
    ax: Any,
    points: Sequence[tuple[float, float, Any]],
    family: str,
    style: Mapping[str, Any],
    *,
    is_more_better: bool,
) -> None:
    """A curve through the contestants that no cheaper one of the family beats; the others beside it, open."""
    is_ours = family == OURS
    best = _front(points, is_more_better=is_more_better)
    look = {"color": style["color"], "marker": style["marker"], "markersize": 8 if is_ours else 6.5}
    ax.plot(
        [p[0] for p in best],
        [p[1] for p in best],
        **(look | {"linestyle": style["linestyle"], "label": style["label"]}),
        linewidth=2.6 if is_ours else 1.5,
        markeredgecolor="white",
        markeredgewidth=0.8,
        zorder=4 if is_ours else 3,
    )
    for point in points:
        if point not in best:
            ax.plot(*point[:2], **look, linestyle="none", markerfacecolor="white", zorder=3)
        if point[2]["variant"] not in LABELLED:
            continue
        ax.annotate(
            _short(point[2]),
            point[:2],
            xytext=(0, -7 if family in BELOW else 7),
            textcoords="offset points",
            ha="center",
            va="top" if family in BELOW else "bottom",
            fontsize=7,
            color=style["color"],
            zorder=5,
        )


def _front(
    points: Sequence[tuple[float, float, Any]], *, is_more_better: bool
) -> list[tuple[float, float, Any]]:
    kept: list[tuple[float, float, Any]] = []
    for point in sorted(points, key=lambda p: p[0]):
        if not kept or (point[1] > kept[-1][1] if is_more_better else point[1] < kept[-1][1]):
            kept.append(point)
    return kept


def _short(contestant: Mapping[str, Any]) -> str:
    """What tells a point from its neighbours on the curve: paths a pixel, or the end of its name."""
    if contestant["family"] in (OURS, "paper"):
        return str(contestant["name"]).rpartition("-")[2]
    return str(contestant["spp"])
