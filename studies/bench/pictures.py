"""The windows of a bench in one frame: references, configurations, and their differences."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.kernels.tone import srgb_encode
from enfilade.records import F32
from enfilade.reports.charts import INK, Figure, save
from enfilade.runs.folder import RunFolder
from enfilade.settings import SampleFilter
from studies.bench.charts import STYLES
from studies.bench.measuring import frame_of_run
from studies.bench.references import References
from studies.bench.tables import score_text
from studies.bench.windows import windows_of

DPI = 130
PANEL_IN = 1.9
AMPLIFICATION = 4.0  # of differences
SHOWN_OF_FAMILY = 3  # configurations: cheapest, median, most expensive


def selected(found: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """A few configurations of each family, in the order of the bench."""
    chosen = []
    for family in STYLES:
        rows = [row for row in found["configurations"] if row["family"] == family]
        rows.sort(key=lambda row: row["cost"]["cpu_s"])
        count = min(SHOWN_OF_FAMILY, len(rows))
        chosen += [rows[round(i * (len(rows) - 1) / max(count - 1, 1))] for i in range(count)]
    return chosen


def plot_crops(found: Mapping[str, Any], references: References, folder: Path, file: Path) -> Path:
    """Draw all windows of the middle frame: the pixels, and four times the difference around grey."""
    rows, measure = selected(found), next(iter(found["measures"]))
    windows = windows_of(found["windows"])
    middle = len(found["frames"]) // 2
    reference = references.read(middle)
    scale = np.float32(2.0 ** found["exposure_ev"])

    def displayed(linear: F32) -> F32:
        return srgb_encode(np.clip(linear * scale, 0.0, 1.0)).astype(np.float32)

    images = []
    for row in rows:
        run = RunFolder.read(folder / "configurations" / row["name"])
        is_box = SampleFilter(row["pixel_filter"]) is SampleFilter.BOX
        images.append(displayed(frame_of_run(run, found["frames"][middle], is_filtered=is_box)))
    size = (PANEL_IN * (len(rows) + 1), 2 * PANEL_IN * len(windows) + 0.5)
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    axes = figure.subplots(2 * len(windows), len(rows) + 1, squeeze=False)
    for ax in axes.ravel():
        ax.set_axis_off()
    for index, window in enumerate(windows):
        above, below = axes[2 * index], axes[2 * index + 1]
        mean = displayed(reference.denoised[SampleFilter.GAUSSIAN][2, index])
        above[0].imshow(mean, interpolation="nearest")
        text = f"↑ {window.kind}\n{AMPLIFICATION:g} × difference →"
        below[0].text(0.5, 0.5, text, fontsize=8, color=INK, ha="center", va="center")
        for column, image in enumerate(images, start=1):
            crop = window.crop(image)
            difference = 0.5 + np.float32(AMPLIFICATION) * (crop - mean)
            above[column].imshow(crop, interpolation="nearest")
            below[column].imshow(np.clip(difference, 0.0, 1.0), interpolation="nearest")
    axes[0, 0].set_title(f"reference, frame {found['frames'][middle]}", fontsize=7, color=INK)
    for ax, row in zip(axes[0, 1:], rows, strict=True):
        ax.set_title(f"{row['name']}\n{score_text(measure, row['values'][measure])}", fontsize=7, color=INK)
    return save(figure, file)
