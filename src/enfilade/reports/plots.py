"""Plots of a run: velocity, predictions of the metric, and traced pixels over the frames (Figs. 12, 13)."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from enfilade.errors import RunFolderError
from enfilade.reports.charts import (
    BLUE,
    INK,
    SOURCE_COLORS,
    VERMILION,
    Figure,
    legend,
    mark_keyframes,
    new_figure,
    save,
    stack,
)

SPLIT_PERCENT = 10.0  # §4.3, where a summary does not name its own threshold


def plot_run(folder: Path) -> list[Path]:
    """Draw a finished run into its folder ``plots``.

    Parameters
    ----------
    folder
        A run folder with a ``summary.json``.

    Returns
    -------
    list of Path
        The PNG files.

    Raises
    ------
    RunFolderError
        There is no readable summary.
    """
    file = folder / "summary.json"
    try:
        summary = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RunFolderError(f"{file} can't be read as the summary of a run: {error}") from error
    return [save(walkthrough_figure(summary), folder / "plots" / "walkthrough.png")]


def plot_plan(plan: Mapping[str, Any], file: Path) -> Path:
    """Draw a plan into a PNG file.

    Parameters
    ----------
    plan
        ``Plan.to_dict()``.
    file
    """
    return save(plan_figure(plan), file)


def walkthrough_figure(summary: Mapping[str, Any]) -> Figure:
    """Mean velocity, AQM predictions and traced pixels by reason, over the frames (Figs. 12, 13).

    A run without segments (``--method reference``) has no panel for the predictions.
    """
    rows = summary["per_frame"]
    segments = summary.get("segments") or []
    panels = ["mean image velocity"]
    panels += ["predictions of the metric"] if segments else []
    width, height = summary["size"]
    rays = summary.get("rays", {})  # the paper's method has none
    effort = f"{sum(rays.values()):.1f} rays a pixel" if rays else f"{summary['spp']} spp"
    title = f"method {summary['method']}, {len(rows)} frames, {width}x{height}, {effort}"
    figure, axes = new_figure(
        title, [*panels, "rays sent, by purpose" if rays else "pixels traced, by reason"]
    )

    frames = [int(row["frame"]) for row in rows]
    keyframes = [int(row["frame"]) for row in rows if row["keyframe"]]
    velocity = [float(row["velocity_deg_s"]) for row in rows]
    # Where every frame is traced whole there is nothing to mark.
    _draw_velocity(axes[0], frames, velocity, keyframes if len(keyframes) < len(frames) else [])
    if segments:
        _draw_predictions(axes[1], segments, float(summary.get("split_percent", SPLIT_PERCENT)))
    if rays:
        _draw_rays(axes[-1], summary["rays_per_frame"], rays)
    else:
        _draw_traced(axes[-1], frames, rows, float(summary["table1"]["total"]))
    return figure


def plan_figure(plan: Mapping[str, Any]) -> Figure:
    """Mean velocity with the initial keyframes, and the expected shares of traced pixels, over the frames."""
    frames = [int(f) for f in plan["frames"]]
    headings = ["mean image velocity and initial keyframes", "pixels expected to be slow, specular or holes"]
    figure, (top, bottom) = new_figure(f"plan, {len(frames)} frames", headings)
    _draw_velocity(top, frames, plan["mean_speed_deg_s"], plan["keyframes"])
    shares = {"slow": "slow_percent", "specular": "specular_percent"}
    for name, key in shares.items():
        line = {"slow": "-", "specular": "--"}[name]
        bottom.plot(frames, plan[key], line, color=SOURCE_COLORS[name], linewidth=1.5, label=name)
    holes = [(f, h) for f, h in zip(frames, plan["hole_percent"], strict=True) if h is not None]
    if holes:
        line = "-." if len(holes) == len(frames) else "D"
        style = {"color": SOURCE_COLORS["hole"], "linewidth": 1.5, "markersize": 4}
        bottom.plot(*zip(*holes, strict=True), line, label="holes (estimate)", **style)
    bottom.set_ylabel("pixels, %")
    bottom.set_ylim(bottom=0.0)
    legend(bottom)
    return figure


def _draw_velocity(
    ax: Any, frames: Sequence[int], velocity: Sequence[float], keyframes: Sequence[int]
) -> None:
    ax.plot(frames, velocity, color=BLUE, linewidth=1.5, label="mean over the image")
    if keyframes:
        mark_keyframes(ax, frames, velocity, keyframes)
    ax.set_ylabel("velocity, deg/s")
    ax.set_ylim(0.0, 1.08 * max(*velocity, 0.1))
    legend(ax)


def _draw_predictions(ax: Any, segments: Sequence[Mapping[str, Any]], threshold: float) -> None:
    judged = [s for s in segments if s["middle"] is not None]  # others have nothing between their keyframes
    before = [s for s in judged if s["depth"] == 0]
    after = [s for s in judged if not s["is_split"]]
    for key, eye, color, line in (
        ("percent_visible", "pursuit", VERMILION, "-"),
        ("percent_visible_no_pursuit", "no pursuit", BLUE, "--"),
    ):
        for chosen, when, face in ((before, "before", "white"), (after, "after splitting", color)):
            points = sorted((int(s["middle"]), float(s[key])) for s in chosen if _is_known(s.get(key)))
            if points:
                x, y = zip(*points, strict=True)
                style = {"color": color, "markerfacecolor": face, "linewidth": 0.9, "markersize": 5}
                label = f"{eye}, {when}"
                ax.plot(x, y, line, marker="s" if face == "white" else "o", label=label, **style)
    ax.axhline(threshold, color=INK, linestyle=":", linewidth=1.2, label=f"split above {threshold:g} %")
    ax.set_ylabel("visible, % of pixels")
    ax.set_ylim(0.0, max(ax.get_ylim()[1], 1.2 * threshold))
    legend(ax, columns=5)


def _draw_traced(ax: Any, frames: Sequence[int], rows: Sequence[Mapping[str, Any]], mean: float) -> None:
    names = {"slow": "slow", "specular": "specular", "hole": "holes", "keyframe": "keyframes"}
    shares: dict[str, tuple[str, Sequence[float]]] = {
        name: (SOURCE_COLORS[key], [float(row[key]) for row in rows]) for key, name in names.items()
    }
    stack(ax, frames, shares)
    ax.axhline(mean, color=INK, linestyle="--", linewidth=1.0, label=f"mean {mean:.1f} %")
    ax.set_ylabel("traced, % of pixels")
    ax.set_ylim(0.0, 100.0)
    legend(ax, columns=5)


def _draw_rays(ax: Any, rows: Sequence[Mapping[str, Any]], mean: Mapping[str, float]) -> None:
    names = {"camera": "slow", "lobes": "specular", "light": "keyframe", "drafts": "hole"}  # in these colours
    counts: dict[str, tuple[str, Sequence[float]]] = {
        kind: (SOURCE_COLORS[like], [float(row[kind]) for row in rows]) for kind, like in names.items()
    }
    stack(ax, [row["frame"] for row in rows], counts)
    total = sum(mean.values())
    ax.axhline(total, color=INK, linestyle="--", linewidth=1.0, label=f"mean {total:.1f}")
    ax.set_ylabel("rays per pixel")
    legend(ax, columns=5)


def _is_known(value: object) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)
