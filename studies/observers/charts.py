"""Plots of a validation: measurements of observers, and predictions of both modes of the metric."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from enfilade.reports.charts import BLUE, GREEN, GREY, INK, VERMILION, Figure, save

__all__ = ["plot_validation"]

DPI = 100
PANEL_IN = (4.6, 3.4)
MODE_STYLES = (  # first the published metric, then the modern one
    {"color": VERMILION, "marker": "s", "linestyle": "--"},
    {"color": BLUE, "marker": "o", "linestyle": "-"},
)
STUDY_TITLES = {
    "robson1966": "Robson 1966, 20 cd/m²",
    "laird2006": "Laird et al. 2006, 60 cd/m²",
    "modelfest": "Gabors of ModelFest, 30 cd/m²",
}
TEXTURE_COLORS = {"checkerboard": VERMILION, "gradient": GREEN, "grass": GREY, "noise": BLUE}
DISPLAY_MARKERS = {"pc": "o", "phone": "s", "headset": "^"}


def plot_validation(validation: Mapping[str, Any], folder: Path) -> list[Path]:
    """Draw a plot for each data set.

    Parameters
    ----------
    validation
        ``Validation.to_dict()``; its first two modes are drawn.
    folder
        Receives the PNG files.

    Returns
    -------
    list of Path
        The files.
    """
    modes = validation["modes"][: len(MODE_STYLES)]
    figures = {
        "modelfest.png": _modelfest(modes),
        "masking.png": _masking(modes),
        "sensitivity.png": _sensitivity(modes),
        "moving_texture.png": _moving_texture(modes),
    }
    return [save(figure, folder / name) for name, figure in figures.items()]


def _new(columns: int, *, width: float = 1.0) -> tuple[Figure, list[Any]]:
    size = (PANEL_IN[0] * columns * width, PANEL_IN[1] + 0.5)
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    axes = figure.subplots(1, columns, squeeze=False)[0]
    for ax in axes:
        ax.grid(color="#DDDDDD", linewidth=0.6)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
        ax.tick_params(colors=INK, labelsize=9)
    return figure, list(axes)


def _modelfest(modes: Sequence[Mapping[str, Any]]) -> Figure:
    figure, (ax,) = _new(1, width=2.2)
    observers = modes[0]["modelfest"]
    positions = np.arange(len(observers["number"]))
    ax.errorbar(
        positions,
        observers["observers_db"],
        yerr=observers["spread_db"],
        fmt="D",
        color=INK,
        markersize=5,
        elinewidth=0.8,
        label="16 observers, with standard deviation",
    )
    for mode, style in zip(modes, MODE_STYLES, strict=False):
        predicted = mode["modelfest"]
        gain_db = np.mean(_array(predicted["observers_db"]) - _array(predicted["metric_db"]))
        ax.plot(
            positions,
            _array(predicted["metric_db"]) + gain_db,
            **style | {"linestyle": "none"},
            markersize=5,
            label=f"{mode['mode']}, gain {gain_db:+.1f} dB",
        )
    ax.set_xticks(positions, [str(n) for n in observers["number"]], fontsize=8)
    ax.set_xlabel("target")
    ax.set_ylabel("contrast sensitivity, dB")
    ax.legend(fontsize=8, frameon=False, loc="lower right", ncols=3, bbox_to_anchor=(1.0, 1.0))
    return figure


def _masking(modes: Sequence[Mapping[str, Any]]) -> Figure:
    figure, (ax,) = _new(1, width=1.4)
    observers = modes[0]["masking"]
    ax.plot(observers["mask_db"], observers["observers_db"], "D", color=INK, markersize=6, label="Foley 1994")
    for mode, style in zip(modes, MODE_STYLES, strict=False):
        predicted = mode["masking"]
        label = f"{mode['mode']}, gain {predicted['gain_db']:+.1f} dB"
        ax.plot(
            predicted["mask_db"], predicted["metric_db"], **style, markersize=4, linewidth=1.4, label=label
        )
    ax.set_xlabel("contrast of the mask, dB")
    ax.set_ylabel("contrast of the target at threshold, dB")
    ax.legend(fontsize=8, frameon=False, loc="upper left")
    return figure


def _sensitivity(modes: Sequence[Mapping[str, Any]]) -> Figure:
    figure, axes = _new(len(STUDY_TITLES))
    colors = {
        0.0: INK,
        1.0: INK,
        6.06: GREEN,
        10.0: INK,
        16.0: BLUE,
        20.0: BLUE,
        22.63: VERMILION,
        30.0: VERMILION,
    }
    for ax, (study, title) in zip(axes, STUDY_TITLES.items(), strict=True):
        ax.set_title(title, fontsize=10, color=INK)
        for hertz, color in colors.items():
            _draw_rate(ax, [mode["sensitivity"][study] for mode in modes], hertz, color)
        ax.set(xscale="log", yscale="log", xlabel="spatial frequency, cpd", ylim=(1.0, 500.0))
        ax.set_xticks([0.5, 1, 2, 4, 8], ["0.5", "1", "2", "4", "8"])
        ax.minorticks_off()
        ax.legend(fontsize=8, frameon=False, loc="lower left")
    axes[0].set_ylabel("contrast sensitivity")
    figure.supxlabel("points: observers; dashed: paper; line: modern", fontsize=9, color=INK)
    return figure


def _draw_rate(ax: Any, modes: Sequence[Mapping[str, Any]], hertz: float, color: str) -> None:
    """Draw the points and curves of one temporal frequency, if it has two or more gratings.

    Gratings of the largest area are filled points with one curve; smaller ones are open points with another.
    """
    is_rate = np.abs(_array(modes[0]["temporal_hz"]) - hertz) < 0.01
    area, cpd = (_array(modes[0][name]) for name in ("area_deg2", "frequency_cpd"))
    is_large = area > 0.99 * area.max()
    for is_chosen, face in ((is_rate & is_large, color), (is_rate & ~is_large, "white")):
        if np.count_nonzero(is_chosen) < 2:
            continue
        label = f"{hertz:g} Hz" + ("" if face == color else ", smaller")
        observers = _array(modes[0]["observers"])[is_chosen]
        ax.plot(cpd[is_chosen], observers, "o", color=color, markerfacecolor=face, markersize=5, label=label)
        order = np.argsort(cpd[is_chosen], kind="stable")
        for mode, style in zip(modes, MODE_STYLES, strict=False):
            curve = np.maximum(_array(mode["metric"])[is_chosen][order], 0.01)
            ax.plot(cpd[is_chosen][order], curve, style["linestyle"], color=color, linewidth=1.2)


def _moving_texture(modes: Sequence[Mapping[str, Any]]) -> Figure:
    figure, axes = _new(len(modes), width=1.2)
    for ax, mode in zip(axes, modes, strict=True):
        results = mode["moving_texture"]
        observers, metric = _array(results["observers_jnd"]), _array(results["metric_jnd"])
        interval = np.array([results["low_jnd"], results["high_jnd"]])
        kinds = [(c["texture"], c["display"]) for c in results["conditions"]]
        for texture, color in TEXTURE_COLORS.items():
            for display, marker in DISPLAY_MARKERS.items():
                is_chosen = np.array([kind == (texture, display) for kind in kinds])
                style = {"color": color, "markersize": 5, "elinewidth": 0.5}
                label = f"{texture}, {display}"
                x, y, bars = metric[is_chosen], observers[is_chosen], interval[:, is_chosen]
                ax.errorbar(x, y, yerr=bars, fmt=marker, label=label, **style)
        ax.set_xscale("log")
        ax.set_title(mode["mode"], fontsize=10, color=INK)
        ax.set_xlabel("score of the metric, JND")
        ax.axhline(0.0, color=INK, linewidth=0.8)
    axes[0].set_ylabel("quality loss reported by observers, JND")
    axes[-1].legend(fontsize=7, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _array(values: Sequence[float]) -> npt.NDArray[np.float64]:
    return np.asarray(values, np.float64)
