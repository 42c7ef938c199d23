"""Layers of pixels <-> OpenEXR files, the one file that names OpenEXR.

A layer is an array: (H, W) is one channel, (H, W, 2) are ``.u .v``, (H, W, 3) are ``.X .Y .Z`` for
positions and normals (``P``, ``N``) and ``.R .G .B`` for the rest; the layer ``RGB`` has no prefix.
"""

from __future__ import annotations

import contextlib
import functools
import io
import os
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import OpenEXR

from enfilade.errors import ImageError
from enfilade.files import whole_file

__all__ = ["Array", "color_layers", "exr_pixels", "is_exr", "read_attributes", "read_exr", "write_exr"]

Array = npt.NDArray[Any]

MOST_THREADS = 8  # that pack pixels
MAX_PIXELS = 1 << 28  # of a file that is read: 16384 x 16384; checked before memory is taken
MAGIC = b"\x76\x2f\x31\x01"  # first bytes of every OpenEXR file
DIRECTIONS = frozenset({"P", "N"})  # layers whose three channels are X Y Z
STACKS = ("RGB", "XYZ", "uv")  # last letters of channels that make one layer
STANDARD = frozenset(
    {
        "channels", "chunkCount", "compression", "dataWindow", "displayWindow", "lineOrder", "name",
        "pixelAspectRatio", "screenWindowCenter", "screenWindowWidth", "tiles", "type", "version", "view",
    }
)  # fmt: skip


def write_exr(
    file: Path,
    layers: Mapping[str, Array],
    *,
    attributes: Mapping[str, str | float | int | Fraction] | None = None,
    is_portable: bool = False,
) -> None:
    """Write layers as one OpenEXR file of scan lines: the same input, the same bytes.

    Parameters
    ----------
    file
    layers : mapping of str to (H, W), (H, W, 2) or (H, W, 3) float16, float32 or uint32
        All of one size. The dtype is kept: half, float or uint. ``""`` is ``RGB``.
    attributes
        Of the header. Numbers lose what does not fit in 32 bits; a string keeps everything. A fraction is a
        rational, as ``framesPerSecond`` has to be.
    is_portable
        Packed by PXR24, which every program reads: floats are rounded to 16 significant bits, half floats and
        integers stay what they are. Otherwise exactly, by HTJ2K, in half the time of ZIP, but
        few programs read that yet.

    Raises
    ------
    ValueError
        An array of another shape or dtype, or an attribute that OpenEXR itself needs.
    RunFolderError, NoSpaceError
        The file can't be written. No partial file is left.
    """
    channels = _channels(layers)
    extra = dict(attributes or {})
    if taken := STANDARD.intersection(extra):
        raise ValueError(f"OpenEXR keeps these attributes for itself: {', '.join(sorted(taken))}")
    compression = OpenEXR.PXR24_COMPRESSION if is_portable else OpenEXR.HTJ2K256_COMPRESSION
    header = {"compression": compression, "type": OpenEXR.scanlineimage, **extra}
    _start_threads()
    packed = io.BytesIO()  # a file of its own OpenEXR cuts short without a word where the disk is full
    with OpenEXR.File(header, channels) as image:
        image.write(packed)
    with whole_file(file) as beside:
        beside.write_bytes(packed.getbuffer())


def read_exr(file: Path, *, max_pixels: int = MAX_PIXELS) -> dict[str, Array]:
    """Read all layers of an OpenEXR file, also of a foreign one.

    Parameters
    ----------
    file
    max_pixels
        Larger images are refused before memory is taken for them.

    Returns
    -------
    dict of str to (H, W), (H, W, 2) or (H, W, 3) array
        Channels that end in R G B, X Y Z or u v, of one size, are one layer, named by what stands before;
        half and float together become float. Every other channel is a layer of its own, with its full
        name. The size is that of the display window; outside the data window is 0. Parts of a multi-part
        file come together: a channel without a layer's name of its own has its part's in front (`R` of
        the part `beauty` belongs to the layer ``beauty``), and so has one that several parts share.

    Raises
    ------
    ImageError
        The file is missing, is no OpenEXR, is cut off or damaged, too large, or holds deep data.
    """
    headers = _part_headers(file)
    for header in headers:
        _check_part(file, header, max_pixels)
    channels: dict[str, Array] = {}
    full = _full_names(headers)
    with _failures(file), OpenEXR.File(str(file), separate_channels=True) as image:
        for index, header in enumerate(headers):
            for name, channel in image.channels(index).items():
                channels[full[index, name]] = _placed(np.asarray(channel.pixels), header)
    return _layers(channels)


