"""Layers of pixels <-> OpenEXR files.

A layer is an array: (H, W) is one channel, (H, W, 2) the channels ``.u .v``, (H, W, 3) the channels
``.X .Y .Z`` for positions and normals (``P``, ``N``) and ``.R .G .B`` for the rest; the layer ``RGB`` has no
prefix.
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

Array = npt.NDArray[Any]

MAX_THREADS = 8  # that compress pixels
MAX_PIXELS = 1 << 28  # 16384 x 16384; checked before memory is taken for what a damaged header claims
MAGIC = b"\x76\x2f\x31\x01"  # first bytes of every OpenEXR file
VECTORS = frozenset({"P", "N"})  # layers whose three channels are X Y Z
GROUPS = ("RGB", "XYZ", "uv")  # last letters of the channels that make one layer
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
    """Write layers as one OpenEXR file of scan lines; the same input gives the same bytes.

    Parameters
    ----------
    file
    layers : mapping of str to (H, W), (H, W, 2) or (H, W, 3) float16, float32 or uint32
        All of one size. The type is kept: half, float or uint. ``""`` is ``RGB``.
    attributes
        Of the header. Numbers are stored in 32 bits, a fraction as a rational (``framesPerSecond``).
    is_portable
        Compress with PXR24, which every program reads: floats are rounded to 16 significant bits, half floats
        and integers are exact. Otherwise with HTJ2K: exact, in half the time of ZIP, but few programs read
        it.

    Raises
    ------
    ValueError
        An array of another shape or type, or an attribute that OpenEXR itself writes.
    RunFolderError, NoSpaceError
        The file can't be written. No partial file is left.
    """
    channels = _channels(layers)
    if reserved := STANDARD.intersection(attributes or {}):
        raise ValueError(f"attributes that OpenEXR itself writes: {', '.join(sorted(reserved))}")
    compression = OpenEXR.PXR24_COMPRESSION if is_portable else OpenEXR.HTJ2K256_COMPRESSION
    header = {"compression": compression, "type": OpenEXR.scanlineimage, **(attributes or {})}
    _start_threads()
    packed = io.BytesIO()  # on a full disk, OpenEXR leaves a partial file without an error
    with OpenEXR.File(header, channels) as image:
        image.write(packed)
    with whole_file(file) as temporary:
        temporary.write_bytes(packed.getvalue())


def read_exr(file: Path) -> dict[str, Array]:
    """Read all layers of an OpenEXR file of any origin.

    Returns
    -------
    dict of str to (H, W), (H, W, 2) or (H, W, 3) array
        Channels that end in R G B, X Y Z or u v, of one size, are one layer with the name before the last
        dot; half and float together become float. Every other channel is a layer with its full name. The
        size is that of the display window; outside the data window pixels are 0. The parts of a multi-part
        file are merged: a channel without a layer name, or with a name that several parts have, gets the name
        of its part in front (`R` of the part `beauty` belongs to the layer ``beauty``).

    Raises
    ------
    ImageError
        The file is missing, no OpenEXR, cut off, damaged, too large, or holds deep data.
    """
    headers = _part_headers(file)
    for header in headers:
        _check_part(file, header)
    full, channels = _full_names(headers), {}
    with _failures(file), OpenEXR.File(str(file), separate_channels=True) as image:
        for part, header in enumerate(headers):
            for name, channel in image.channels(part).items():
                channels[full[part, name]] = _in_display_window(np.asarray(channel.pixels), header)
    return _layers(channels)


def color_layers(file: Path) -> tuple[str, ...]:
    """Names of the layers of R G B as :func:`read_exr` names them, from the headers; ImageError as there."""
    names = dict.fromkeys(_full_names(_part_headers(file)).values())
    prefixes = [name[:-1] for name in names if name.rpartition(".")[2] == "R"]
    return tuple(p.rstrip(".") or "RGB" for p in prefixes if {f"{p}G", f"{p}B"} <= set(names))


def read_attributes(file: Path) -> dict[str, Any]:
    """Attributes of the first part but for the standard ones, from the header; ImageError if damaged."""
    return {name: value for name, value in _part_headers(file)[0].items() if name not in STANDARD}


@functools.cache
def _start_threads() -> None:
    """Let OpenEXR compress several blocks of lines at a time."""
    OpenEXR.set_global_thread_count(min(len(os.sched_getaffinity(0)), MAX_THREADS))


def _channels(layers: Mapping[str, Array]) -> dict[str, Array]:
    channels: dict[str, Array] = {}
    for name, array in layers.items():
        if array.dtype not in (np.float16, np.float32, np.uint32):
            raise ValueError(f"layer {name!r}: float16, float32 or uint32 can be written, not {array.dtype}")
        names = _channel_names(name, array)
        planes = [array] if array.ndim == 2 else np.moveaxis(array, 2, 0)
        # OpenEXR ignores strides: a view of one component would be written as the wrong pixels
        channels.update(zip(names, map(np.ascontiguousarray, planes), strict=True))
    sizes = {plane.shape for plane in channels.values()}
    if len(sizes) != 1 or 0 in next(iter(sizes)):
        raise ValueError(f"all layers must have the same size, which is not 0, not {sorted(sizes)}")
    return channels


def _channel_names(name: str, array: Array) -> list[str]:
    is_main = name == "RGB"
    if array.ndim == 2:
        return [name]
    if array.ndim != 3 or array.shape[2] not in ((3,) if is_main else (2, 3)):
        raise ValueError(f"layer {name!r} of shape {array.shape} can't be written")
    if is_main:
        return ["R", "G", "B"]
    letters = "uv" if array.shape[2] == 2 else "XYZ" if name in VECTORS else "RGB"
    return [f"{name}.{letter}" for letter in letters]


def _layers(channels: dict[str, Array]) -> dict[str, Array]:
    layers: dict[str, Array] = {}
    rest = dict(channels)
    for name in channels:
        prefix, _, letter = name.rpartition(".")
        group = next((g for g in GROUPS if letter == g[0]), "")
        names = [f"{prefix}.{end}" if prefix else end for end in group]
        if group and all(n in channels for n in names):
            planes = [channels[n] for n in names]
            # half and float are of one kind
            if len({(plane.shape, plane.dtype.kind) for plane in planes}) == 1:
                layers[prefix or group] = np.stack(planes, axis=2)
                for used in names:
                    del rest[used]
    return {**layers, **rest}


def _full_names(headers: list[dict[str, Any]]) -> dict[tuple[int, str], str]:
    """Names of channels by part and own name, with the name of the part in front where it is needed."""
    counts = Counter(name for header in headers for name in header["channels"])
    full = {}
    for part, header in enumerate(headers):
        for name in header["channels"]:
            is_needed = len(headers) > 1 and ("." not in name or counts[name] > 1)
            full[part, name] = f"{header.get('name', part)}.{name}" if is_needed else name
    return full


def _part_headers(file: Path) -> list[dict[str, Any]]:
    if _read(file, len(MAGIC)) != MAGIC:
        raise ImageError(f"{file} is no OpenEXR file")
    with _failures(file), OpenEXR.File(str(file), separate_channels=True, header_only=True) as image:
        headers = [dict(part.header) for part in image.parts]
        for header in headers:
            header["channels"] = [str(channel.name) for channel in header["channels"]]
    if not headers:
        raise _damaged(file, "no part in it")
    return headers


def _check_part(file: Path, header: Mapping[str, Any]) -> None:
    if header.get("type") in (OpenEXR.deepscanline, OpenEXR.deeptile):
        raise ImageError(f"{file} holds deep data; flatten it first")
    for window in ("dataWindow", "displayWindow"):
        height, width = _size(header[window])
        if height * width > MAX_PIXELS:
            raise ImageError(f"{file} has {width}x{height} pixels; at most {MAX_PIXELS} are read")


def _size(window: tuple[Array, Array]) -> tuple[int, int]:
    (left, top), (right, bottom) = (corner.tolist() for corner in window)
    return bottom - top + 1, right - left + 1


def _in_display_window(pixels: Array, header: Mapping[str, Any]) -> Array:
    data, display = header["dataWindow"], header["displayWindow"]
    if np.array_equal(data, display) or pixels.shape != _size(data):
        return pixels
    whole = np.zeros(_size(display), pixels.dtype)
    left, top = (data[0] - display[0]).tolist()
    target, source = whole[max(top, 0) :, max(left, 0) :], pixels[max(-top, 0) :, max(-left, 0) :]
    height, width = np.minimum(target.shape, source.shape)
    target[:height, :width] = source[:height, :width]
    return whole


@contextlib.contextmanager
def _failures(file: Path) -> Iterator[None]:
    # On damaged pixels OpenEXR prints a warning on Python's stdout, which belongs to results, and
    # raises no sooner than when the channels are requested.
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    except (RuntimeError, ValueError, TypeError, KeyError, ZeroDivisionError) as error:
        _read(file)  # OpenEXR does not report errors of the disk
        raise _damaged(file, str(error)) from error


def _read(file: Path, size: int = -1) -> bytes:
    try:
        with file.open("rb") as raw:
            return raw.read(size)
    except OSError as error:
        raise ImageError(f"can't read {file}: {error.strerror}") from error


def _damaged(file: Path, reason: str) -> ImageError:
    return ImageError(f"{file} is cut off or damaged ({reason}); write or copy it again")
