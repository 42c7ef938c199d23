"""Decoding of video files."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.errors import ImageError
from enfilade.images.container import open_container, reading
from enfilade.images.ycbcr import BT601, BT709, FULL_RANGE, MATRICES, Plane, planes_of, rgb_from_planes
from enfilade.kernels.tone import srgb_decode
from enfilade.records import F32

# ITU-T H.273, tables 2, 3 and 4
REC709_LIKE = frozenset({1, 2, 5, 6, 7})  # primaries: BT.709, unknown, and the similar ones of BT.601
LINEAR = 8
UNSUPPORTED_TRANSFERS = {
    9: "logarithmic (100:1)", 10: "logarithmic (316:1)", 16: "PQ (SMPTE ST 2084)", 17: "SMPTE ST 428-1",
    18: "HLG (ARIB STD-B67)",
}  # fmt: skip
UNKNOWN_MATRIX = 2
HD_WIDTH, SD_HEIGHT = 1280, 576  # so wide or higher, a video without a stated matrix has BT.709's, as in mpv
PLANAR_RGB = re.compile(r"gbra?p(\d+le)?")  # FFmpeg's pixel formats
PLANAR_YCBCR = re.compile(r"yuv[aj]?4(20|22|44)p(\d+le)?")
DURATION = re.compile(r"(\d+):(\d\d):(\d\d\.\d+)[\0 ]*")  # hours, minutes, seconds


class VideoFile:
    """A video file as a sequence of frames that are decoded one by one.

    All standard-range transfers (sRGB, BT.709, BT.601, gamma, unknown) are decoded as sRGB, as desktop
    screens show them. Files that are cut off are detected; damage inside frames is concealed by FFmpeg.

    Its attributes are those of :class:`~enfilade.images.imagefiles.ImageFiles`.

    Parameters
    ----------
    file
        With a suffix in :data:`~enfilade.images.container.DEMUXERS`.

    Raises
    ------
    ImageError
        The file can't be read, has no video, is cut off, or is HDR or wide-gamut.
    """

    exposure_ev: float | None = None  # frames are display-referred
    numbers: tuple[int, ...] | None = None
    starts: frozenset[int] | None = None
    identity: None = None
    view: None = None
    note: str = ""

    def __init__(self, file: Path) -> None:
        self.file = file
        with reading(file), open_container(file) as container:
            if not container.streams.video:
                raise ImageError(f"{file} has no video in it")
            stream = container.streams.video[0]
            context = stream.codec_context
            if context is None:
                raise ImageError(f"{file} has an unknown codec; convert it to H.264, AV1 or FFV1")
            self.width, self.height = int(stream.width), int(stream.height)
            self.fps = float(stream.average_rate) if stream.average_rate else None
            self._is_linear = context.color_trc == LINEAR
            _check_colors(file, int(context.color_trc), int(context.color_primaries))
            self._count = _shown_frames(file, container, stream)

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[F32]:
        """Frames as (H, W, 3) float32 linear Rec.709, in order; a second iteration starts again."""
        done = 0
        with reading(self.file), open_container(self.file) as container:
            for frame in container.decode(container.streams.video[0]):
                if frame.is_corrupt:
                    break
                if (frame.height, frame.width) != (self.height, self.width):
                    raise ImageError(
                        f"frame {done + 1} of {self.file} has {frame.width}x{frame.height} pixels, not "
                        f"{self.width}x{self.height}"
                    )
                if _is_transparent(frame):
                    raise ImageError(
                        f"{self.name(done)} has transparent pixels; put it over a background first"
                    )
                encoded = _encoded_rgb(self.file, frame)
                yield encoded if self._is_linear else srgb_decode(encoded)
                done += 1
        if done != self._count:
            raise _incomplete(self.file, self._count, done)

    def name(self, index: int) -> str:
        """Name of a frame for messages, where frames are counted from 1."""
        return f"frame {index + 1} of {self.file}"

    def layers(self, index: int) -> dict[str, Plane]:
        """Raise an ImageError: a video has no layers."""
        raise ImageError(f"{self.name(index)} has no layers; those are in OpenEXR frames")


def _shown_frames(file: Path, container: Any, stream: Any) -> int:
    """Count the frames that are shown, and compare with the number or the length that the file states."""
    times = [p.pts for p in container.demux(stream) if p.size and not p.is_discard]
    stated = int(stream.frames)
    if not times or len(times) < stated:  # the table of samples also has those that an edit list omits
        with open_container(file, {"ignore_editlist": "1"}) as whole:
            found = sum(1 for packet in whole.demux(video=0) if packet.size)
        if not times or found < stated:
            raise _incomplete(file, stated, min(len(times), found))
    # Matroska states no number of frames, but FFmpeg writes the duration of each stream
    duration = DURATION.fullmatch(stream.metadata.get("DURATION", ""))
    if duration and stream.average_rate:
        hours, minutes, seconds = map(float, duration.groups())
        length_s = 3600.0 * hours + 60.0 * minutes + seconds
        last_s = float(max((t for t in times if t is not None), default=0) * stream.time_base)
        if last_s + 1.5 / float(stream.average_rate) < length_s:
            raise ImageError(
                f"{file} is {length_s:g} s long, but its last frame is at {last_s:g} s: it is cut off; "
                "write or copy it again"
            )
    return len(times)


def _is_transparent(frame: Any) -> bool:
    if not any(component.is_alpha for component in frame.format.components):
        return False
    return bool((frame.reformat(format="rgba").to_ndarray()[..., 3] < np.iinfo(np.uint8).max).any())


def _encoded_rgb(file: Path, frame: Any) -> F32:
    """R'G'B' of a decoded frame, (H, W, 3), 0..1."""
    bits = int(frame.format.components[0].bits)
    if frame.format.is_rgb:
        if not PLANAR_RGB.fullmatch(frame.format.name):
            bits = 8 if bits <= 8 else 16
            frame = frame.reformat(format="gbrp" if bits == 8 else "gbrp16le")
        g, b, r = planes_of(frame)
        return np.stack([r, g, b], axis=2).astype(np.float32) / np.float32(2.0**bits - 1.0)
    is_full_range = frame.color_range == FULL_RANGE or frame.format.name.startswith("yuvj")
    is_hd = frame.width >= HD_WIDTH or frame.height > SD_HEIGHT
    weights = MATRICES.get(int(frame.colorspace), BT709 if is_hd else BT601)
    if int(frame.colorspace) not in (*MATRICES, UNKNOWN_MATRIX):
        raise ImageError(
            f"{file} has the colour matrix {int(frame.colorspace)} of ITU-T H.273; convert it to BT.709"
        )
    if not PLANAR_YCBCR.fullmatch(frame.format.name):
        # the same matrix and range on both sides: samples change their layout only
        span, bits = frame.color_range or 1, 16
        same = {"src_colorspace": 1, "dst_colorspace": 1, "src_color_range": span, "dst_color_range": span}
        frame = frame.reformat(format="yuv444p16le", **same)
    return rgb_from_planes(planes_of(frame), bits=bits, weights=weights, is_full_range=is_full_range)


def _check_colors(file: Path, transfer: int, primaries: int) -> None:
    if transfer in UNSUPPORTED_TRANSFERS:
        raise ImageError(
            f"{file} is {UNSUPPORTED_TRANSFERS[transfer]}; convert it to sRGB or BT.709 (for example with "
            "FFmpeg's zscale and tonemap filters), or give OpenEXR frames"
        )
    if primaries not in REC709_LIKE:
        raise ImageError(f"{file} has the primaries {primaries} of ITU-T H.273; convert it to BT.709")


def _incomplete(file: Path, stated: int, found: int) -> ImageError:
    return ImageError(
        f"{file} states {stated} frames, but {found} can be decoded: it is cut off or damaged; "
        "write or copy it again"
    )
