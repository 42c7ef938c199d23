"""Crops of the configurations of a bench and their references."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.images import read_exr
from enfilade.kernels.tone import srgb_encode
from enfilade.methods.base import FRAMES
from enfilade.records import F32
from enfilade.reports.charts import INK, Figure, save
from enfilade.runs.folder import RunFolder
from studies.bench.charts import STYLES
from studies.bench.tables import score_text
from studies.crops import crop_around

DPI = 130
AMPLIFICATION = 4.0  # of differences
CROP_PX = 72  # side of a crop
CENTRED: dict[str, Any] = {"ha": "center", "va": "center"}
SHOWN_FRAMES = 3
SHOWN_OF_FAMILY = 3  # configurations: cheapest, median, most expensive


class Frames:
    """Frames of a bench as displayed: exposed, clipped and encoded as sRGB."""

    def __init__(self, found: Mapping[str, Any], folder: Path) -> None:
        self._scale = np.float32(2.0 ** found["exposure_ev"])
        self._folder = folder
        self.configurations = {of["name"]: of for of in found["configurations"]}

    def displayed(self, number: int, *folders: str) -> F32:
        """The mean of a frame over some run folders of the bench, such as ``references/box-1``."""
        runs = [RunFolder.read(self._folder / folder) for folder in folders]
        frames = [read_exr(run.file_of(FRAMES, number))["RGB"].astype(np.float32) for run in runs]
        linear = np.asarray(np.mean(frames, axis=0), np.float32)
        return srgb_encode(np.clip(linear * self._scale, 0.0, 1.0)).astype(np.float32)

    def of(self, name: str, number: int) -> F32:
        """A frame of a configuration."""
        return self.displayed(number, f"configurations/{name}")

    def reference(self, name: str, number: int) -> F32:
        """The same frame of the configuration's reference."""
        kind = self.configurations[name]["pixel_filter"]
        return self.displayed(number, f"references/{kind}-1", f"references/{kind}-2")

    def selected(self) -> list[str]:
        """Names of a few configurations of each family, in the order of the bench."""
        chosen: dict[str, None] = {}
        for family in STYLES:
            names = [name for name, of in self.configurations.items() if of["family"] == family]
            count = min(SHOWN_OF_FAMILY, len(names))
            indices = [round(i * (len(names) - 1) / max(count - 1, 1)) for i in range(count)]
            chosen |= dict.fromkeys(names[index] for index in indices)
        return list(chosen)


def plot_crops(found: Mapping[str, Any], folder: Path, file: Path) -> Path:
    """Draw crops of some configurations and of the reference, where they differ most.

    Two rows for each of up to three frames: the crop, and four times its difference to the
    reference around grey.
    """
    frames = Frames(found, folder)
    names, numbers, measure = frames.selected(), found["frames"], next(iter(found["measures"]))
    chosen = sorted(
        {numbers[round((i + 0.5) * len(numbers) / SHOWN_FRAMES - 0.5)] for i in range(SHOWN_FRAMES)}
    )
    size = (1.25 * (len(names) + 1), 2.6 * len(chosen) + 0.4)
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    axes = figure.subplots(2 * len(chosen), len(names) + 1, squeeze=False)
    for ax in axes.ravel():
        ax.set_axis_off()
    for row, number in enumerate(chosen):
        images = {name: (frames.of(name, number), frames.reference(name, number)) for name in names}
        errors = [np.square(test - reference).sum(axis=-1) for test, reference in images.values()]
        crop = crop_around(sum(error / max(float(error.mean()), 1e-12) for error in errors), CROP_PX)
        above, below = axes[2 * row], axes[2 * row + 1]
        above[0].imshow(images[names[0]][1][crop], interpolation="nearest")
        below[0].text(0.5, 0.9, f"↑ frame {number}", fontsize=8, color=INK, **CENTRED)
        below[0].text(0.5, 0.5, f"{AMPLIFICATION:g} × difference →", fontsize=7, color=INK, **CENTRED)
        for column, (test, reference) in enumerate(images.values(), start=1):
            difference = 0.5 + np.float32(AMPLIFICATION) * (test[crop] - reference[crop])
            above[column].imshow(test[crop], interpolation="nearest")
            below[column].imshow(np.clip(difference, 0.0, 1.0), interpolation="nearest")
    axes[0, 0].set_title("reference", fontsize=7, color=INK)
    for ax, name in zip(axes[0, 1:], names, strict=True):
        score = score_text(frames.configurations[name]["scores"][measure])
        ax.set_title(f"{name}\n{score}", fontsize=7, color=INK)
    return save(figure, file)
