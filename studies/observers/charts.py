"""Plots of a validation: measurements of observers, and predictions of both modes of the metric."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from enfilade.reports.charts import BLUE, GREEN, GREY, INK, VERMILION, Figure, save, style_axes

DPI = 100
PANEL_IN = (4.6, 3.4)
MODE_STYLES = (  # first the published metric, then the modern one
    {"color": VERMILION, "marker": "s", "linestyle": "--"},
    {"color": BLUE, "marker": "o", "linestyle": "-"},
)
SERIES_COLORS = (INK, GREEN, BLUE, VERMILION, "#AA4499")
FREQUENCY, RATE, AREA = "frequency_cpd", "temporal_hz", "area_deg2"
AXES = {FREQUENCY: "spatial frequency, cpd", RATE: "temporal frequency, Hz", AREA: "area, deg²"}
TICKS = {
    FREQUENCY: (0.5, 1, 2, 4, 8),
    RATE: (0.5, 1, 2, 4, 8, 16, 32),
    AREA: (0.01, 0.1, 1, 10, 100, 1000),
}
SERIES = {FREQUENCY: "cpd", RATE: "Hz"}
STUDIES = {  # title, abscissa, what divides the points into series
    "robson1966_cpd": ("Robson 1966, flicker at four rates, 20 cd/m²", FREQUENCY, RATE),
    "robson1966_hz": ("Robson 1966, flicker by rate, 20 cd/m²", RATE, FREQUENCY),
    "laird2006": ("Laird et al. 2006, drift, 60 cd/m²", FREQUENCY, RATE),
    "rovamo1993": ("Rovamo et al. 1993, static, 50 cd/m²", AREA, FREQUENCY),
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


def _new(columns: int, *, rows: int = 1, width: float = 1.0) -> tuple[Figure, list[Any]]:
    size = (PANEL_IN[0] * columns * width, PANEL_IN[1] * rows + 0.5)
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax in axes:
        style_axes(ax, text_pt=9)
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
    angles = list(modes[0]["masking"])
    figure, axes = _new(len(angles))
    for ax, angle in zip(axes, angles, strict=True):
        observers = modes[0]["masking"][angle]
        marks = {"color": INK, "markersize": 6}
        ax.plot(observers["mask_db"], observers["observers_db"], "D", label="Foley 1994", **marks)
        for mode, style in zip(modes, MODE_STYLES, strict=False):
            found = mode["masking"][angle]
            label = f"{mode['mode']}, gain {found['gain_db']:+.1f} dB"
            lines = {"markersize": 4, "linewidth": 1.4, "label": label}
            ax.plot(found["mask_db"], found["metric_db"], **style, **lines)
        ax.set_title(f"mask at {angle} degrees to the target", fontsize=10, color=INK)
        ax.set(xlabel="contrast of the mask, dB", ylim=(-40.0, -12.0))
    axes[0].set_ylabel("contrast of the target at threshold, dB")
    axes[0].legend(fontsize=8, frameon=False, loc="upper left")
    return figure


def _sensitivity(modes: Sequence[Mapping[str, Any]]) -> Figure:
    figure, axes = _new(2, rows=2, width=1.2)
    for ax, (study, (title, abscissa, series)) in zip(axes, STUDIES.items(), strict=True):
        found = [mode["sensitivity"][study] for mode in modes]
        _draw_series(ax, found, abscissa, series)
        ax.set_title(title, fontsize=10, color=INK)
        ax.set(xscale="log", yscale="log", xlabel=AXES[abscissa], ylim=(1.5, 900.0))
        x = _array(found[0][abscissa])
        ticks = [tick for tick in TICKS[abscissa] if 0.9 * x.min() <= tick <= 1.1 * x.max()]
        ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        ax.minorticks_off()
        ax.legend(fontsize=8, frameon=False, loc="lower left" if abscissa != AREA else "lower right", ncols=2)
    for ax in axes[::2]:
        ax.set_ylabel("contrast sensitivity")
    figure.supxlabel("points: observers; dashed: paper; line: modern", fontsize=9, color=INK)
    return figure


def _draw_series(ax: Any, modes: Sequence[Mapping[str, Any]], abscissa: str, series: str) -> None:
    """Draw the points of the observers and the curves of both modes, with one colour for each series."""
    x, keys = (_array(modes[0][name]) for name in (abscissa, series))
    for key, color in zip(np.unique(keys), SERIES_COLORS, strict=False):
        chosen = np.flatnonzero(keys == key)
        chosen = chosen[np.argsort(x[chosen], kind="stable")]
        label = f"{key:.3g} {SERIES[series]}"
        ax.plot(x[chosen], _array(modes[0]["observers"])[chosen], "o", color=color, markersize=5, label=label)
        for mode, style in zip(modes, MODE_STYLES, strict=False):
            curve = _array(mode["metric"])[chosen]
            ax.plot(x[chosen], curve, style["linestyle"], color=color, linewidth=1.2)


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
