"""Sizes that a scene's files claim in their headers, found as Mitsuba finds them: by what is in a file.

A header that Mitsuba and another reader would understand differently is refused.
"""

from __future__ import annotations

import re
import struct
from math import prod
from pathlib import Path

from enfilade.errors import ImageError, SceneError
from enfilade.images.exr import MAGIC
from enfilade.images.stills import MITSUBA_SUFFIXES, image_pixels

__all__ = ["check_volume", "mesh_elements", "pixels"]

HEADER = 1 << 16  # bytes in which the header of a mesh or of a Radiance picture must end
KINDS = (b"\x89PNG\r\n\x1a\n", b"\xff\xd8", b"BM", b"PF", b"Pf", b"P6", b"#?", MAGIC)
TARGA_END = b"TRUEVISION-XFILE.\0"
TARGA = struct.Struct("<12x2H")  # width, height
VOLUME = struct.Struct("<4sI4I6f")  # "VOL", version 3; kind of number, three sides and channels, a box
PLY_WORDS = (b"ply", b"format", b"comment", b"obj_info", b"property")


def pixels(file: Path) -> int:
    """Pixels of a picture; 0 where a file is none, whatever it is called.

    Raises
    ------
    ImageError
        It is called a picture and is none, or its header is damaged.
    """
    with file.open("rb") as raw:
        start = raw.read(HEADER)
        raw.seek(max(0, file.stat().st_size - len(TARGA_END)))
        end = raw.read()
    if start.startswith(b"#?"):
        return _radiance(file, start)
    if start.startswith((b"PF", b"Pf")) and not start[2:3].isspace():
        raise ImageError(f"{file} is a portable float map whose header is damaged")
    if start.startswith(KINDS):
        return image_pixels(file)
    if end == TARGA_END and len(start) >= TARGA.size:
        return prod(TARGA.unpack_from(start))
    return image_pixels(file) if file.suffix.lower() in MITSUBA_SUFFIXES else 0


def check_volume(file: Path) -> None:
    """Refuse a grid of Mitsuba's own format that claims more numbers than its file has.

    Raises
    ------
    SceneError
    """
    with file.open("rb") as raw:
        start = raw.read(VOLUME.size)
    if not start.startswith(b"VOL\x03"):
        return
    if len(start) < VOLUME.size:
        raise SceneError(f"{file} is a volume whose header is damaged")
    numbers = prod(VOLUME.unpack(start)[2:6])
    if VOLUME.size + 4 * numbers > file.stat().st_size:
        raise SceneError(f"{file} says that it has {numbers} numbers, but is too short for them")


def mesh_elements(file: Path) -> dict[str, int]:
    """How many vertices, faces and other elements a PLY mesh has.

    Raises
    ------
    SceneError
        The file is no such mesh, or its header is damaged.
    """
    with file.open("rb") as raw:
        start = raw.read(HEADER)
    counts: dict[str, int] = {}
    for line in start.split(b"\n"):
        match line.split():
            case [b"end_header"]:
                break
            case [b"element", name, count] if re.fullmatch(rb"[0-9]{1,18}", count):
                kind = name.decode(errors="replace")
                counts[kind] = counts.get(kind, 0) + int(count)
            case [word, *_] if word not in PLY_WORDS:
                raise _damaged(file)
    else:
        raise _damaged(file)
    return counts


def _radiance(file: Path, start: bytes) -> int:
    # The first line like "-Y 480 +X 640": Mitsuba doesn't wait for the empty line before it.
    for line in start.split(b"\n")[1:]:
        match line.replace(b",", b" ").split():
            case [b"-Y", height, b"+X", width] if height.isdigit() and width.isdigit():
                return int(height) * int(width)
            case [b"-Y", _, b"+X", _]:
                break
    raise ImageError(f"{file} is a Radiance picture without a size")


def _damaged(file: Path) -> SceneError:
    return SceneError(f"{file} is no PLY mesh, or its header is damaged")
