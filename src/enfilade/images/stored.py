"""Image files as a sequence: OpenEXR; PNG, TIFF and PPM of 8 or 16 bits; JPEG, TGA, WebP, BMP."""

from __future__ import annotations

import contextlib
import re
import struct
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from PIL.TiffImagePlugin import TiffImageFile

from enfilade.errors import ImageError
from enfilade.images import read_attributes, read_exr
from enfilade.images.beauty import choose_layer, picture_in
from enfilade.images.decode import deep_pixels
from enfilade.kernels.tone import srgb_decode
from enfilade.records import F32

__all__ = ["SUFFIXES", "ImageFiles"]

FORMATS = {  # Pillow's, by suffix; PNG and JPEG are taken for each other
    ".png": ("PNG", "JPEG"), ".jpg": ("JPEG", "PNG"), ".jpeg": ("JPEG", "PNG"), ".tif": ("TIFF",),
    ".tiff": ("TIFF",), ".tga": ("TGA",), ".webp": ("WEBP",), ".bmp": ("BMP",), ".ppm": ("PPM",),
}  # fmt: skip
SUFFIXES = frozenset({".exr", *FORMATS})
MAX_PIXELS = 1 << 28  # of an image; checked before memory is taken
HEADER = 1 << 16  # bytes in which the depth of a PNG or PPM is looked for
PNG_DEPTH = re.compile(rb"\x89PNG\r\n\x1a\n.{16}\x10", re.DOTALL)  # 16 in IHDR, PNG (3rd ed.), 11.2.1
PPM_LARGEST = re.compile(rb"P[2356](?:(?:\s|#[^\n]*\n)+(\d+)){3}")  # the third number: the largest value
TIFF_BITS, TIFF_PHOTOMETRIC, TIFF_SAMPLES = 258, 262, 339  # tags, TIFF 6.0
TIFF_PLAIN = (1, 2)  # photometric interpretations: 0 is black, R G B
TIFF_UNSIGNED = 1  # sample format
UNREADABLE = (  # what Pillow raises on damaged files
    OSError, EOFError, SyntaxError, ValueError, TypeError, LookupError, ArithmeticError, struct.error,
    zlib.error,
)  # fmt: skip
REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)  # ITU-R BT.709-6, item 1.3-1.4: R G B white
CHROMATICITY_TOLERANCE = 0.005
DECODED = srgb_decode(np.arange(256, dtype=np.float32) / np.float32(255.0))  # linear, of each 8-bit value


class ImageFiles:
    """Image files of one size, read one by one.

    OpenEXR is taken as it is: linear Rec.709, and premultiplied, that is, over black. All others are
    decoded with sRGB's transfer; embedded colour profiles are not looked at. What has transparency is
    refused. Of a file that holds several images the first is taken.

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
    layer
        Of OpenEXR files, see :func:`~enfilade.images.beauty.choose_layer`; the same in all of them.

    Attributes
    ----------
    files : list of Path
    width, height : int
        Of the first image, pixels.
    fps, exposure_ev : float or None
    numbers : tuple of int or None
    starts : frozenset of int or None
    note : str
        Which layer was taken, where that is not plain; else empty.

    Raises
    ------
    ImageError
        The first image can't be read, or nothing tells which of its layers is the picture.
    """

    def __init__(
        self,
        files: list[Path],
        fps: float | None = None,
        exposure_ev: float | None = None,
        *,
        numbers: tuple[int, ...] | None = None,
        starts: frozenset[int] | None = None,
        layer: str | None = None,
    ) -> None:
        self.files = files
        self.fps = fps
        self.exposure_ev = exposure_ev
        self.numbers = numbers
        self.starts = starts
        self._held: tuple[Path, dict[str, Any]] | None = None  # of the frame last read, once layers are used
        self._layer = self.note = ""
        if files[0].suffix.lower() == ".exr":
            _check_primaries(files[0])
            self._layer, self.note = choose_layer(files[0], layer)
        self.height, self.width = self._read(files[0]).shape[:2]

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
        """All layers of an OpenEXR frame, see :func:`~enfilade.images.read_exr`.

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
        if file.suffix.lower() != ".exr":
            return _linear(file)
        layers = read_exr(file)
        if self._held is not None:
            self._held = file, layers
        return picture_in(file, layers, self._layer)


def _linear(file: Path) -> F32:
    with _opened(file) as image:
        _check_size(file, image.width, image.height)
        demuxer = _deep_demuxer(file, image)
        if demuxer is None:
            pixels = np.asarray(image.convert("RGBA"))
    if demuxer is not None:
        return srgb_decode(_opaque(file, deep_pixels(file, demuxer)))
    if (pixels[..., 3] < 255).any():
        raise _transparent(file)
    decoded: F32 = DECODED[pixels[..., :3]]
    return decoded


@contextlib.contextmanager
def _opened(file: Path) -> Iterator[Image.Image]:
    limit = Image.MAX_IMAGE_PIXELS
    Image.MAX_IMAGE_PIXELS = None  # Pillow's is below ours, which is checked before anything is decoded
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of TIFF tags that it skips
            with Image.open(file, formats=FORMATS[file.suffix.lower()]) as image:
                yield image
    except ImageError:
        raise
    except UNREADABLE as error:
        raise ImageError(f"can't read {file}: {error}; write or copy it again") from error
    finally:
        Image.MAX_IMAGE_PIXELS = limit


def _deep_demuxer(file: Path, image: Image.Image) -> str | None:
    """FFmpeg's name of the format where a channel has more than 8 bits; None where Pillow keeps them all."""
    if isinstance(image, TiffImageFile):
        return _deep_tiff(file, image)
    with file.open("rb") as data:
        start = data.read(HEADER)
    if PNG_DEPTH.match(start):
        return "png_pipe"
    largest = PPM_LARGEST.match(start) if image.format == "PPM" else None
    if largest and int(largest[1]) > 255:
        return "ppm_pipe"
    if image.mode in ("I", "F") or image.mode.startswith("I;"):
        raise ImageError(f"{file} has pixels of another kind than 8 or 16 bits ({image.mode}); convert it")
    return None


def _deep_tiff(file: Path, image: TiffImageFile) -> str | None:
    bits = max(image.tag_v2.get(TIFF_BITS, (1,)))
    kinds = set(image.tag_v2.get(TIFF_SAMPLES, (TIFF_UNSIGNED,)))
    if kinds != {TIFF_UNSIGNED} or not (bits <= 8 or bits == 16):
        raise ImageError(
            f"{file} has {bits} bits a channel that are no whole numbers of 8 or 16; write it as OpenEXR"
        )
    if bits == 16 and image.tag_v2.get(TIFF_PHOTOMETRIC) not in TIFF_PLAIN:
        raise ImageError(f"{file} has 16 bits a channel and is neither grey nor R G B; convert it")
    return "tiff_pipe" if bits == 16 else None


def _check_size(file: Path, width: int, height: int) -> None:
    if width * height > MAX_PIXELS:
        raise ImageError(f"{file} has {width}x{height} pixels; at most {MAX_PIXELS} are read")


def _opaque(file: Path, rgba: F32) -> F32:
    if (rgba[..., 3] < 1.0).any():
        raise _transparent(file)
    return rgba[..., :3]


def _transparent(file: Path) -> ImageError:
    return ImageError(f"{file} has transparent pixels; put it over a background first")


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
