"""Charts over frame numbers, as PNG files and as SVG inside a page.

Colours are those of Okabe and Ito (2008), for readers with colour vision deficiencies; series also differ in
shape, line style or place.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imsave
from matplotlib.ticker import MaxNLocator

from enfilade.files import whole_file

__all__ = [
    "BLUE", "GREEN", "GREY", "INK", "ORANGE", "PALETTE", "PROVENANCE_COLORS", "SKY", "SVG_AXES", "VERMILION",
    "Figure", "Panel", "Series", "draw", "legend", "new_figure", "pixels", "save", "save_picture",
    "style_axes", "svg",
]  # fmt: skip

BLUE, ORANGE, GREEN, VERMILION, SKY, GREY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#56B4E9", "#BBBBBB"
PINK, YELLOW = "#CC79A7", "#F0E442"
PALETTE = (SKY, ORANGE, GREEN, PINK, BLUE, VERMILION, GREY, YELLOW, "#882255", "#999933")
PROVENANCE_COLORS = {"slow": SKY, "specular": ORANGE, "disoccluded": GREEN, "keyframe": PINK}
INK, RULE = "#333333", "#DDDDDD"
THEMED = {INK: "currentColor", RULE: "var(--grid)"}  # colours of the page, light or dark
WIDTH_IN, PANEL_IN = 10.0, 2.7
DPI = 120
SVG_WIDTH, SVG_HEIGHT, SVG_TEXT = 400.0, 118.0, 10.5  # points
SVG_AXES = (0.085, 0.185, 0.9, 0.76)  # left, bottom, width, height, as parts of the chart
MARKS: dict[str, dict[str, Any]] = {
    "line": {"linewidth": 1.5},
    "dashed": {"linewidth": 1.5, "linestyle": "--"},
    "triangle": {
        "linestyle": "none", "marker": "v", "markersize": 6, "markeredgecolor": "white",
        "markeredgewidth": 0.5, "clip_on": False, "zorder": 3,
    },
    "square": {"linewidth": 0.9, "marker": "s", "markersize": 5, "markerfacecolor": "none", "clip_on": False},
    "circle": {"linewidth": 0.9, "marker": "o", "markersize": 4, "clip_on": False},
}  # fmt: skip


@dataclass(frozen=True)
class Series:
    """Values over frame numbers.

    Attributes
    ----------
    name : str
        In the legend.
    color : str
    values : mapping of int to float
        By frame number, rising.
    mark : str
        ``bar``, stacked on the earlier bars of the panel, or a key of :data:`MARKS`.
    """

    name: str
    color: str
    values: Mapping[int, float]
    mark: str = "line"


@dataclass(frozen=True)
class Panel:
    """A chart over frame numbers.

    Attributes
    ----------
    name : str
        Identifier.
    title, unit : str
    text : str
        Its content in a sentence, for readers that do not see it.
    series : tuple of Series
    top : float
        Of the vertical axis, which begins at 0.
    level : tuple of float and str, or None
        A horizontal line and its name.
    """

    name: str
    title: str
    unit: str
    text: str
    series: tuple[Series, ...]
    top: float
    level: tuple[float, str] | None = None


def new_figure(title: str, headings: Sequence[str]) -> tuple[Figure, list[Any]]:
    """Make a figure of panels above each other that share the frame axis, and its axes."""
    figure = Figure(figsize=(WIDTH_IN, 0.6 + PANEL_IN * len(headings)), dpi=DPI, layout="constrained")
    figure.suptitle(title, fontsize=12, color=INK)
    axes = figure.subplots(len(headings), 1, sharex=True, squeeze=False)[:, 0]
    for letter, heading, ax in zip("abcdef", headings, axes, strict=False):
        ax.set_title(f"({letter}) {heading}", loc="left", fontsize=10, color=INK)
        ax.margins(x=0.01)
        style_axes(ax, text_pt=9, grid="y")
        _mark_frames(ax)
    axes[-1].set_xlabel("frame")
    return figure, list(axes)


def draw(ax: Any, panel: Panel) -> None:
    """Draw the series and the level of a panel."""
    below: dict[int, float] = {}
    for series in panel.series:
        if series.mark == "bar":
            below = _stack(ax, series, below)
        else:
            is_point = len(series.values) == 1 and series.mark in ("line", "dashed")
            mark = "circle" if is_point else series.mark
            frames, values = list(series.values), list(series.values.values())
            ax.plot(frames, values, color=series.color, label=series.name, **MARKS[mark])
    if panel.level is not None:
        value, name = panel.level
        ax.axhline(value, color=INK, linestyle="--", linewidth=1.0, label=name)
    ax.set_ylim(0.0, panel.top)


def legend(ax: Any) -> None:
    """Put the legend above the panel on the right, where no data is."""
    place = {"loc": "lower right", "bbox_to_anchor": (1.0, 0.99), "borderaxespad": 0.2}
    ax.legend(ncols=5, fontsize=8, frameon=False, handlelength=1.6, columnspacing=1.2, **place)


def svg(panel: Panel, span: tuple[float, float]) -> str:
    """Draw a panel as an SVG element, whose text takes the colour and the font of a page.

    Parameters
    ----------
    panel
    span
        Frame numbers at the left and the right end of the axes, which lie at :data:`SVG_AXES`.
    """
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": panel.name}):
        figure = Figure(figsize=(SVG_WIDTH / 72.0, SVG_HEIGHT / 72.0), dpi=72)
        ax = figure.add_axes(SVG_AXES)
        style_axes(ax, text_pt=SVG_TEXT, grid="y")
        _mark_frames(ax)
        draw(ax, panel)
        ax.set_xlim(span)
        ax.yaxis.set_major_locator(MaxNLocator(4))
        out = io.StringIO()
        nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
        figure.savefig(out, format="svg", transparent=True, metadata=nothing)
    return _inlined(out.getvalue())


def save(figure: Figure, file: Path) -> Path:
    """Write a PNG, whole or not at all, its folder made if absent."""
    with whole_file(file) as beside:
        figure.savefig(beside, format="png", metadata={"Software": "enfilade"})
    return file


def pixels(figure: Figure) -> npt.NDArray[np.uint8]:
    """Draw a figure into an array, (H, W, 3) uint8."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.array(canvas.buffer_rgba(), np.uint8)[..., :3]


