"""Sizes of pictures from their headers, before anything of them is decoded."""

from __future__ import annotations

import warnings
from pathlib import Path

from enfilade.errors import ImageError
from enfilade.images.exr import MAGIC, exr_pixels

__all__ = ["PICTURES", "picture_pixels"]

PICTURES = frozenset({".exr", ".png", ".jpg", ".jpeg", ".bmp", ".tga", ".pfm", ".ppm", ".hdr", ".rgbe"})
HEADER = 256  # bytes in which the size of a portable float map must stand
FORMATS = ("PNG", "JPEG", "BMP", "TGA", "PPM")  # Pillow's, of what Mitsuba reads


def picture_pixels(file: Path) -> int:
    """Pixels of a picture that Mitsuba reads, from its header alone.

    Radiance's are not among them: Mitsuba finds their size in its own way (``backends.headers``).

    Raises
    ------
    ImageError
        The file is missing or is no such picture.
    """
    try:
        with file.open("rb") as raw:
            start = raw.read(HEADER)
    except OSError as error:
        raise ImageError(f"can't read {file}: {error.strerror}") from error
    if start.startswith(MAGIC):
        return exr_pixels(file)
    if start[:2] in (b"PF", b"Pf"):
        return _portable(file, start)
    return _other(file)


def _portable(file: Path, start: bytes) -> int:
    # Portable float map: "PF", width, height, and a scale, with white space between them.
    words = start.split(maxsplit=3)
    if len(words) == 4 and words[1].isdigit() and words[2].isdigit():
        return int(words[1]) * int(words[2])
    raise ImageError(f"{file} is a portable float map without a size")


def _other(file: Path) -> int:
    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore", Image.DecompressionBombWarning
            )  # the caller has a bound of its own
            with Image.open(file, formats=FORMATS) as image:
                width, height = image.size
    except (OSError, ValueError, SyntaxError, UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise ImageError(f"{file} is no picture that can be read: {error}") from error
    return int(width) * int(height)
