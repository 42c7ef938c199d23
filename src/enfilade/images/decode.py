"""Decoding of video files, and of images with 16 bits a channel, which Pillow cuts to 8."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np

from enfilade.errors import ImageError
from enfilade.images.ycbcr import BT601, BT709, Plane, rgb_from_planes
from enfilade.kernels.tone import srgb_decode
from enfilade.records import F32

__all__ = ["DEMUXERS", "VideoFile", "deep_pixels"]

# The demuxer is chosen by suffix: FFmpeg would otherwise sniff it, and a playlist opens other files.
DEMUXERS = {
    ".mp4": "mov", ".m4v": "mov", ".mov": "mov", ".mkv": "matroska", ".webm": "matroska", ".avi": "avi",
    ".y4m": "yuv4mpegpipe",
}  # fmt: skip
LINEAR = 8  # transfer, ITU-T H.273, table 3
HDR_TRANSFERS = {16: "PQ (SMPTE ST 2084)", 17: "SMPTE ST 428-1", 18: "HLG (ARIB STD-B67)"}
LOG_TRANSFERS = {9: "logarithmic (100:1)", 10: "logarithmic (316:1)"}
REC709_LIKE = frozenset({1, 2, 5, 6, 7})  # primaries: BT.709, unknown, and the close ones of BT.601
MATRICES = {1: BT709, 4: BT601, 5: BT601, 6: BT601}  # ITU-T H.273, table 4
MAX_PIXELS = 1 << 28  # of a frame; checked before the first is decoded
HD_LINES = 576  # above, a video that doesn't say its matrix has BT.709's, as players take it
FULL = 2  # FFmpeg's AVColorRange


class VideoFile:
    """The frames of a video file, decoded one by one.

    Every standard-range transfer (sRGB, BT.709, BT.601, gamma, unknown) is decoded with sRGB's: what a
    desktop screen shows. Damage inside frames is concealed by FFmpeg's decoders, and isn't noticed here; a
    file that is cut off is.

    Parameters
    ----------
    file
        Of a suffix in :data:`DEMUXERS`.

    Attributes
    ----------
    file : Path
    width, height : int
        Pixels.
    fps : float or None
        Mean frames per second, None if unknown.

    Raises
    ------
    ImageError
        It can't be read, has no picture, or is HDR or wide-gamut.
    """

    exposure_ev: float | None = None  # frames are as shown
    numbers: tuple[int, ...] | None = None
    starts: frozenset[int] | None = None
    note: str = ""

    def __init__(self, file: Path) -> None:
        self.file = file
        with _failures(file), _opened(file) as container:
            if not container.streams.video:
                raise ImageError(f"{file} has no picture in it")
            stream = container.streams.video[0]
            context = stream.codec_context
            if context is None:
                raise ImageError(
                    f"{file} has a codec that is not known here; convert it to H.264, AV1 or FFV1"
                )
            self.width, self.height = int(stream.width), int(stream.height)
            rate: Fraction | None = stream.average_rate
            self.fps = float(rate) if rate else None
            announced = int(stream.frames)
            self._count = announced or _counted(file, container, stream)
            self._is_linear = context.color_trc == LINEAR
            _check_colors(file, int(context.color_trc), int(context.color_primaries))
        if self.width * self.height > MAX_PIXELS:
            raise ImageError(f"{file} has {self.width}x{self.height} pixels; at most {MAX_PIXELS} are read")
        if not 0 < self._count <= file.stat().st_size:  # a frame has a byte at least
            raise ImageError(f"{file} announces {self._count} frames: it is damaged; write or copy it again")
        if announced and DEMUXERS[file.suffix.lower()] == "mov":
            self._count = _shown(file, announced)

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[F32]:
        """Frames as (H, W, 3) float32 linear Rec.709, in order; a second iteration begins anew."""
        done = 0
        with _failures(self.file), _opened(self.file) as container:
            for frame in container.decode(container.streams.video[0]):
                if frame.is_corrupt:
                    break
                if (frame.height, frame.width) != (self.height, self.width):
                    raise ImageError(
                        f"frame {done + 1} of {self.file} has {frame.width}x{frame.height} pixels, not "
                        f"{self.width}x{self.height}"
                    )
                encoded = _encoded_rgb(self.file, frame)
                yield encoded if self._is_linear else srgb_decode(encoded)
                done += 1
        if done != self._count:
            raise _incomplete(self.file, self._count, done)

    def name(self, index: int) -> str:
        """Name of a frame, for messages: they are counted from 1."""
        return f"frame {index + 1} of {self.file}"

    def layers(self, index: int) -> dict[str, Plane]:
        """Refuse: a video has no layers.

        Raises
        ------
        ImageError
            Always.
        """
        raise ImageError(f"{self.name(index)} has no layers; those are in OpenEXR frames")


def deep_pixels(file: Path, demuxer: str) -> F32:
    """Encoded values of an image of 16 bits a channel, with the alpha that it has.

    Parameters
    ----------
    file
    demuxer
        FFmpeg's: ``png_pipe``, ``tiff_pipe`` or ``ppm_pipe``.

    Returns
    -------
    (H, W, 4) float32
        0..1; alpha is 1 where the file has none.

    Raises
    ------
    ImageError
        It is cut off or damaged.
    """
    with _failures(file), av.open(str(file.absolute()), format=demuxer) as container:
        frame = next(iter(container.decode(video=0)), None)
        if frame is None or frame.is_corrupt:
            raise ImageError(f"{file} is cut off or damaged; write or copy it again")
        deep = frame.reformat(format="rgba64le").to_ndarray()
        values: F32 = deep.astype(np.float32) / np.float32(65535.0)
    return values


def _shown(file: Path, announced: int) -> int:
    # The table of samples has those that an edit list leaves out, too
    shown = _packets(file, {})
    there = shown if shown >= announced else _packets(file, {"ignore_editlist": "1"})
    if not shown or there < announced:
        raise _incomplete(file, announced, min(shown, there))
    return shown


def _packets(file: Path, options: dict[str, str]) -> int:
    with _failures(file), _opened(file, options) as container:
        packets = container.demux(container.streams.video[0])
        return sum(1 for packet in packets if packet.size and not packet.is_discard)


def _counted(file: Path, container: Any, stream: Any) -> int:
    # Matroska doesn't say how many frames it has, but FFmpeg writes how long each stream is
    count, last = 0, 0.0
    for packet in container.demux(stream):
        if packet.size and packet.pts is not None and not packet.is_discard:
            count, last = count + 1, max(last, float(packet.pts * stream.time_base))
    stated = re.fullmatch(r"(\d+):(\d\d):(\d\d\.\d+)", stream.metadata.get("DURATION", "").strip("\0 "))
    if stated and stream.average_rate:
        hours, minutes, seconds = (float(part) for part in stated.groups())
        length = 3600.0 * hours + 60.0 * minutes + seconds
        if last + 1.5 / float(stream.average_rate) < length:
            raise ImageError(
                f"{file} is {length:g} s long, but its last frame is at {last:g} s: it is cut off; "
                "write or copy it again"
            )
    return count


def _encoded_rgb(file: Path, frame: Any) -> F32:
    is_full = frame.color_range == FULL or frame.format.name.startswith("yuvj")
    if frame.format.is_rgb:
        deep = frame.reformat(format="rgb48le").to_ndarray().astype(np.float32)
        rgb: F32 = deep / np.float32(65535.0)
        return rgb
    matrix = int(frame.colorspace)
    if matrix not in MATRICES and matrix != 2:
        raise ImageError(
            f"{file} has the colour matrix {matrix} of ITU-T H.273, which is not read; convert it to BT.709"
        )
    weights = MATRICES.get(matrix, BT709 if frame.height > HD_LINES else BT601)
    if not _is_plain_ycbcr(frame.format):
        # the same matrix and range on both sides: samples are only laid out anew
        span = frame.color_range or 1
        frame = frame.reformat(
            format="yuv444p16le",
            src_colorspace=1,
            dst_colorspace=1,
            src_color_range=span,
            dst_color_range=span,
        )
    planes = tuple(_samples(frame, index) for index in range(3))
    bits = int(frame.format.components[0].bits)
    return rgb_from_planes(
        (planes[0], planes[1], planes[2]), bits=bits, weights=weights, is_full_range=is_full
    )


def _is_plain_ycbcr(layout: Any) -> bool:
    return (
        layout.is_planar
        and not layout.is_big_endian
        and len(layout.components) >= 3
        and layout.name.removeprefix("yuvj").removeprefix("yuva").removeprefix("yuv")[:3]
        in ("420", "422", "444")
    )


def _samples(frame: Any, index: int) -> Plane:
    plane = frame.planes[index]
    kind = np.dtype("<u2") if frame.format.components[index].bits > 8 else np.dtype(np.uint8)
    rows = np.frombuffer(plane, kind).reshape(plane.height, plane.line_size // kind.itemsize)
    return rows[:, : plane.width]


def _check_colors(file: Path, transfer: int, primaries: int) -> None:
    special = HDR_TRANSFERS | LOG_TRANSFERS
    if transfer in special:
        raise ImageError(
            f"{file} is {special[transfer]}, which is not read; convert it to sRGB or BT.709 "
            "(for example with FFmpeg's zscale and tonemap filters), or give OpenEXR frames"
        )
    if primaries not in REC709_LIKE:
        raise ImageError(
            f"{file} has the primaries {primaries} of ITU-T H.273, which are not read; convert it to BT.709"
        )


@contextlib.contextmanager
def _failures(file: Path) -> Iterator[None]:
    try:
        yield
    except (av.FFmpegError, OSError, MemoryError) as error:
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise ImageError(f"can't decode {file}: {reason}; write or copy it again") from error


def _incomplete(file: Path, announced: int, found: int) -> ImageError:
    return ImageError(
        f"{file} announces {announced} frames, but {found} can be decoded: it is cut off or damaged; "
        "write or copy it again"
    )


def _opened(file: Path, options: dict[str, str] | None = None) -> Any:
    kind = DEMUXERS[file.suffix.lower()]
    # absolute: FFmpeg takes what a relative name has before a colon for a protocol
    name = str(file.absolute())
    return av.open(name, format=kind, options=options or {}, metadata_errors="replace")
