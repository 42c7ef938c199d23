"""What the report shows of a frame: result, source, probability of detection, velocity, difference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from enfilade.images.view import View
from enfilade.metric.pooling import detection_probability
from enfilade.records import F32, U8, Provenance
from enfilade.reports import heatmap
from enfilade.reports.against import Beside
from enfilade.reports.scales import DIFFERENCE, VELOCITY, Scale
from enfilade.reports.seen import SeenFrame
from enfilade.viewing import Viewing

__all__ = ["LAYERS", "SOURCE_COLORS", "Layer", "painted"]

SOURCE_COLORS = {  # Okabe and Ito's, told apart with any of the common colour deficiencies
    Provenance.SLOW: "#56B4E9",
    Provenance.SPECULAR: "#E69F00",
    Provenance.DISOCCLUDED: "#009E73",
    Provenance.KEYFRAME: "#CC79A7",
}
SOURCE_NAMES = {
    Provenance.SLOW: "slow",
    Provenance.SPECULAR: "specular",
    Provenance.DISOCCLUDED: "hole",
    Provenance.KEYFRAME: "keyframe",
}
QUALITY = 92  # of WebP


@dataclass(frozen=True)
class Layer:
    """A layer of the report.

    Attributes
    ----------
    name : str
        Short, for programs.
    key : int
        On the keyboard.
    title, text : str
        For people: a word or two, and a sentence.
    legend : dict
        ``swatches`` (name and colour of each), or ``gradient`` (CSS colours) with ``ticks`` (place 0..1
        and label); empty where none is needed.
    quality : int or None
        Of WebP; None: without loss.
    is_overlay : bool
        Drawn, half transparent, over the grey result.
    """

    name: str
    key: int
    title: str
    text: str
    legend: dict[str, Any]
    quality: int | None = QUALITY
    is_overlay: bool = False


def painted(frame: SeenFrame, beside: Beside | None, *, view: View, viewing: Viewing) -> dict[str, U8]:
    """Paint all layers that there are of a frame.

    Parameters
    ----------
    frame
    beside
        The same with its reference; None where there is none.
    view
        The view transform of the video.
    viewing

    Returns
    -------
    dict of str to (H, W, 3) uint8
        Encoded sRGB, by the layer's name; the source map has opacity as fourth channel.
    """
    pictures = {"result": _bytes(view.encode(frame.color))}
    if frame.source is not None:
        pictures["source"] = _source(frame.source)
    if beside is not None and beside.jnd is not None:
        pictures["visible"] = _bytes(heatmap.overlay(beside.jnd, beside.grey))
    if frame.flow is not None:
        fastest = np.hypot(viewing.width_px, viewing.height_px)
        speed = np.minimum(frame.flow.speed, np.float32(fastest))
        pictures["velocity"] = VELOCITY.paint(viewing.velocity_deg_s(speed))
    if beside is not None:
        pictures["difference"] = DIFFERENCE.paint(beside.difference_percent)
    return pictures


def _source(source: U8) -> U8:
    table = np.zeros((256, 4), np.uint8)
    for number, color in SOURCE_COLORS.items():
        table[number] = (*bytes.fromhex(color[1:]), 255)
    mapped: U8 = table[source]
    return mapped


def _bytes(encoded: F32) -> U8:
    values: U8 = np.rint(np.clip(encoded, 0.0, 1.0) * np.float32(255.0)).astype(np.uint8)
    return values


def _scale_legend(scale: Scale) -> dict[str, Any]:
    places = scale.place(np.array(scale.ticks)).tolist()
    labels = [f"{tick:g}" for tick in scale.ticks]
    return {
        "gradient": [f"#{color}" for color in scale.colors],
        "ticks": [{"place": p, "label": t} for p, t in zip(places, labels, strict=True)],
    }


def _visible_legend() -> dict[str, Any]:
    jnd = np.array([0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0], np.float32)
    ramp = np.expm1(np.linspace(0.0, np.log1p(16.0), 33)).astype(np.float32)[None, :]
    colors = _bytes(heatmap.overlay(ramp, np.full_like(ramp, 0.5)))[0]
    places = np.log1p(jnd) / np.log1p(16.0)
    shares = 100.0 * detection_probability(jnd)
    labels = [f"{s:.0f} %" if j < 4.0 else f"{j:g} JND" for j, s in zip(jnd, shares, strict=True)]
    return {
        "gradient": ["#" + bytes(color.tolist()).hex() for color in colors],
        "ticks": [{"place": float(p), "label": t} for p, t in zip(places, labels, strict=True)],
    }


LAYERS = (
    Layer("result", 1, "Result", "The finished frame, as in the video.", {}),
    Layer(
        "source",
        2,
        "Source",
        "Why each pixel was traced, over the result in grey; pixels without colour are reused.",
        {"swatches": [{"name": SOURCE_NAMES[s], "color": c} for s, c in SOURCE_COLORS.items()]},
        None,
        is_overlay=True,
    ),
    Layer(
        "visible",
        3,
        "Probability",
        "Probability that a viewer sees the difference to the reference (75 % is 1 JND).",
        _visible_legend(),
    ),
    Layer(
        "velocity",
        4,
        "Velocity",
        "Image velocity on the screen, degrees per second.",
        _scale_legend(VELOCITY),
    ),
    Layer(
        "difference",
        5,
        "Difference",
        "Absolute difference to the reference, percent of white: encoded values, mean of the channels.",
        _scale_legend(DIFFERENCE),
    ),
)
