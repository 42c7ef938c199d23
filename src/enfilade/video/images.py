"""Image files as a sequence: OpenEXR, PNG of 8 or 16 bits, JPEG."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from enfilade.codec import read_attributes, read_exr
from enfilade.errors import ImageError
from enfilade.pixels.tone import srgb_decode
from enfilade.records import F32
from enfilade.video.decode import deep_png

__all__ = ["SUFFIXES", "ImageFiles"]

SUFFIXES = frozenset({".exr", ".png", ".jpg", ".jpeg"})
MAX_PIXELS = 1 << 28  # of an image; checked before memory is taken
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
PNG_DEPTH_BYTE = 24  # of the file: bit depth in IHDR, PNG (3rd ed.), 11.2.1
REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)  # ITU-R BT.709-6, item 1.3-1.4: R G B white
CHROMATICITY_TOLERANCE = 0.005
DECODED = srgb_decode(np.arange(256, dtype=np.float32) / np.float32(255.0))  # linear, of each 8-bit value


class ImageFiles:
    """Image files of one size, read one by one.

    OpenEXR is taken as it is: linear Rec.709, and premultiplied, that is, over black. PNG and JPEG are
    decoded with sRGB's transfer; embedded colour profiles are not looked at. PNG with transparency is
    refused.

    Parameters
    ----------
    files : list of Path
        In order, at least one.
    fps
        Frames per second, None if unknown.
    exposure_ev
        Stops with which a run's frames are shown, None if it is no run.
    numbers
        Of the frames, rising; None if unknown.
    starts
        Indices of frames that do not follow the one before, None if unknown.

    Attributes
    ----------
    files : list of Path
    width, height : int
        Of the first image, pixels.
    fps, exposure_ev : float or None
    numbers : tuple of int or None
    starts : frozenset of int or None

    Raises
    ------
    ImageError
        The first image can't be read.
    """

    def __init__(
        self,
        files: list[Path],
        fps: float | None = None,
        exposure_ev: float | None = None,
        *,
        numbers: tuple[int, ...] | None = None,
        starts: frozenset[int] | None = None,
    ) -> None:
        self.files = files
        self.fps = fps
        self.exposure_ev = exposure_ev
        self.numbers = numbers
        self.starts = starts
        self._held: tuple[Path, dict[str, Any]] | None = None  # of the frame last read, once layers are used
        if files[0].suffix.lower() == ".exr":
            _check_primaries(files[0])
        self.height, self.width = _linear(files[0]).shape[:2]

    def __len__(self) -> int:
        return len(self.files)

    def __iter__(self) -> Iterator[F32]:
        """Images as (H, W, 3) float32 linear Rec.709, in order; a second iteration begins anew."""
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
        """All layers of an OpenEXR frame, see :func:`~enfilade.codec.read_exr`.

        Those of the frame that the iteration has just given are not read again.

        Raises
        ------
        ImageError
            It is no OpenEXR file, or damaged.
        """
        if self._held is None or self._held[0] != self.files[index]:
            self._held = self.files[index], read_exr(self.files[index])
        return self._held[1]

    def _read(self, file: Path) -> F32:
        if self._held is None:
            return _linear(file)
        self._held = file, read_exr(file)
        return _from_exr(file, self._held[1])


def _linear(file: Path) -> F32:
    if file.suffix.lower() == ".exr":
        return _from_exr(file, read_exr(file))
    return srgb_decode(_opaque(file, deep_png(file))) if _is_deep_png(file) else _from_pillow(file)


def _from_exr(file: Path, layers: dict[str, Any]) -> F32:
    combined = [n for n in layers if n.lower().endswith("combined") and layers[n].ndim == 3]
    name = "RGB" if "RGB" in layers else combined[0] if len(combined) == 1 else None
    if name is not None and layers[name].dtype != np.uint32:
        rgb: F32 = layers[name].astype(np.float32, copy=False)
        return rgb
    if "Y" in layers and not {"RY", "BY"} & set(layers):
        return np.repeat(layers["Y"].astype(np.float32)[..., None], 3, axis=2)
    raise ImageError(f"{file} has no channels R G B; it has the layers {', '.join(layers)}")


def _from_pillow(file: Path) -> F32:
    try:
        with Image.open(file, formats=("PNG", "JPEG")) as image:
            _check_size(file, image.width, image.height)
            pixels = np.asarray(image.convert("RGBA"))
    except (OSError, SyntaxError, EOFError, struct.error, zlib.error, Image.DecompressionBombError) as error:
        raise ImageError(f"can't read {file}: {error}; write or copy it again") from error
    if (pixels[..., 3] < 255).any():
        raise _transparent(file)
    decoded: F32 = DECODED[pixels[..., :3]]
    return decoded


def _check_size(file: Path, width: int, height: int) -> None:
    if width * height > MAX_PIXELS:
        raise ImageError(f"{file} has {width}x{height} pixels; at most {MAX_PIXELS} are read")


def _opaque(file: Path, rgba: F32) -> F32:
    if (rgba[..., 3] < 1.0).any():
        raise _transparent(file)
    return rgba[..., :3]


def _transparent(file: Path) -> ImageError:
    return ImageError(f"{file} has transparent pixels; put it over a background first")


def _is_deep_png(file: Path) -> bool:
    try:
        with file.open("rb") as data:
            start = data.read(PNG_DEPTH_BYTE + 1)
    except OSError as error:
        raise ImageError(f"can't read {file}: {error.strerror}") from error
    return start.startswith(PNG_SIGNATURE) and start[PNG_DEPTH_BYTE:] == b"\x10"


def _check_primaries(file: Path) -> None:
    stated = read_attributes(file).get("chromaticities")
    if stated is None:
        return
    values = np.ravel(np.asarray(stated, np.float64))
    if values.shape != (8,) or np.abs(values - REC709).max() > CHROMATICITY_TOLERANCE:
        raise ImageError(
            f"{file} says that its primaries are not those of Rec.709 ({values}); "
            "convert it to linear Rec.709"
        )
