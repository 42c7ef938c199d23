# SPDX-License-Identifier: GPL-3.0-or-later
"""PNG and OpenEXR files of arrays.

Blender's own image files pass through its colour management; these hold the numbers that they are given.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import numpy.typing as npt

F32 = npt.NDArray[np.float32]
BLOCK = 16  # scanlines of a ZIP block of OpenEXR


def srgb_from_linear(linear: npt.ArrayLike) -> F32:
    """IEC 61966-2-1, of values in 0..1; others are clipped."""
    x = np.clip(np.asarray(linear, np.float32), 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1.0 / 2.4) - 0.055).astype(
        np.float32
    )


def write_png(file: Path, image: F32) -> None:
    """Write 8 bits for values 0..1 of an image (H, W, 1 or 3), the first row on top."""
    height, width, channels = image.shape
    values = np.rint(np.clip(image, 0.0, 1.0) * 255.0).astype(np.uint8).reshape(height, -1)
    rows = np.concatenate([np.zeros((height, 1), np.uint8), values], axis=1)  # filter 0
    head = struct.pack(">IIBBBBB", width, height, 8, 0 if channels == 1 else 2, 0, 0, 0)
    chunks = ((b"IHDR", head), (b"IDAT", zlib.compress(rows.tobytes(), 6)), (b"IEND", b""))
    with file.open("wb") as stream:
        stream.write(b"\x89PNG\r\n\x1a\n")
        for name, data in chunks:
            stream.write(
                struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
            )


def write_exr(file: Path, image: F32) -> None:
    """Write float32 R, G, B of an image (H, W, 3), the first row on top; ZIP compression."""
    height, width, _ = image.shape
    planes = np.ascontiguousarray(image[:, :, ::-1].transpose(0, 2, 1), "<f4")  # B, G, R: names are sorted
    blocks = [_zipped(planes[row : row + BLOCK].tobytes()) for row in range(0, height, BLOCK)]
    header = _header(width, height)
    offset = len(header) + 8 * len(blocks)
    with file.open("wb") as stream:
        stream.write(header)
        for block in blocks:
            stream.write(struct.pack("<Q", offset))
            offset += 8 + len(block)
        for number, block in enumerate(blocks):
            stream.write(struct.pack("<ii", number * BLOCK, len(block)) + block)


def _header(width: int, height: int) -> bytes:
    channels = (
        b"".join(name + b"\0" + struct.pack("<iB3xii", 2, 0, 1, 1) for name in (b"B", b"G", b"R")) + b"\0"
    )
    window = struct.pack("<iiii", 0, 0, width - 1, height - 1)
    attributes = (
        (b"channels", b"chlist", channels),
        (b"compression", b"compression", b"\x03"),
        (b"dataWindow", b"box2i", window),
        (b"displayWindow", b"box2i", window),
        (b"lineOrder", b"lineOrder", b"\0"),
        (b"pixelAspectRatio", b"float", struct.pack("<f", 1.0)),
        (b"screenWindowCenter", b"v2f", struct.pack("<ff", 0.0, 0.0)),
        (b"screenWindowWidth", b"float", struct.pack("<f", 1.0)),
    )
    parts = [name + b"\0" + kind + b"\0" + struct.pack("<i", len(v)) + v for name, kind, v in attributes]
    return struct.pack("<II", 20000630, 2) + b"".join(parts) + b"\0"


def _zipped(data: bytes) -> bytes:
    """A block as OpenEXR compresses it: bytes of even, then of odd places, differences, zlib."""
    raw = np.frombuffer(data, np.uint8)
    split = np.concatenate([raw[::2], raw[1::2]]).astype(np.int16)
    split[1:] = (split[1:] - split[:-1] + 128) & 255
    packed = zlib.compress(split.astype(np.uint8).tobytes(), 4)
    return packed if len(packed) < len(data) else data