def color_layers(file: Path) -> tuple[str, ...]:
    """Names of the layers of R G B, as :func:`read_exr` names them, from the headers alone.

    Raises
    ------
    ImageError
        The file is missing, is no OpenEXR, or its headers are damaged.
    """
    names = dict.fromkeys(_full_names(_part_headers(file)).values())
    prefixes = [name[:-1] for name in names if name.rpartition(".")[2] == "R"]
    return tuple(p.rstrip(".") or "RGB" for p in prefixes if {f"{p}G", f"{p}B"} <= set(names))


def is_exr(file: Path) -> bool:
    """Whether a file begins as OpenEXR files do, whatever it is called.

    Raises
    ------
    OSError
        It can't be read.
    """
    with file.open("rb") as raw:
        return raw.read(len(MAGIC)) == MAGIC


def exr_pixels(file: Path) -> int:
    """Pixels of an OpenEXR file, the largest window of all parts, from its headers alone.

    Raises
    ------
    ImageError
        The file is missing, is no OpenEXR, or its headers are damaged.
    """
    sizes = [_size(header[w]) for header in _part_headers(file) for w in ("dataWindow", "displayWindow")]
    return max(height * width for height, width in sizes)


def read_attributes(file: Path) -> dict[str, Any]:
    """Attributes in the header of an OpenEXR file's first part, those that every file has left out.

    Raises
    ------
    ImageError
        The file is missing, is no OpenEXR, or its header is damaged.
    """
    return {name: value for name, value in _part_headers(file)[0].items() if name not in STANDARD}


@functools.cache
def _start_threads() -> None:
    """Let OpenEXR pack several blocks of lines at a time; it does not by itself."""
    OpenEXR.set_global_thread_count(min(len(os.sched_getaffinity(0)), MOST_THREADS))


def _channels(layers: Mapping[str, Array]) -> dict[str, Array]:
    channels: dict[str, Array] = {}
    for name, array in layers.items():
        if array.dtype not in (np.float16, np.float32, np.uint32):
            raise ValueError(f"layer {name!r}: float16, float32 or uint32 can be written, not {array.dtype}")
        # OpenEXR ignores strides: a view of one component would be written as the wrong pixels
        planes = [np.ascontiguousarray(plane) for plane in _planes(name, array)]
        channels.update(zip(_suffixed(name, array), planes, strict=True))
    sizes = {plane.shape for plane in channels.values()}
    if len(sizes) != 1 or 0 in next(iter(sizes)):
        raise ValueError(f"layers of one size that is not 0 can be written, not {sorted(sizes)}")
    return channels


def _planes(name: str, array: Array) -> list[Array]:
    if array.ndim == 2:
        return [array]
    if array.ndim != 3 or array.shape[2] not in (2, 3) or (name in ("", "RGB") and array.shape[2] != 3):
        raise ValueError(f"layer {name!r}: no way to write an array of shape {array.shape}")
    return list(np.moveaxis(array, 2, 0))


def _suffixed(name: str, array: Array) -> list[str]:
    if array.ndim == 2:
        return [name]
    if name in ("", "RGB"):
        return ["R", "G", "B"]
    letters = "uv" if array.shape[2] == 2 else "XYZ" if name in DIRECTIONS else "RGB"
    return [f"{name}.{letter}" for letter in letters]


