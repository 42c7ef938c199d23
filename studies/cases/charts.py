"""Figures of the case studies: the paper's Figs. 9 and 11 to 13."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from enfilade.reports.charts import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    VERMILION,
    Figure,
    Panel,
    Series,
    draw,
    legend,
    new_figure,
    save,
    style_axes,
)

DPI = 110
COLORS = (BLUE, VERMILION, GREEN, ORANGE, "#56B4E9", "#CC79A7", "#000000", "#999999")
MARKS = ("o", "s", "^", "D", "v", "X", "P", "*")
TRACED = {"slow": BLUE, "specular": ORANGE, "disoccluded": GREEN, "keyframe": GREY}
Values = Mapping[str, Any]


def draw_placement(results: Values, file: Path) -> Path:
    """Fig. 11: disoccluded pixels over the frames, and their mean by A; a row for each scene."""
    figure, axes = _grid(len(results), 2, (5.6, 2.7), ratios=(2.2, 1.0))
    for (left, right), (scene, result) in zip(axes, results.items(), strict=True):
        by_a = {row["adaptation"]: row for row in result["placements"]}
        for a, name, line, color in ((0.0, "uniform", "--", VERMILION), (0.5, "Eq. 6, A = 0.5", "-", BLUE)):
            points = sorted(zip(by_a[a]["frames"], by_a[a]["percent"], strict=True))
            label = f"{name}: mean {by_a[a]['mean']:.2f} %"
            left.plot(*zip(*points, strict=True), line, label=label, color=color, linewidth=1.3)
        _titled(left, f"{scene}: neither keyframe shows the surface", "frame", "pixels, %")
        adapted = {a: row["mean"] for a, row in by_a.items() if a is not None}
        right.plot(list(adapted), list(adapted.values()), "o-", color=BLUE, label="Eq. 6")
        right.axhline(by_a[None]["mean"], color=GREEN, linestyle=":", label="equal flow")
        _titled(right, "mean over all frames", "A", "pixels, %")
        for ax in (left, right):
            ax.set_ylim(0.0, 1.08 * ax.dataLim.y1)  # markers stay within
            ax.legend(fontsize=8, frameon=False)
    return save(figure, file)


def draw_walk(result: Values, scene: str, file: Path) -> Path:
    """Figs. 12 and 13: velocity, predictions with noise and without, and traced pixels, over the frames."""
    rows, limit = result["per_frame"], result["split_percent"]
    panels = ("mean image velocity", "predictions", "predictions without noise", "pixels traced, by reason")
    figure, axes = new_figure(scene, panels)
    velocity = {row["frame"]: row["velocity_deg_s"] for row in rows}
    keyframes = {row["frame"]: velocity[row["frame"]] for row in rows if row["keyframe"]}
    curves = (
        Series("mean over the image", BLUE, velocity),
        Series("keyframes", VERMILION, keyframes, mark="triangle"),
    )
    bars = tuple(
        Series(name, color, {row["frame"]: row[name] for row in rows}, mark="bar")
        for name, color in TRACED.items()
    )
    draw(axes[0], Panel("velocity", panels[0], "deg/s", "", curves, 1.1 * max(velocity.values())))
    top = 1.1 * max(sum(row[name] for name in TRACED) for row in rows)
    draw(axes[3], Panel("traced", panels[3], "%", "", bars, top))
    axes[0].set_ylabel("velocity, deg/s")
    for ax, segments in zip(axes[1:3], (result["segments"], result["plain_segments"]), strict=True):
        _predictions(ax, segments, limit)
    axes[3].set_ylabel("traced, % of pixels")
    for ax in axes:
        ax.set_ylim(bottom=0.0)
        legend(ax)
    return save(figure, file)


def _predictions(ax: Any, segments: Sequence[Values], limit: float) -> None:
    """Predictions before and after splitting, with pursuit and without."""
    compared = [s for s in segments if None not in (s["middle"], s["percent_visible"])]
    before = [s for s in compared if s["depth"] == 0]
    after = [s for s in compared if not s["is_split"]]
    for key, eye, color, line in (
        ("percent_visible", "pursuit", VERMILION, "-"),
        ("percent_visible_no_pursuit", "no pursuit", BLUE, "--"),
    ):
        for chosen, when, mark, face in (
            (before, "before", "s", "white"),
            (after, "after splitting", "o", color),
        ):
            points = sorted((s["middle"], s[key]) for s in chosen)
            if points:
                style = {"color": color, "markerfacecolor": face, "linewidth": 0.8, "markersize": 4}
                ax.plot(*zip(*points, strict=True), line, marker=mark, label=f"{eye}, {when}", **style)
    ax.axhline(limit, color=INK, linestyle=":", linewidth=1.1, label=f"split above {limit:g} %")
    ax.set_ylabel("visible, % of pixels")


def draw_threshold(results: Values, file: Path) -> Path:
    """Fig. 9: visible differences of reused pixels by threshold, and by their velocity.

    ``results`` are those of ``threshold.calibrate`` by name in the legend.
    """
    figure, axes = _grid(1, 2, (5.4, 3.4))
    left, right = axes[0]
    for (name, result), color, mark in zip(results.items(), COLORS, MARKS, strict=False):
        curve = [row for row in result["curve"] if row["reused_visible_percent"] is not None]
        x, y = ([row[key] for row in curve] for key in ("threshold_deg_s", "reused_visible_percent"))
        style = {"color": color, "marker": mark, "markersize": 4, "linewidth": 1.2}
        left.plot(x, y, label=name, **style)
        classes = result["by_velocity"]
        middles = [
            1.25 * row["from_deg_s"]
            if row["to_deg_s"] is None
            else 0.5 * (row["from_deg_s"] + row["to_deg_s"])
            for row in classes
        ]
        right.plot(middles, [row["visible_percent"] for row in classes], **style)
    tolerated = next(iter(results.values()))["tolerated_percent"]
    left.axhline(tolerated, color=INK, linestyle=":", linewidth=1.1)
    for ax in (left, right):
        ax.axvline(0.5, color=INK, linestyle="--", linewidth=0.9)
        ax.set_xscale("symlog", linthresh=0.1)
        ax.set_yscale("symlog", linthresh=1.0)
        ax.set_ylim(bottom=0.0)
        ax.set_xlim(left=0.0)
        ax.set_xticks([0.0, 0.1, 0.5, 1.0, 5.0, 20.0], ["0", "0.1", "0.5", "1", "5", "20"])
        ax.set_yticks([0.0, 0.5, 1.0, 3.0, 10.0, 30.0, 100.0], ["0", "0.5", "1", "3", "10", "30", "100"])
    figure.legend(loc="outside lower center", fontsize=8.5, frameon=False, ncols=4)
    _titled(left, "I_c against I_rt, reused pixels", "v_t, deg/s", "above 1 JND, %")
    _titled(right, "I_ibr against I_rt, by velocity", "velocity, deg/s", "above 1 JND, %")
    return save(figure, file)


def velocity_class(row: Values) -> str:
    """Name of a class of velocity by its ends."""
    end = "on" if row["to_deg_s"] is None else f"to {row['to_deg_s']:g}"
    return f"{row['from_deg_s']:g} {end}"


def _grid(
    rows: int, columns: int, panel_in: tuple[float, float], ratios: tuple[float, ...] | None = None
) -> tuple[Figure, Any]:
    size = panel_in[0] * columns, panel_in[1] * rows + 0.2
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, width_ratios=ratios)
    for ax in axes.ravel():
        style_axes(ax, text_pt=8.5, grid="y")
    return figure, axes


def _titled(ax: Any, title: str, x: str, y: str) -> None:
    ax.set_title(title, loc="left", fontsize=9.5, color=INK)
    ax.set_xlabel(x, fontsize=9, color=INK)
    ax.set_ylabel(y, fontsize=9, color=INK)
