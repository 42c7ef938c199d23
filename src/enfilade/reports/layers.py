"""The layers of a frame in a report: result, provenance, visible difference, velocity, difference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from enfilade.comparison import ComparedFrame
from enfilade.images.stills import to_bytes
from enfilade.images.view import ViewTransform
from enfilade.records import F32, U8, Provenance
from enfilade.reports import heatmap
from enfilade.reports.charts import PROVENANCE_COLORS
from enfilade.reports.run import DeliveredFrame
from enfilade.reports.scales import DIFFERENCE, VELOCITY, VISIBLE, Scale
from enfilade.viewing import Viewing

LEGEND_STEPS = 33  # colours


@dataclass(frozen=True)
class Layer:
    """A layer of the player.

    Attributes
    ----------
    name : str
        Identifier.
    title, text : str
        A word or two, and a sentence.
    legend : dict
        ``swatches`` (name and colour of each), or ``gradient`` (CSS colours) with ``ticks`` (place 0..1
        and label); empty for images.
    is_overlay : bool
        Drawn, half transparent, over the grey result, and stored losslessly.
    """

    name: str
    title: str
    text: str
    legend: dict[str, Any] = field(default_factory=dict)
    is_overlay: bool = False


def painted(frame: DeliveredFrame, view: ViewTransform, viewing: Viewing) -> dict[str, U8]:
    """Paint the layers of a frame: result, provenance and velocity, as far as its file has them.

    Parameters
    ----------
    frame
    view
        View transform of the video.
    viewing

    Returns
    -------
    dict of str to (H, W, 3) uint8
        Encoded sRGB, by the layer's name; provenance has opacity as a fourth channel.
    """
    pictures = {"result": to_bytes(view.encode(frame.color))}
    if frame.provenance is not None:
        pictures["provenance"] = _provenance_colors()[frame.provenance]
    if frame.flow is not None:
        fastest_px = np.float32(np.hypot(viewing.width_px, viewing.height_px))  # points near the eye
        pictures["velocity"] = VELOCITY.paint(
            viewing.velocity_deg_s(np.minimum(frame.flow.speed, fastest_px))
        )
    return pictures


def painted_difference(compared: ComparedFrame, difference_percent: F32) -> dict[str, U8]:
    """Paint the difference of a frame from the reference, visible and absolute, (H, W) percent of white."""
    visible = to_bytes(heatmap.overlay(compared.jnd, compared.grey))
    return {"visible": visible, "difference": DIFFERENCE.paint(difference_percent)}


def _provenance_colors() -> U8:
    """Colours of provenance, (256, 4); reused pixels are transparent."""
    table = np.zeros((256, 4), np.uint8)
    for name, color in PROVENANCE_COLORS.items():
        table[Provenance[name.upper()]] = (*bytes.fromhex(color[1:]), 255)
    return table


def _legend(scale: Scale, paint: Callable[[F32], U8]) -> dict[str, Any]:
    ticks, colors = list(scale.colors), paint(scale.values(LEGEND_STEPS)[None])[0]
    *labels, last = (f"{tick:g}" for tick in ticks)
    return {
        "gradient": ["#" + bytes(color.tolist()).hex() for color in colors],
        "ticks": list(zip(scale.place(ticks).tolist(), [*labels, f"≥ {last}"], strict=True)),
    }


def _visible_on_grey(jnd: F32) -> U8:
    return to_bytes(heatmap.overlay(jnd, np.full_like(jnd, 0.5)))


LAYERS = (
    Layer("result", "Result", "The finished frame, as in the video."),
    Layer(
        "provenance",
        "Provenance",
        "Why pixels were computed anew, over the grey result. Grey pixels are reused from keyframes.",
        {"swatches": list(PROVENANCE_COLORS.items())},
        is_overlay=True,
    ),
    Layer(
        "visible",
        "Visible difference",
        "Difference from the reference in just noticeable differences (JND); 1 is noticed in 3 of 4 cases.",
        _legend(VISIBLE, _visible_on_grey),
    ),
    Layer(
        "velocity",
        "Velocity",
        "Image velocity on the screen, degrees per second.",
        _legend(VELOCITY, VELOCITY.paint),
    ),
    Layer(
        "difference",
        "Difference",
        "Absolute difference from the reference, percent of white: sRGB values, mean of the channels.",
        _legend(DIFFERENCE, DIFFERENCE.paint),
    ),
)
