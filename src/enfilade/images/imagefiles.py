"""Image files as a sequence: OpenEXR, and the display-referred formats of :mod:`enfilade.images.stills`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.errors import ImageError
from enfilade.images.beauty import beauty, choose_layer
from enfilade.images.exr import read_attributes, read_exr
from enfilade.images.stills import STILL_SUFFIXES, read_image
from enfilade.records import F32
from enfilade.settings import VideoSettings

SUFFIXES = STILL_SUFFIXES | {".exr"}
REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)  # ITU-R BT.709-6, item 1.3-1.4: R G B white
CHROMATICITY_TOLERANCE = 0.005


@dataclass(eq=False)
class ImageFiles:
    """Image files of one size as a sequence, read one by one: memory does not grow with their number.

    OpenEXR is read as linear Rec.709, premultiplied, that is, over black.

    Attributes
    ----------
    files : list of Path
        In order, at least one.
    fps : float or None
        Mean frames per second; by default ``framesPerSecond`` of the first OpenEXR file. None if unknown.
    exposure_ev : float or None
        Stops with which a run's frames are shown, which are scene-linear; None if it is no run.
    numbers : tuple of int or None
        Of the frames, rising; None if unknown.
    starts : frozenset of int or None
        Of a run: indices of frames that do not follow the one before. None if unknown.
    identity : mapping or None
        Of a run: everything on which its frames depend, as ``run.json`` has it. None if unknown.
    view : VideoSettings or None
        Of a run: ``ocio``, ``view``, ``look`` and ``display`` of its video. None if unknown.
    layer : str or None
        Of all OpenEXR files, see :func:`~enfilade.images.beauty.choose_layer`.
    width, height : int
        Pixels.
    note : str
        The choice of a layer, where there are others; else empty.

    Raises
    ------
    ImageError
        The first image can't be read, or has several layers that may be the beauty.
    """

    files: list[Path]
    fps: float | None = None
    exposure_ev: float | None = None
    numbers: tuple[int, ...] | None = None
    starts: frozenset[int] | None = None
    identity: Any = None
    view: VideoSettings | None = None
    layer: str | None = None

    def __post_init__(self) -> None:
        self._last: tuple[Path | None, dict[str, Any]] = None, {}  # OpenEXR frame read last
        self._beauty = self.note = ""
        if self.files[0].suffix.lower() == ".exr":
            attributes = read_attributes(self.files[0])
            _check_primaries(self.files[0], attributes)
            if self.fps is None:
                self.fps = _fps_of(attributes)
            self._beauty, self.note = choose_layer(self.files[0], self.layer)
        self.height, self.width = self._read(self.files[0]).shape[:2]

    def __len__(self) -> int:
        return len(self.files)

    def __iter__(self) -> Iterator[F32]:
        """Images as (H, W, 3) float32 linear Rec.709, in order; a second iteration starts again."""
        for file in self.files:
            linear = self._read(file)
            height, width = linear.shape[:2]
            if (height, width) != (self.height, self.width):
                raise ImageError(
                    f"{file} has {width}x{height} pixels, the first image {self.files[0].name} "
                    f"{self.width}x{self.height}; a sequence has one size"
                )
            yield linear

    def name(self, index: int) -> str:
        """Name of a frame, for messages."""
        return str(self.files[index])

    def layers(self, index: int) -> dict[str, Any]:
        """All layers of an OpenEXR frame, as of :func:`~enfilade.images.read_exr`; the last are kept."""
        return self._layers_of(self.files[index])

    def _layers_of(self, file: Path) -> dict[str, Any]:
        if self._last[0] != file:
            self._last = file, read_exr(file)
        return self._last[1]

    def _read(self, file: Path) -> F32:
        if file.suffix.lower() != ".exr":
            return read_image(file)
        return beauty(file, self._layers_of(file), self._beauty)


def _fps_of(attributes: Mapping[str, Any]) -> float | None:
    rate = attributes.get("framesPerSecond")
    return float(rate) if isinstance(rate, Fraction) and rate > 0 else None


def _check_primaries(file: Path, attributes: Mapping[str, Any]) -> None:
    stated = attributes.get("chromaticities")
    if stated is None:
        return
    values = np.ravel(np.asarray(stated, np.float64))
    if values.shape != (8,) or np.abs(values - REC709).max() > CHROMATICITY_TOLERANCE:
        raise ImageError(
            f"{file} states primaries other than those of Rec.709 ({values}); convert it to linear Rec.709"
        )
