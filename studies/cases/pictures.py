"""Images of ghosts, as in the paper's Fig. 10."""

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
from studies.crops import crop_around

CROP_PX = 200  # side of the pictures


def write_example(file: Path, images: Mapping[str, F32]) -> None:
    """Write the images of an example, see :func:`studies.cases.separation.compare`."""
    with whole_file(file) as beside:
        np.savez(beside, allow_pickle=False, **images)


def draw_ghosts(example: Path, file: Path) -> Path:
    """Fig. 10: a crop unfiltered, filtered without and with separation, maps of the metric, velocity."""
    with np.load(example, allow_pickle=False) as images:
        colors = {name: srgb_encode(np.clip(images[name], 0.0, 1.0)) for name in COLORS}
        grey = colors["separated"].mean(axis=2).astype(np.float32)
        pictures = {title: _bytes(colors[name]) for name, title in COLORS.items()} | {
            "ghosts, JND in motion": _bytes(overlay(images["motion"], grey)),
            "ghosts, JND as a still": _bytes(overlay(images["still"], grey)),
            "ghosts": _bytes(np.repeat(images["ghost"][..., None], 3, axis=2)),
            "velocity": VELOCITY.paint(images["speed_deg_s"]),
        }
        crop = crop_around(images["ghost"], CROP_PX)
    figure = Figure(figsize=(10.0, 5.5), dpi=110, layout="constrained")
    for index, (title, image) in enumerate(pictures.items(), 1):
        ax = figure.add_subplot(2, 4, index)
        ax.imshow(image[crop], interpolation="nearest")
        ax.set_title(title, fontsize=8.5, color=INK)
        ax.set_axis_off()
    return save(figure, file)


COLORS = {
    "unfiltered": "unfiltered",
    "unseparated": "without separation",
    "separated": "with separation",
    "reference": "reference",
}


def _bytes(values: F32) -> U8:
    rounded: U8 = np.rint(np.clip(values, 0.0, 1.0) * 255.0).astype(np.uint8)
    return rounded
