"""The frames of a report, encoded for its player, within a number of bytes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.comparison import ComparedFrame, CompareOptions, compare
from enfilade.comparison.measures import DisplayedPair
from enfilade.images.stills import embedded, resized
from enfilade.images.view import ViewTransform
from enfilade.monitor import Monitor, Silence
from enfilade.records import F32, U8
from enfilade.reports.layers import LAYERS, Layer, painted, painted_difference
from enfilade.reports.run import ReportedRun
from enfilade.viewing import Viewing

WIDEST_PX = 1280  # of a picture
LEAST_WIDTH_PX = 480  # frames are left out before pictures become narrower
CAUTION = 0.8  # of the bytes, since other frames may be larger than the one from which they are estimated


class Film:
    """The encoded frames of a run; a complete run is compared with its reference, where there is one.

    Pictures that take too many bytes are scaled down to 480 pixels of width, then frames are left out evenly.

    Parameters
    ----------
    run
    view
        View transform of the video.
    references
        At most two: whatever :func:`enfilade.images.open_sequence` reads, with the frames of the run.
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
        Remarks of the comparison, and what was scaled or left out.

    Raises
    ------
    DamagedFileError, ImageError
        A frame can't be read, or the run and the reference can't be compared.
    """

    def __init__(
        self,
        run: ReportedRun,
        view: ViewTransform,
        references: Sequence[Path],
        max_bytes: float,
        monitor: Monitor,
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
        is_compared = bool(references) and run.has_all_frames
        if references and not is_compared:
            left = len(run.numbers) - len(run.there)
            self.notes.append(
                f"{left} frames are missing, so that the run is not compared with the reference"
            )
        step = self._fit(CAUTION * max_bytes, is_compared=is_compared)
        kept = sorted({*run.there[::step], run.there[-1]})
        if is_compared:
            self.difference = self._compare(references, set(kept), monitor)
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
        found = self._encoded(self._painted(self._run.there[len(self._run.there) // 2]))
        # Maps of differences take about as much as the result.
        each = sum(map(len, found.values())) + (2 * len(found["result"]) if is_compared else 0)
        total = each * len(self._run.there)
        if total <= most:
            return 1
        factor, least = math.sqrt(most / total), min(1.0, LEAST_WIDTH_PX / self.size[0])
        self.size = _scaled(self.size, max(factor, least))
        return 1 if factor >= least else math.ceil(total * least**2 / most)

    def _compare(self, references: Sequence[Path], kept: set[int], monitor: Monitor) -> dict[str, Any]:
        """Compare all frames with the references, and add those that are kept."""
        run, indices = self._run, {number: index for index, number in enumerate(self._run.numbers)}
        absolute = AbsoluteDifference()

        def show(frames: Iterator[ComparedFrame], _viewing: Viewing) -> None:
            for count, frame in enumerate(frames, 1):
                monitor.progress("report", count, len(run.there))
                index = indices[frame.difference.number]
                if index in kept:
                    self._add(index, painted_difference(frame, absolute.map_percent))

        options = CompareOptions(
            display=run.viewing, exposure_ev=run.viewing_settings.exposure_ev, measures=[absolute]
        )
        first, second, *_ = *references, None
        remarks = _Remarks(self.notes)
        found = compare(run.folder, first, options, remarks, second_reference=second, show=show)
        return found.to_dict()

    def _add(self, index: int, differences: Mapping[str, U8] | None = None) -> None:
        layers = {**self._encoded(self._painted(index)), **self._encoded(differences or {})}
        self.frames.append({"number": self._run.numbers[index], "index": index, "layers": layers})

    def _painted(self, index: int) -> dict[str, U8]:
        return painted(self._run.frame(index), self._view, self._run.viewing)

    def _encoded(self, pictures: Mapping[str, U8]) -> dict[str, str]:
        """Pictures encoded as WebP in base64."""
        found = {}
        for layer in LAYERS:
            if layer.name in pictures:
                picture = resized(pictures[layer.name], self.size, is_mixed=not layer.is_overlay)
                found[layer.name] = embedded(picture, is_lossless=layer.is_overlay)
        return found


class _Remarks(Silence):
    """A monitor that adds messages to notes."""

    def __init__(self, notes: list[str]) -> None:
        self._notes = notes

    def message(self, text: str) -> None:
        self._notes.append(text)


class AbsoluteDifference:
    """Mean absolute difference of sRGB-encoded values, percent of white.

    Attributes
    ----------
    map_percent : (H, W) float32
        Of the last frame, mean of the channels.
    """

    name = "absolute"
    map_percent: F32

    def measure(self, pair: DisplayedPair) -> float:
        """Mean difference of the next frame."""
        self.map_percent = np.float32(100.0) * np.abs(pair.test - pair.reference).mean(axis=2)
        return float(self.map_percent.mean())

    def pool(self, values: Sequence[float | None]) -> float:
        """Mean difference of the whole sequence."""
        return float(np.mean([value for value in values if value is not None]))


def _scaled(size: tuple[int, int], factor: float) -> tuple[int, int]:
    width, height = (max(1, round(side * factor)) for side in size)
    return width, height
