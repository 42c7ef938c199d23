"""The frames of a page: which of them, how large, and encoded, so that the page stays small."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from enfilade.errors import ImageError, RunFolderError
from enfilade.images.stills import encode_webp, resized
from enfilade.images.view import View
from enfilade.monitor import Monitor
from enfilade.records import U8
from enfilade.reports.against import Against, Beside
from enfilade.reports.layers import LAYERS, painted
from enfilade.reports.seen import SeenFrame, SeenRun

__all__ = ["Film", "encode_film"]

PROBES = 5  # frames that tell how large the others will be
WIDEST_PX = 1280  # of a picture on the page
LEAST_WIDTH_PX = 480  # frames are left out before pictures grow narrower than this
CAUTION = 0.9  # part of the room that the probes may fill: other frames may be larger


@dataclass
class Film:
    """Frames as they lie in the page.

    Attributes
    ----------
    size : tuple of int
        Width and height of the pictures, pixels.
    frames : list of dict
        ``number``, ``index``, ``is_raw``, and ``layers``: base64 of a WebP by the layer's name.
    beside : dict of int to dict
        By the frame's number: ``psnr_db``, ``score_jnd``, ``percent_visible``.
    notes : list of str
        What is missing, and why.
    """

    size: tuple[int, int]
    frames: list[dict[str, Any]] = field(default_factory=list)
    beside: dict[int, dict[str, float | None]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    @property
    def layers(self) -> list[str]:
        """Names of the layers that any frame has."""
        return [layer.name for layer in LAYERS if any(layer.name in f["layers"] for f in self.frames)]

    def has_all(self, layer: str) -> bool:
        """Whether every frame has a layer."""
        return all(layer in frame["layers"] for frame in self.frames)


def encode_film(
    seen: SeenRun,
    wanted: Sequence[int],
    against: Against | None,
    view: View,
    monitor: Monitor,
    *,
    room_bytes: float,
) -> Film:
    """Encode frames within a number of bytes.

    Pictures are scaled first, to no less than 480 pixels of width; then frames are left out, evenly. A
    frame that can't be read is left out, and named in the notes.

    Parameters
    ----------
    seen
    wanted
        Indices of frames that are there, rising.
    against
        None: without a reference. Of frames that are left out, the metric judges all the same: what
        flickers is seen in frames that follow each other.
    view
    monitor
    room_bytes
        As text in the page.
    """
    shown_size = (seen.viewing.width_px, seen.viewing.height_px)
    size = _scaled(shown_size, min(1.0, WIDEST_PX / shown_size[0]))
    if not wanted:
        return Film(size, notes=["there is no frame to show yet"])
    each = _probe(seen, wanted, view, size, has_maps=against is not None)
    size, step = _fitted(size, each * len(wanted), room_bytes * CAUTION)
    film = Film(size)
    kept = set(wanted[::step]) | {wanted[-1]}
    monitor.stage("report", len(wanted))
    for frame, beside in _read(seen, wanted, against, film.notes, kept, monitor.advance):
        if beside is not None:
            film.beside[frame.number] = {
                "psnr_db": beside.psnr_db,
                "score_jnd": beside.score_jnd,
                "percent_visible": beside.percent_visible,
            }
        if frame.index in kept:
            pictures = painted(frame, beside, view=view, viewing=seen.viewing)
            film.frames.append(
                {
                    "number": frame.number,
                    "index": frame.index,
                    "is_raw": frame.is_raw,
                    "layers": _encoded(pictures, size),
                }
            )
    if raw := sum(frame["is_raw"] for frame in film.frames):
        film.notes.append(
            f"{raw} frames are shown before they are filtered over time, which the run has still to do"
        )
    is_thinned = step > 1
    while len(film.frames) > 1 and _bytes(film.frames) > room_bytes:
        film.frames, is_thinned = film.frames[::2], True
    if film.size != shown_size:
        before, after = (f"{width}x{height}" for width, height in (shown_size, film.size))
        film.notes.append(f"pictures are scaled from {before} to {after} pixels")
    if is_thinned:
        film.notes.append(
            f"{len(film.frames)} of {len(wanted)} frames are on the page, to keep it small; charts "
            "and tables show all (--max-mb and --frames choose others)"
        )
    return film


def _read(
    seen: SeenRun,
    wanted: Sequence[int],
    against: Against | None,
    notes: list[str],
    kept: set[int],
    advance: Callable[[], None],
) -> Iterator[tuple[SeenFrame, Beside | None]]:
    for index in wanted:
        advance()
        if against is None and index not in kept:
            continue
        try:
            frame = seen.frame(index)
        except (ImageError, RunFolderError) as error:
            notes.append(f"frame {seen.numbers[index]} is left out: {error}")
            continue
        try:
            beside = None if against is None else against.beside(frame)
        except (ImageError, RunFolderError) as error:
            notes.append(f"frame {frame.number} is shown without the reference: {error}")
            beside = None
        yield frame, beside


def _probe(
    seen: SeenRun, wanted: Sequence[int], view: View, size: tuple[int, int], *, has_maps: bool
) -> float:
    """Bytes that a frame will take, as text."""
    count = min(PROBES, len(wanted))
    chosen = sorted({wanted[round(i * (len(wanted) - 1) / max(count - 1, 1))] for i in range(count)})
    found = []
    for index in chosen:
        try:
            pictures = painted(seen.frame(index), None, view=view, viewing=seen.viewing)
        except (ImageError, RunFolderError):  # said when the frame's turn comes
            continue
        sizes = {name: len(text) for name, text in _encoded(pictures, size).items()}
        # Maps of differences are about as hard to encode as the image.
        found.append(sum(sizes.values()) + (2 * sizes["result"] if has_maps else 0))
    return max(found, default=0.0)


def _fitted(size: tuple[int, int], total: float, room: float) -> tuple[tuple[int, int], int]:
    if total <= room:
        return size, 1
    factor = max(math.sqrt(room / total), min(1.0, LEAST_WIDTH_PX / size[0]))
    left = total * factor**2
    return _scaled(size, factor), max(1, math.ceil(left / room))


def _scaled(size: tuple[int, int], factor: float) -> tuple[int, int]:
    width, height = (max(1, round(side * factor)) for side in size)
    return width, height


def _encoded(pictures: Mapping[str, U8], size: tuple[int, int]) -> dict[str, str]:
    found = {}
    for layer in LAYERS:
        if layer.name in pictures:
            picture = resized(pictures[layer.name], size, is_mixed=not layer.is_overlay)
            found[layer.name] = base64.b64encode(encode_webp(picture, quality=layer.quality)).decode()
    return found


def _bytes(frames: Sequence[Mapping[str, Any]]) -> int:
    return sum(len(text) for frame in frames for text in frame["layers"].values())