def save_picture(values: npt.NDArray[np.uint8], file: Path) -> Path:
    """Write an image, (H, W, 3) uint8 sRGB, as a PNG, whole or not at all."""
    with whole_file(file) as beside:
        imsave(beside, values, format="png", metadata={"Software": "enfilade"})
    return file


def style_axes(ax: Any, *, text_pt: float, grid: str = "both") -> None:
    """Give axes the look of all charts: a light grid along ``x``, ``y`` or both, no frame, dark numbers."""
    ax.grid(axis=grid, color=RULE, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set_color(RULE)
    ax.tick_params(which="both", color=RULE, labelcolor=INK, labelsize=text_pt, length=3)


def _mark_frames(ax: Any) -> None:
    ax.xaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))


def _stack(ax: Any, series: Series, below: Mapping[int, float]) -> dict[int, float]:
    """Draw bars on top of earlier ones; returns their tops by frame."""
    frames = np.array(list(series.values), np.float64)
    base = np.array([below.get(frame, 0.0) for frame in series.values])
    top = base + np.array(list(series.values.values()))
    half = 0.5 * float(np.diff(frames).min(initial=np.inf)) if len(frames) > 1 else 0.5
    edges = np.stack([frames - half, frames + half], axis=1).ravel()
    # Between two frames lies a bin of no height, and of no width where they follow each other.
    filled, floor = (np.zeros(2 * len(frames) - 1) for _ in range(2))
    filled[::2], floor[::2] = top, base
    ax.stairs(filled, edges, baseline=floor, fill=True, color=series.color, linewidth=0.0, label=series.name)
    return dict(zip(series.values, top.tolist(), strict=True))


def _inlined(text: str) -> str:
    """The SVG element of a file, without names that several charts share, in the colours of the page."""
    element = re.sub(r'<g id="[^"]*"', "<g", text[text.index("<svg") :])
    for color, themed in THEMED.items():
        element = re.sub(color, themed, element, flags=re.IGNORECASE)
    return re.sub(r"\s*\n\s*", " ", element)
