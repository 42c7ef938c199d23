"""Figures of the case studies: the paper's Figs. 11 to 13, its Table 2, and the choices of its §5."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.reports.charts import BLUE, GREEN, INK, ORANGE, PROVENANCE_COLORS, VERMILION, Figure, save

__all__ = [
    "draw_placement",
    "draw_predictions",
    "draw_supports",
    "draw_threshold",
    "draw_times",
]

DPI = 110
COLORS = (BLUE, VERMILION, GREEN, ORANGE, "#56B4E9", "#CC79A7", "#000000", "#999999")
MARKS = ("o", "s", "^", "D", "v", "X", "P", "*")
WAYS = {"art": "ART", "rt": "RT", "ibr_rt": "IBR+RT (paper)", "decoupled": "decoupled"}
STAGE_COLORS = {
    "trace": PROVENANCE_COLORS["keyframe"],
    "warp": GREEN,
    "antialias": BLUE,
    "metric": VERMILION,
    "geometry": ORANGE,
    "files": "#56B4E9",
    "video": "#CC79A7",
    "gather": "#882255",
    "scatter": "#332288",
    "scout": "#999933",
}
Scenes = Mapping[str, Any]


def draw_placement(found: Scenes, file: Path) -> Path:
    """Fig. 11: pixels to be recomputed over the frames, and their mean by A; a row for each scene."""
    figure, axes = _grid(len(found), 2, (5.6, 2.7), ratios=(2.2, 1.0))
    for (left, right), (scene, of) in zip(axes, found.items(), strict=True):
        rows = of["placements"]
        for row in rows:
            if row["adaptation"] in (0.0, 0.5):
                is_plain = row["adaptation"] == 0.0
                name = "uniform" if is_plain else "Eq. 6, A = 0.5"
                style = {"color": VERMILION if is_plain else BLUE, "linewidth": 1.3}
                points = sorted(zip(row["frames"], row["percent"], strict=True))
                label = f"{name}: mean {row['mean']:.2f} %"
                left.plot(*zip(*points, strict=True), "--" if is_plain else "-", label=label, **style)
        _titled(left, f"{scene}: neither keyframe sees the surface", "frame", "pixels, %")
        left.set_ylim(bottom=0.0)
        left.legend(fontsize=8, frameon=False)
        adapted = [row for row in rows if row["adaptation"] is not None]
        right.plot(
            [r["adaptation"] for r in adapted],
            [r["mean"] for r in adapted],
            "o-",
            color=BLUE,
            label="Eq. 6",
        )
        even = next(row for row in rows if row["adaptation"] is None)
        right.axhline(even["mean"], color=GREEN, linestyle=":", label="equal flow")
        _titled(right, "mean over all frames", "A", "pixels, %")
        right.set_ylim(0.0, 1.1 * max(row["mean"] for row in rows))
        right.legend(fontsize=8, frameon=False)
    return save(figure, file)


def draw_predictions(found: Scenes, file: Path) -> Path:
    """Figs. 12b and 13b: predictions before and after splitting; with the noise of the paths, and without."""
    figure, axes = _grid(len(found), 2, (5.6, 2.8))
    for row, (scene, of) in zip(axes, found.items(), strict=True):
        limit = of["summary"]["split_percent"]
        sets = (
            (of["summary"]["segments"], f"{of['summary']['spp']} paths"),
            (of["plain_segments"], "no noise"),
        )
        for ax, (segments, how) in zip(row, sets, strict=True):
            _predictions(ax, segments, limit)
            _titled(ax, f"{scene}, {how}", "frame", "visible, % of pixels")
    axes[0][0].legend(fontsize=7.5, frameon=False, loc="upper left")
    return save(figure, file)


def _predictions(ax: Any, segments: Sequence[Mapping[str, Any]], limit: float) -> None:
    judged = [s for s in segments if s["middle"] is not None]
    before = [s for s in judged if s["depth"] == 0]
    after = [s for s in judged if not s["is_split"]]
    for key, eye, color, line in (
        ("percent_visible", "pursuit", VERMILION, "-"),
        ("percent_visible_no_pursuit", "no pursuit", BLUE, "--"),
    ):
        for chosen, when, face in ((before, "before", "white"), (after, "after splitting", color)):
            points = sorted((s["middle"], s[key]) for s in chosen)
            if points:
                style = {"color": color, "markerfacecolor": face, "linewidth": 0.8, "markersize": 4}
                mark = "s" if face == "white" else "o"
                ax.plot(*zip(*points, strict=True), line, marker=mark, label=f"{eye}, {when}", **style)
    ax.axhline(limit, color=INK, linestyle=":", linewidth=1.1, label=f"split above {limit:g} %")
    ax.set_ylim(0.0, max(ax.get_ylim()[1], 1.2 * limit))


def draw_times(found: Scenes, file: Path) -> Path:
    """Table 2: CPU time of a frame and what it is spent on, each in its own hours; error over its worth."""
    figure, axes = _grid(len(found), 2, (5.6, 2.7), ratios=(1.3, 1.0))
    for (left, right), (scene, of) in zip(axes, found.items(), strict=True):
        shown = [way for way in WAYS if way != "art"]
        for place, way in enumerate(shown):
            _bar(left, place, of["ways"][way])
            total = of["ways"][way]["cpu_s"]
            left.text(total, place, f" {total:.2f} s", va="center", fontsize=8.5, color=INK)
        left.set_yticks(range(len(shown)), [WAYS[way] for way in shown])
        left.invert_yaxis()
        left.margins(x=0.16)
        _titled(left, f"{scene}: a frame", "CPU time, s", "")
        left.grid(axis="x", color="#DDDDDD", linewidth=0.6)
        _error_over_time(right, of)
        _titled(right, "error against the reference", "CPU time of a frame, in paths a pixel", "JND")
    handles, labels = _by_label(axes[:, 0])
    figure.legend(handles, labels, loc="outside lower left", fontsize=8, frameon=False, ncols=len(labels))
    axes[0][1].legend(fontsize=7.5, frameon=False)
    return save(figure, file)


def _error_over_time(ax: Any, of: Mapping[str, Any]) -> None:
    cost = [row["spp"] for row in of["art_series"]]
    error = [_mean_score(row) for row in of["art_series"]]
    ax.plot(cost, error, "o--", color="#7A7A7A", markersize=4, label="ART, 4 paths and more")
    for way, color, mark in (("ibr_rt", GREEN, "^"), ("decoupled", BLUE, "D")):
        one = of["ways"][way]
        ax.plot([one["worth_paths"]], [_mean_score(one)], mark, color=color, markersize=8, label=WAYS[way])
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_yticks([5, 10, 20, 50], ["5", "10", "20", "50"])
    ax.minorticks_off()
    ax.set_xlim(left=0.5 * min(*cost, *(of["ways"][w]["worth_paths"] for w in ("ibr_rt", "decoupled"))))


def _mean_score(row: Mapping[str, Any]) -> float:
    return float(np.mean([said["score"] for said in row["frames"]]))


def _bar(ax: Any, place: int, way: Mapping[str, Any]) -> None:
    stages = way.get("stages") or {"trace": {"cpu_s": way["cpu_s"]}}
    left = 0.0
    for name in [*STAGE_COLORS, "others"]:
        known = name in STAGE_COLORS
        spent = sum(
            of["cpu_s"] for s, of in stages.items() if s == name or (not known and s not in STAGE_COLORS)
        )
        if spent > 0.0:
            color = STAGE_COLORS.get(name, "#555555")
            ax.barh(place, spent, left=left, height=0.62, color=color, label=name)
            left += spent


def _by_label(axes: Any) -> tuple[list[Any], list[str]]:
    found: dict[str, Any] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    return list(found.values()), list(found)


def draw_threshold(found: Scenes, file: Path) -> Path:
    """Fig. 9's outcome: visible differences of reused pixels by threshold, and by their velocity.

    Parameters
    ----------
    found
        By a name for the legend: what ``threshold.calibrate`` returns.
    file
    """
    figure, axes = _grid(1, 2, (5.4, 3.4))
    left, right = axes[0]
    for (name, of), color, mark in zip(found.items(), COLORS, MARKS, strict=False):
        curve = [row for row in of["curve"] if row["reused_visible_percent"] is not None]
        x, y = ([row[key] for row in curve] for key in ("threshold_deg_s", "reused_visible_percent"))
        style = {"color": color, "marker": mark, "markersize": 4, "linewidth": 1.2}
        left.plot(x, y, label=name, **style)
        classes = of["by_velocity"]
        middle = [_middle(row) for row in classes]
        right.plot(middle, [row["visible_percent"] for row in classes], **style)
    tolerated = next(iter(found.values()))["tolerated_percent"]
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
    _titled(left, "I_c against I_rt, pixels that are reused", "v_t, deg/s", "above 1 JND, %")
    _titled(right, "I_ibr against I_rt, by velocity", "velocity, deg/s", "above 1 JND, %")
    return save(figure, file)


def _middle(row: Mapping[str, Any]) -> float:
    ends = row["from_deg_s"], row["to_deg_s"]
    return float(1.25 * ends[0] if ends[1] is None else 0.5 * (ends[0] + ends[1]))


def draw_supports(found: Scenes, file: Path) -> Path:
    """Scores by spatial support, at the paper's 11 frames, and by temporal support, at 3 pixels, by velocity.

    Parameters
    ----------
    found
        By a name for the title: what ``supports.measure`` returns.
    file
    """
    figure, axes = _grid(len(found), 2, (5.4, 2.9))
    for row, (name, of) in zip(axes, found.items(), strict=True):
        widths, counts = of["spatial_px"], of["temporal"]
        for k, velocity in enumerate(of["classes"]):
            scores = np.array(velocity["scores"]["paper"])
            label = _class_name(velocity)
            style = {"color": COLORS[k % 8], "marker": MARKS[k % 8], "markersize": 4, "linewidth": 1.1}
            row[0].plot(widths, scores[:, counts.index(11)], label=label, **style)
            row[1].plot(counts, scores[widths.index(3.0)], **style)
        _titled(row[0], f"{name}: 11 frames", "spatial support, pixels", "score, JND")
        _titled(row[1], f"{name}: 3 pixels", "temporal support, frames", "score, JND")
        for ax, ticks in zip(row, (widths, counts), strict=True):
            ax.set_yscale("log")
            ax.set_xticks(ticks)
            ax.set_yticks([2, 3, 5, 10, 20, 30], ["2", "3", "5", "10", "20", "30"])
            ax.minorticks_off()
        row[0].legend(fontsize=7, frameon=False, ncols=2, title="deg/s", title_fontsize=7)
    return save(figure, file)


def _class_name(row: Mapping[str, Any]) -> str:
    return (
        f"{row['from_deg_s']:g} on"
        if row["to_deg_s"] is None
        else f"{row['from_deg_s']:g} to {row['to_deg_s']:g}"
    )


def _grid(
    rows: int, columns: int, panel_in: tuple[float, float], ratios: tuple[float, ...] | None = None
) -> tuple[Figure, Any]:
    size = panel_in[0] * columns, panel_in[1] * rows + 0.2
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, width_ratios=ratios)
    for ax in axes.ravel():
        ax.grid(axis="y", color="#E4E4E4", linewidth=0.6)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
        ax.tick_params(colors=INK, labelsize=8.5)
    return figure, axes


def _titled(ax: Any, title: str, x: str, y: str) -> None:
    ax.set_title(title, loc="left", fontsize=9.5, color=INK)
    ax.set_xlabel(x, fontsize=9, color=INK)
    ax.set_ylabel(y, fontsize=9, color=INK)
