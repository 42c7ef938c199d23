"""A comparison over time: score with its steady and transient parts, visible pixels, and each band."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.reports.charts import BLUE, GREY, INK, VERMILION, Figure, frame_edges, legend, new_figure, save

__all__ = ["plot_comparison", "time_figure"]

LEAST_TOP_JND = 1.25  # of the axis: the line at 1 JND is always on it
LEAST_TOP_PERCENT = 1.0
MOST_MARKED = 40  # frames; longer sequences are plain lines
PARTS = (
    ("score_jnd", INK, "-", "score", 2.0),
    ("steady_jnd", BLUE, "--", "steady part", 1.4),
    ("transient_jnd", VERMILION, "-.", "transient part", 1.4),
)


def plot_comparison(found: Mapping[str, Any], file: Path) -> Path:
    """Draw a comparison into a PNG file.

    Parameters
    ----------
    found
        ``SequenceDifference.to_dict()``.
    file

    Raises
    ------
    RunFolderError
        The file can't be written.
    """
    return save(time_figure(found), file)


def time_figure(found: Mapping[str, Any]) -> Figure:
    """Score, visible pixels and bands over the frames, on a shared axis.

    Parameters
    ----------
    found
        ``SequenceDifference.to_dict()``.
    """
    rows = found["per_frame"]
    width, height = found["size"]
    title = (
        f"{found['score_jnd']:.2f} JND ({found['meaning']})\n{len(rows)} frames, {width}x{height}, "
        f"{found['fps']:g} fps, {found['pixels_per_degree']:.1f} pixels per degree, mode {found['mode']}"
    )
    headings = [
        "score of each frame",
        "pixels above 1 JND",
        "each band of spatial frequencies, pixel by pixel",
    ]
    figure, axes = new_figure(title, headings)
    frames = [int(row["number"]) for row in rows]
    _draw_score(axes[0], frames, rows, found["score_jnd"])
    _draw_percent(axes[1], frames, rows)
    _draw_bands(figure, axes[2], frames, rows, found["bands_cpd"])
    return figure


def _draw_score(ax: Any, frames: list[int], rows: list[Mapping[str, Any]], score: float) -> None:
    marker = "o" if len(frames) < MOST_MARKED else ""
    parts = PARTS if any(row["transient_jnd"] for row in rows) else PARTS[:1]
    for key, color, line, label, width in parts:
        values = [row[key] for row in rows]
        ax.plot(frames, values, line, marker=marker, markersize=3, color=color, linewidth=width, label=label)
    ax.axhline(score, color=INK, linestyle=":", linewidth=1.0, label=f"sequence {score:.2f}")
    ax.axhline(1.0, color=GREY, linewidth=1.0, zorder=1, label="1 JND: found in 3 of 4 cases")
    ax.set_ylabel("JND")
    ax.set_ylim(0.0, 1.08 * max(LEAST_TOP_JND, *(row["score_jnd"] for row in rows)))
    legend(ax, columns=5)


def _draw_percent(ax: Any, frames: list[int], rows: list[Mapping[str, Any]]) -> None:
    values = [row["percent_visible"] for row in rows]
    ax.stairs(values, frame_edges(frames), fill=True, color=BLUE, alpha=0.35, linewidth=0.0)
    mean = sum(values) / len(values)
    ax.axhline(mean, color=INK, linestyle="--", linewidth=1.0, label=f"mean {mean:.1f} %")
    ax.set_ylabel("% of pixels")
    ax.set_ylim(0.0, min(1.1 * max(LEAST_TOP_PERCENT, *values), 100.0))
    legend(ax)


def _draw_bands(
    figure: Figure, ax: Any, frames: list[int], rows: list[Mapping[str, Any]], bands: list[list[float]]
) -> None:
    parts = [np.array([row[key] for row in rows]).T for key in ("steady_bands_jnd", "transient_bands_jnd")]
    power = np.maximum(*parts)
    rungs = np.arange(len(bands) + 1) - 0.5
    top = float(power.max()) or 1.0  # where nothing differs, any
    mesh = ax.pcolormesh(frame_edges(frames), rungs, power, cmap="cividis", vmin=0.0, vmax=top)
    ax.set_yticks(range(len(bands)), [_name(band) for band in bands])
    ax.invert_yaxis()
    ax.grid(visible=False)
    ax.set_ylabel("cycles per degree")
    bar = figure.colorbar(mesh, ax=ax, pad=0.01, aspect=14)
    bar.set_label("JND, the larger of\nsteady and transient", fontsize=8, color=INK)
    bar.ax.tick_params(colors=INK, labelsize=8)


def _name(band: list[float]) -> str:
    low, high = band
    return f"below {high:.2g}" if low == 0.0 else f"{low:.2g} to {high:.2g}"
