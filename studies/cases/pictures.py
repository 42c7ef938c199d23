"""Pictures of the case studies: ghosts as in the paper's Fig. 10, and what mirrors show."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from enfilade.kernels.tone import srgb_encode
from enfilade.records import F32, U8
from enfilade.reports.charts import INK, Figure, save
from enfilade.reports.heatmap import overlay
from enfilade.reports.scales import VELOCITY

__all__ = ["draw_ghosts", "draw_mirrors"]

DPI = 110
CROP_PX = 200  # side of the pictures


def draw_ghosts(example: Mapping[str, F32], file: Path) -> Path:
    """Fig. 10: a crop unfiltered, filtered without and with separation, maps of the metric, velocity."""
    crop = _crop_around(example["ghost"])
    grey = _grey(example["apart"])
    pictures = {
        "unfiltered": _encoded(example["raw"]),
        "without separation": _encoded(example["together"]),
        "with separation": _encoded(example["apart"]),
        "as it should be": _encoded(example["reference"]),
        "ghosts, JND in motion": _bytes(overlay(example["motion"], grey)),
        "ghosts, JND as a still": _bytes(overlay(example["still"], grey)),
        "ghosts": _bytes(np.repeat(example["ghost"][..., None], 3, axis=2)),
        "velocity": VELOCITY.paint(example["speed_deg_s"]),
    }
    return _pictures({name: image[crop] for name, image in pictures.items()}, 4, file)


def draw_mirrors(example: Mapping[str, F32], file: Path) -> Path:
    """What a mirror shows after each temporal filter, and four times its difference to what it should."""
    crop = _crop_around(example["mirror"])
    names = {
        "none": "no temporal filter",
        "full": "along the mirror's flow",
        "short": "the same, 3 frames",
        "reflected": "along the reflection's flow",
        "reference": "as it should be",
    }
    wanted = _encoded(example["reference"]).astype(np.float32)
    pictures = {title: _encoded(example[name])[crop] for name, title in names.items()}
    for name, title in names.items():
        if name == "reference":
            continue
        difference = 128.0 + 4.0 * (_encoded(example[name]).astype(np.float32) - wanted)
        pictures[f"4 x difference: {title}"] = np.clip(difference, 0.0, 255.0).astype(np.uint8)[crop]
    return _pictures(pictures, len(names), file)


def _pictures(pictures: Mapping[str, U8], columns: int, file: Path) -> Path:
    rows = -(-len(pictures) // columns)
    figure = Figure(figsize=(2.5 * columns, 2.75 * rows), dpi=DPI, layout="constrained")
    for place, (title, image) in enumerate(pictures.items(), 1):
        ax = figure.add_subplot(rows, columns, place)
        ax.imshow(image, interpolation="nearest")
        ax.set_title(title, fontsize=8.5, color=INK)
        ax.set_axis_off()
    return save(figure, file)


def _crop_around(weight: F32) -> tuple[slice, slice]:
    """The square, of :data:`CROP_PX` or as large as there is, that holds most of a map."""
    height, width = weight.shape
    side = min(CROP_PX, height, width)
    sums = np.pad(weight.astype(np.float64).cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    held = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
    top, left = np.unravel_index(int(np.argmax(held)), held.shape)
    return slice(int(top), int(top) + side), slice(int(left), int(left) + side)


def _encoded(color: F32) -> U8:
    return _bytes(srgb_encode(np.clip(color, 0.0, 1.0)))


def _grey(color: F32) -> F32:
    mean: F32 = srgb_encode(np.clip(color, 0.0, 1.0)).mean(axis=2).astype(np.float32)
    return mean


def _bytes(values: F32) -> U8:
    rounded: U8 = np.rint(np.clip(values, 0.0, 1.0) * 255.0).astype(np.uint8)
    return rounded