def _layers(channels: Mapping[str, Array]) -> dict[str, Array]:
    layers: dict[str, Array] = {}
    rest = dict(channels)
    for name in channels:
        prefix, _, letter = name.rpartition(".")
        stack = next((s for s in STACKS if letter and letter == s[0]), None)
        names = [f"{prefix}.{end}" if prefix else end for end in stack or ()]
        planes = [channels[n] for n in names if n in channels]
        if names and len(planes) == len(names) and _are_alike(planes):
            layers[prefix or str(stack)] = np.stack(planes, axis=2)
            for used in names:
                del rest[used]
    return {**layers, **rest}


def _are_alike(planes: list[Array]) -> bool:
    return len({(plane.shape, plane.dtype.kind) for plane in planes}) == 1  # half and float are of one kind


def _full_names(headers: list[dict[str, Any]]) -> dict[tuple[int, str], str]:
    """Names of channels by part and own name, with that of the part in front where it is needed."""
    own = [(part, name) for part, header in enumerate(headers) for name in header["channels"]]
    if len(headers) == 1:
        return {(part, name): name for part, name in own}
    counts = Counter(name for _, name in own)
    prefixes = [f"{header.get('name', part)}." for part, header in enumerate(headers)]
    needed = {(part, name) for part, name in own if "." not in name or counts[name] > 1}
    return {(part, name): prefixes[part] + name if (part, name) in needed else name for part, name in own}


def _part_headers(file: Path) -> list[dict[str, Any]]:
    try:
        if not is_exr(file):
            raise ImageError(f"{file} is no OpenEXR file")
    except OSError as error:
        raise ImageError(f"can't read {file}: {error.strerror}") from error
    with _failures(file), OpenEXR.File(str(file), separate_channels=True, header_only=True) as image:
        headers = [dict(part.header) for part in image.parts]
        for header in headers:
            header["channels"] = [str(channel.name) for channel in header["channels"]]
    if not headers:
        raise _damaged(file, "no part in it")
    return headers


def _check_part(file: Path, header: Mapping[str, Any], max_pixels: int) -> None:
    if header.get("type") in (OpenEXR.deepscanline, OpenEXR.deeptile):
        raise ImageError(f"{file} holds deep data; flatten it first")
    for window in ("dataWindow", "displayWindow"):
        height, width = _size(header[window])
        if height * width > max_pixels:
            raise ImageError(f"{file} has {width}x{height} pixels; at most {max_pixels} are read")


def _size(window: tuple[Array, Array]) -> tuple[int, int]:
    (left, top), (right, bottom) = (corner.tolist() for corner in window)
    return bottom - top + 1, right - left + 1


def _placed(pixels: Array, header: Mapping[str, Any]) -> Array:
    data, display = header["dataWindow"], header["displayWindow"]
    if all(np.array_equal(a, b) for a, b in zip(data, display, strict=True)) or pixels.shape != _size(data):
        return pixels
    whole = np.zeros(_size(display), pixels.dtype)
    left, top = (data[0] - display[0]).tolist()
    rows = slice(max(top, 0), min(top + pixels.shape[0], whole.shape[0]))
    columns = slice(max(left, 0), min(left + pixels.shape[1], whole.shape[1]))
    if rows.start < rows.stop and columns.start < columns.stop:
        whole[rows, columns] = pixels[
            rows.start - top : rows.stop - top, columns.start - left : columns.stop - left
        ]
    return whole


@contextlib.contextmanager
def _failures(file: Path) -> Iterator[None]:
    # On damaged pixels OpenEXR prints a warning on Python's stdout, which belongs to results, and
    # raises no sooner than when the channels are asked for.
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    except (RuntimeError, ValueError, TypeError, KeyError) as error:
        if isinstance(error, ImageError):
            raise
        if (reason := _unreadable(file)) is not None:  # which OpenEXR doesn't say
            raise ImageError(f"can't read {file}: {reason.strerror}") from reason
        raise _damaged(file, str(error)) from error


def _unreadable(file: Path) -> OSError | None:
    try:
        with file.open("rb") as raw:
            while raw.read(1 << 20):
                pass
    except OSError as error:
        return error
    return None


def _damaged(file: Path, reason: str) -> ImageError:
    return ImageError(f"{file} is cut off or damaged ({reason}); write or copy it again")
