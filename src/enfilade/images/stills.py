"""Display-referred images: PNG, JPEG, TIFF, TGA, WebP and BMP, read by Pillow; WebP for web pages.

Pillow reduces colours of 16 bits to 8: such PNG and TIFF files are decoded by FFmpeg. FFmpeg is not used for
the rest, because it decodes tiled and JPEG-compressed TIFF to wrong pixels without an error.
"""

from __future__ import annotations

import base64
import contextlib
import struct
import warnings
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import av
import numpy as np
import numpy.typing as npt
from PIL import Image
from PIL.TiffImagePlugin import TiffImageFile

from enfilade.errors import ImageError
from enfilade.kernels.tone import srgb_decode
from enfilade.records import F32, U8

STILL_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".tga", ".webp", ".bmp"})
FORMATS = ("PNG", "JPEG", "TIFF", "TGA", "WEBP", "BMP")  # Pillow's names
PNG_DEPTH = 24  # offset of the bit depth in IHDR, PNG (3rd ed.), 11.2.1
TIFF_BITS, TIFF_PHOTOMETRIC, TIFF_TILE_WIDTH, TIFF_SAMPLE_FORMAT = 258, 262, 322, 339  # tags, TIFF 6.0
TIFF_UNSIGNED = 1  # sample format
TIFF_PLAIN = (1, 2)  # photometric interpretations: grey with 0 as black, R G B
UNREADABLE = (  # raised by Pillow and PyAV on damaged files
    OSError, SyntaxError, ValueError, TypeError, LookupError, ArithmeticError, EOFError, struct.error,
    zlib.error, Image.DecompressionBombError, av.FFmpegError,
)  # fmt: skip
WEBP_QUALITY = 92  # 0 to 100
WEBP_EFFORT = 4  # 0 to 6: beyond it, time grows faster than files shrink
DECODED = srgb_decode(np.arange(256, dtype=np.float32) / np.float32(255.0))  # linear, of each 8-bit value


def read_image(file: Path) -> F32:
    """Read an image of 8 or 16 bits a channel, decoded with the sRGB transfer function.

    Colour profiles and orientation tags of PNG and JPEG are ignored; of several images the first is read.

    Returns
    -------
    (H, W, 3) float32
        Linear Rec.709.

    Raises
    ------
    ImageError
        The file can't be read, is damaged, has more than Pillow's limit of 179 million pixels, another sample
        format, or transparent pixels.
    """
    with _reading(file), Image.open(file, formats=FORMATS) as image:
        decoder = _deep_decoder(file, image)
        rgba = np.asarray(image.convert("RGBA")) if decoder is None else _deep_pixels(file, decoder)
    if (rgba[..., 3] < np.iinfo(rgba.dtype).max).any():
        raise ImageError(f"{file} has transparent pixels; put it over a background first")
    if decoder is None:
        linear: F32 = DECODED[rgba[..., :3]]
        return linear
    return srgb_decode(rgba[..., :3].astype(np.float32) / np.float32(65535.0))


def to_bytes(encoded: F32) -> U8:
    """Encoded values, clipped to 0..1, in 8 bits."""
    values: U8 = np.rint(np.clip(encoded, 0.0, 1.0) * np.float32(255.0)).astype(np.uint8)
    return values


def embedded(image: U8, *, is_lossless: bool = False) -> str:
    """An image as a page holds it: WebP in base64.

    Parameters
    ----------
    image : (H, W, 3) or (H, W, 4) uint8
        sRGB-encoded; the fourth channel is opacity.
    is_lossless
    """
    out, quality = BytesIO(), 50 if is_lossless else WEBP_QUALITY
    Image.fromarray(image).save(out, "WEBP", method=WEBP_EFFORT, quality=quality, lossless=is_lossless)
    return base64.b64encode(out.getvalue()).decode()


def resized(image: U8, size: tuple[int, int], *, is_mixed: bool) -> U8:
    """Scale an image to `size`, (width, height), pixels.

    Parameters
    ----------
    image : (H, W, 3) or (H, W, 4) uint8
    size
    is_mixed
        Average pixels (box filter); otherwise each pixel is one of the image's.
    """
    if (image.shape[1], image.shape[0]) == size:
        return image
    resampling = Image.Resampling.BOX if is_mixed else Image.Resampling.NEAREST
    scaled: U8 = np.asarray(Image.fromarray(image).resize(size, resampling), np.uint8)
    return scaled


@contextlib.contextmanager
def _reading(file: Path) -> Iterator[None]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # unknown TIFF tags; images of more than 89 million pixels
            yield
    except ImageError:
        raise
    except UNREADABLE as error:
        raise ImageError(f"can't read {file}: {error}; write or copy it again") from error


def _deep_decoder(file: Path, image: Image.Image) -> str | None:
    """FFmpeg's decoder of an image of 16 bits a channel; None for 8 bits."""
    if isinstance(image, TiffImageFile):
        return _deep_tiff(file, image)
    if image.format != "PNG":
        return None
    with file.open("rb") as raw:
        return "png" if raw.read(PNG_DEPTH + 1)[PNG_DEPTH] == 16 else None


def _deep_tiff(file: Path, image: TiffImageFile) -> str | None:
    tags = image.tag_v2
    bits = max(tags.get(TIFF_BITS, (1,)))
    is_unsigned = set(tags.get(TIFF_SAMPLE_FORMAT, (TIFF_UNSIGNED,))) == {TIFF_UNSIGNED}
    is_plain = bits == 16 and tags.get(TIFF_PHOTOMETRIC) in TIFF_PLAIN and TIFF_TILE_WIDTH not in tags
    if not is_unsigned or not (bits <= 8 or is_plain):
        raise ImageError(
            f"{file} has {bits} bits a channel in a form that is not supported; write unsigned integers of 8 "
            "bits, or of 16 as grey or R G B without tiles, or OpenEXR"
        )
    return "tiff" if bits == 16 else None


def _deep_pixels(file: Path, decoder: str) -> npt.NDArray[np.uint16]:
    context: Any = av.CodecContext.create(decoder, "r")
    frames = [*context.decode(av.Packet(file.read_bytes())), *context.decode(None)]
    pixels: npt.NDArray[np.uint16] = frames[0].reformat(format="rgba64le").to_ndarray()
    return pixels
