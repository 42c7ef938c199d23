"""Pictures of the case studies: ghosts as in the paper's Fig. 10, and reflections in mirrors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from enfilade.files import whole_file
from enfilade.kernels.tone import srgb_encode
from enfilade.records import F32, U8
from enfilade.reports.charts import INK, Figure, save
from enfilade.reports.heatmap import overlay
from enfilade.reports.scales import VELOCITY

__all__ = ["draw_ghosts", "draw_mirrors", "write_example"]

DPI = 110
CROP_PX = 200  # side of the pictures


def write_example(file: Path, images: Mapping[str, F32]) -> None:
    """Write the images of an example."""
    with whole_file(file) as beside:
        np.savez(beside, allow_pickle=False, **images)


def draw_ghosts(example: Path, file: Path) -> Path:
    """Fig. 10: a crop unfiltered, filtered without and with separation, maps of the metric, velocity."""
    images = _read(example)
    crop = _crop_around(images["ghost"])
    grey = srgb_encode(np.clip(images["apart"], 0.0, 1.0)).mean(axis=2).astype(np.float32)
    pictures = {
        "unfiltered": _encoded(images["raw"]),
        "without separation": _encoded(images["together"]),
        "with separation": _encoded(images["apart"]),
        "reference": _encoded(images["reference"]),
        "ghosts, JND in motion": _bytes(overlay(images["motion"], grey)),
        "ghosts, JND as a still": _bytes(overlay(images["still"], grey)),
        "ghosts": _bytes(np.repeat(images["ghost"][..., None], 3, axis=2)),
        "velocity": VELOCITY.paint(images["speed_deg_s"]),
    }
    return _pictures({name: image[crop] for name, image in pictures.items()}, 4, file)


def draw_mirrors(example: Path, file: Path) -> Path:
    """A mirror after each temporal filter, and four times its difference to the reference."""
    images = _read(example)
    crop = _crop_around(images["mirror"])
    names = {
        "none": "no temporal filter",
        "full": "along the mirror's flow",
        "short": "the same, 3 frames",
        "reflected": "along the reflection's flow",
        "reference": "reference",
    }
    encoded = {name: _encoded(images[name])[crop] for name in names}
    pictures = {title: encoded[name] for name, title in names.items()}
    for name in list(names)[:-1]:
        difference = encoded[name].astype(np.float32) - encoded["reference"].astype(np.float32)
        pictures[f"4 x difference: {names[name]}"] = np.clip(128.0 + 4.0 * difference, 0.0, 255.0).astype(
            np.uint8
        )
    return _pictures(pictures, len(names), file)


def _read(file: Path) -> dict[str, F32]:
    with np.load(file, allow_pickle=False) as held:
        return {name: held[name] for name in held.files}


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
    """The square, of :data:`CROP_PX` or as large as there is, with the largest sum of a map."""
    height, width = weight.shape
    side = min(CROP_PX, height, width)
    sums = np.pad(weight.astype(np.float64).cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    inside = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
    top, left = np.unravel_index(int(np.argmax(inside)), inside.shape)
    return slice(int(top), int(top) + side), slice(int(left), int(left) + side)


def _encoded(color: F32) -> U8:
    return _bytes(srgb_encode(np.clip(color, 0.0, 1.0)))


def _bytes(values: F32) -> U8:
    rounded: U8 = np.rint(np.clip(values, 0.0, 1.0) * 255.0).astype(np.uint8)
    return rounded
