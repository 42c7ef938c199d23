"""How our charts look: size, palette, axes over frame numbers. The owner of matplotlib.

Colours are Okabe and Ito's, told apart by readers with any of the common colour deficiencies; what
matters is told apart by shape, line style or place as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imsave
from matplotlib.ticker import MaxNLocator

from enfilade.files import whole_file

__all__ = [
    "BLUE",
    "GREEN",
    "GREY",
    "INK",
    "ORANGE",
    "SOURCE_COLORS",
    "VERMILION",
    "Figure",
    "frame_edges",
    "legend",
    "mark_keyframes",
    "new_figure",
    "pixels",
    "save",
    "save_picture",
    "stack",
]

BLUE, ORANGE, GREEN, VERMILION, SKY, GREY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#56B4E9", "#BBBBBB"
SOURCE_COLORS = {"slow": BLUE, "specular": ORANGE, "hole": GREEN, "keyframe": GREY}
INK = "#333333"
WIDTH_IN, PANEL_IN = 10.0, 2.7
DPI = 120


def new_figure(title: str, panels: Sequence[str]) -> tuple[Figure, list[Any]]:
    """Make a figure with panels above each other that share the frame axis.

    Parameters
    ----------
    title
    panels
        Heading of each panel; ``(a)``, ``(b)`` are put before them.

    Returns
    -------
    Figure, list of Axes
    """
    figure = Figure(figsize=(WIDTH_IN, 0.6 + PANEL_IN * len(panels)), dpi=DPI, layout="constrained")
    figure.suptitle(title, fontsize=12, color=INK)
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for letter, heading, ax in zip("abcdef", panels, axes, strict=False):
        ax.set_title(f"({letter}) {heading}", loc="left", fontsize=10, color=INK)
        ax.grid(axis="y", color="#DDDDDD", linewidth=0.6)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
        ax.margins(x=0.01)
        ax.tick_params(colors=INK, labelsize=9)
    axes[-1].set_xlabel("frame")
    axes[-1].xaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))
    return figure, list(axes)


def frame_edges(frames: Sequence[int]) -> npt.NDArray[np.float64]:
    """Borders between neighbouring frames, one more than there are frames."""
    numbers = np.asarray(frames, np.float64)
    if len(numbers) == 1:
        return np.array([numbers[0] - 0.5, numbers[0] + 0.5])
    inner = 0.5 * (numbers[1:] + numbers[:-1])
    first, last = 2.0 * numbers[0] - inner[0], 2.0 * numbers[-1] - inner[-1]
    return np.concatenate([[first], inner, [last]])


def stack(ax: Any, frames: Sequence[int], shares: dict[str, tuple[str, Sequence[float]]]) -> None:
    """Stack percentages over the frames.

    Parameters
    ----------
    ax
    frames
    shares
        Colour and percentage per frame, by the name in the legend; the first lies lowest.
    """
    edges = frame_edges(frames)
    below = np.zeros(len(frames))
    for name, (color, values) in shares.items():
        top = below + np.asarray(values, np.float64)
        ax.stairs(top, edges, baseline=below, fill=True, color=color, linewidth=0.0, label=name)
        below = top


def mark_keyframes(ax: Any, frames: Sequence[int], values: Sequence[float], keyframes: Sequence[int]) -> None:
    """Put a triangle on a curve at each keyframe."""
    value_at = dict(zip(frames, values, strict=True))
    heights = [value_at[k] for k in keyframes]
    style = {"color": VERMILION, "markeredgecolor": "white", "markeredgewidth": 0.6}
    ax.plot(list(keyframes), heights, "v", markersize=7, label="keyframes", clip_on=False, zorder=3, **style)


def legend(ax: Any, columns: int = 4) -> None:
    """Put the legend above the panel on the right, where no data is."""
    place = {"loc": "lower right", "bbox_to_anchor": (1.0, 0.99), "borderaxespad": 0.2}
    ax.legend(ncols=columns, fontsize=8, frameon=False, handlelength=1.6, columnspacing=1.2, **place)


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
    """Write an image as a PNG, whole or not at all.

    Parameters
    ----------
    values : (H, W, 3) uint8
        Encoded for an sRGB screen.
    file
    """
    with whole_file(file) as beside:
        imsave(beside, values, format="png", metadata={"Software": "enfilade"})
    return file
