"""The frames of a report, encoded for its player, within a number of bytes."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.comparison import ComparedFrame, Terms, compare
from enfilade.images import open_sequence
from enfilade.images.stills import encode_webp, resized
from enfilade.images.view import View
from enfilade.kernels.tone import srgb_encode
from enfilade.monitor import Monitor, Silence
from enfilade.records import F32, U8
from enfilade.reports.layers import LAYERS, Comparison, Layer, painted
from enfilade.reports.run import ReportedRun
from enfilade.viewing import Viewing

__all__ = ["Film"]

WIDEST_PX = 1280  # of a picture
LEAST_WIDTH_PX = 480  # frames are left out before pictures become narrower
CAUTION = 0.8  # of the bytes, since other frames may be larger than the one from which they are estimated


class Film:
    """The encoded frames of a run, compared with a reference where there is one.

    Pictures that take too many bytes are scaled down to 480 pixels of width, then frames are left out evenly.

    Parameters
    ----------
    run
    view
        View transform of the video.
    reference
        Whatever :func:`enfilade.images.open_sequence` reads, with the finished frames of the run; or None.
    max_bytes
        Of all pictures, as text, about.
    monitor

    Attributes
    ----------
    size : tuple of int
        Width and height of the pictures.
    frames : list of dict
        ``number``, ``index`` on the path, and ``layers``: WebP in base64, by the layer's name.
    difference : dict or None
        ``SequenceDifference.to_dict()`` from the reference.
    notes : list of str
        What was scaled or left out.

    Raises
    ------
    DamagedFileError, ImageError
        A frame can't be read, or the run and the reference can't be compared.
    """

    def __init__(
        self, run: ReportedRun, view: View, reference: Path | None, max_bytes: float, monitor: Monitor
    ) -> None:
        self._run, self._view = run, view
        full = (run.viewing.width_px, run.viewing.height_px)
        self.size = _scaled(full, min(1.0, WIDEST_PX / full[0]))
        self.frames: list[dict[str, Any]] = []
        self.difference: dict[str, Any] | None = None
        self.notes: list[str] = []
        if not run.there:
            self.notes.append("no frame is finished yet")
            return
        step = self._fit(CAUTION * max_bytes, is_compared=reference is not None)
        kept = sorted({*run.there[::step], run.there[-1]})
        if reference is not None:
            self.difference = self._compare(reference, set(kept), monitor)
        else:
            for count, index in enumerate(kept, 1):
                self._add(index)
                monitor.progress("report", count, len(kept))
        if self.size != full:
            before, after = (f"{width}x{height}" for width, height in (full, self.size))
            self.notes.append(f"pictures are scaled from {before} to {after} pixels")
        if step > 1:
            self.notes.append(
                f"the player has {len(kept)} of {len(run.there)} frames, to keep the page small; charts and "
                "tables have all"
            )

    @property
    def layers(self) -> list[Layer]:
        """Layers that at least one frame has."""
        return [layer for layer in LAYERS if any(layer.name in frame["layers"] for frame in self.frames)]

    def _fit(self, most: float, *, is_compared: bool) -> int:
        """Scale the pictures; returns every how many frames one is kept."""
        found = self._encoded(self._run.there[len(self._run.there) // 2])
        # Maps of differences take about as much as the result.
        each = sum(map(len, found.values())) + (2 * len(found["result"]) if is_compared else 0)
        total = each * len(self._run.there)
        if total <= most:
            return 1
        factor = max(math.sqrt(most / total), min(1.0, LEAST_WIDTH_PX / self.size[0]))
        self.size = _scaled(self.size, factor)
        return max(1, math.ceil(total * factor**2 / most))

    def _compare(self, reference: Path, kept: set[int], monitor: Monitor) -> dict[str, Any]:
        """Compare all finished frames with the reference, and add those that are kept."""
        run, indices = self._run, {number: index for index, number in enumerate(self._run.numbers)}
        exposure_ev = run.viewing_settings.exposure_ev

        def show(judged: Iterator[ComparedFrame], _viewing: Viewing) -> None:
            others = open_sequence(reference)
            # Frames of a video are as shown; those of a renderer are not exposed yet.
            other_ev = exposure_ev if others.name(0).lower().endswith(".exr") else 0.0
            for count, (found, other) in enumerate(zip(judged, others, strict=True), 1):
                monitor.progress("report", count, len(run.there))
                index = indices[found.difference.number]
                if index in kept:
                    ours = _shown(run.frame(index).color, exposure_ev)
                    percent = np.float32(100.0) * np.abs(ours - _shown(other, other_ev)).mean(axis=2)
                    self._add(index, Comparison(found.jnd, found.grey, percent))

        terms = Terms(viewing=run.viewing_settings, exposure_ev=exposure_ev)
        return compare(run.folder, reference, terms, Silence(), show=show).to_dict()

    def _add(self, index: int, compared: Comparison | None = None) -> None:
        layers = self._encoded(index, compared)
        self.frames.append({"number": self._run.numbers[index], "index": index, "layers": layers})

    def _encoded(self, index: int, compared: Comparison | None = None) -> dict[str, str]:
        pictures = painted(self._run.frame(index), compared, self._view, self._run.viewing)
        return {layer.name: self._webp(layer, pictures) for layer in LAYERS if layer.name in pictures}

    def _webp(self, layer: Layer, pictures: Mapping[str, U8]) -> str:
        picture = resized(pictures[layer.name], self.size, is_mixed=not layer.is_overlay)
        return base64.b64encode(encode_webp(picture, quality=layer.quality)).decode()


def _shown(linear: F32, exposure_ev: float) -> F32:
    """Encoded for an sRGB screen, 0..1."""
    return srgb_encode(np.clip(linear * np.float32(2.0**exposure_ev), 0.0, 1.0).astype(np.float32))


def _scaled(size: tuple[int, int], factor: float) -> tuple[int, int]:
    width, height = (max(1, round(side * factor)) for side in size)
    return width, height
