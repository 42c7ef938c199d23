"""Encoding of finished frames: the view transform, Y'CbCr, the codec, and the colour tags."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.errors import ImageError
from enfilade.images.codecs import CODECS, Codec
from enfilade.images.container import written_container
from enfilade.images.view import ViewTransform, open_view
from enfilade.images.ycbcr import FULL_RANGE, LIMITED_RANGE, Plane, frame_of, planes_from_rgb, quantized
from enfilade.records import F32
from enfilade.settings import VideoSettings

BT709 = 1  # primaries and matrix, ITU-T H.273, tables 2 and 4
IDENTITY_MATRIX = 0  # R'G'B', ITU-T H.273, table 4
NTSC = Fraction(1000, 1001)
NTSC_TOLERANCE = 0.005  # 24000/1001 is also written as 23.98


def encode_video(
    file: Path,
    frames: Iterable[F32],
    *,
    fps: float | Fraction,
    width: int,
    height: int,
    settings: VideoSettings,
    exposure_ev: float,
) -> None:
    """Encode frames as a video with colour tags; the same frames give the same bytes.

    H.264 is 8 bit 4:2:0, or 4:4:4 of odd sizes, which few players show; AV1 10 bit 4:2:0, even sizes only;
    ProRes 10 bit 4:4:4; FFV1 12 bit R'G'B', lossless but for that rounding. Y'CbCr has the BT.709 matrix and
    limited range, primaries are BT.709, the transfer is sRGB's or that of the OpenColorIO display. 8-bit
    samples are rounded with an ordered dither, so that smooth walls show no bands.

    Parameters
    ----------
    file
        With the suffix of :func:`~enfilade.images.codecs.video_suffix`.
    frames : iterable of (H, W, 3) float32
        Scene-linear Rec.709. Taken one by one.
    fps
        Frames per second; see :func:`exact_fps`.
    width, height
        Pixels.
    settings, exposure_ev
        Codec, quality and view transform.

    Raises
    ------
    SettingsError
        An unknown codec or view, or a size or frame rate that the codec can't encode.
    ImageError
        There are no frames, or one has another size or holds a NaN.
    RunFolderError, NoSpaceError
        The file can't be written. An older one stays.
    """
    codec, pixel_format, options, view, rate = _chosen(settings, fps, (width, height), exposure_ev)
    os.environ.setdefault("SVT_LOG", "1")  # the only way to restrict SVT-AV1's output on stderr to errors
    with written_container(file) as container:
        stream = container.add_stream(codec.encoder, rate=rate, options=options)
        context = stream.codec_context
        context.width, context.height, context.pix_fmt = width, height, pixel_format
        context.time_base = 1 / rate
        is_rgb = pixel_format.startswith("gbr")
        _tag(context, view, is_rgb=is_rgb)
        with _unchanged_scheduling():
            context.open()
        for index, linear in enumerate(_checked(frames, (height, width, 3))):
            planes = _planes(view.encode(linear), codec.bits, is_rgb=is_rgb, is_halved="420" in pixel_format)
            frame = frame_of(planes, pixel_format)
            _tag(frame, view, is_rgb=is_rgb)
            frame.pts = index
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))


def check_encodable(
    settings: VideoSettings, *, fps: float, width: int, height: int, exposure_ev: float
) -> None:
    """Raise before rendering the SettingsError that :func:`encode_video` would raise after it."""
    _chosen(settings, fps, (width, height), exposure_ev)


def exact_fps(fps: float | Fraction) -> Fraction:
    """Frames per second as a fraction: 23.976 and 23.98 are 24000/1001.

    Parameters
    ----------
    fps
        Positive. A fraction is returned unchanged.
    """
    if isinstance(fps, Fraction):
        return fps
    if not (np.isfinite(fps) and fps > 0.0):
        raise ValueError(f"{fps} frames per second")
    if abs(fps - round(fps)) > 1e-6:
        ntsc = NTSC * round(fps / NTSC)
        if ntsc > 0 and abs(float(ntsc) - fps) < NTSC_TOLERANCE:
            return ntsc
    return Fraction(fps).limit_denominator(1001)


def _chosen(
    settings: VideoSettings, fps: float | Fraction, size: tuple[int, int], exposure_ev: float
) -> tuple[Codec, str, dict[str, str], ViewTransform, Fraction]:
    """Codec, pixel format, options of the encoder, view and frame rate, all checked."""
    codec, rate = CODECS[settings.codec], exact_fps(fps)
    pixel_format, options = codec.pixel_format_for(*size), codec.options_for(settings.quality)
    codec.check_rate(rate)
    return codec, pixel_format, options, open_view(settings, exposure_ev), rate


@contextmanager
def _unchanged_scheduling() -> Iterator[None]:
    """Give all threads of this process the scheduling policy of the caller afterwards.

    Opened by root, as in most containers, SVT-AV1 makes its threads and the calling one real-time threads.
    Threads that the caller starts later would inherit that, and other processes would not run while all cores
    are busy.
    """
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        yield
    finally:
        for thread in (int(entry.name) for entry in Path("/proc/self/task").iterdir()):
            with suppress(ProcessLookupError):  # the thread has ended
                if os.sched_getscheduler(thread) != policy:
                    os.sched_setscheduler(thread, policy, parameters)


def _tag(target: Any, view: ViewTransform, *, is_rgb: bool) -> None:
    target.color_primaries = BT709
    target.color_trc = view.transfer
    target.colorspace = IDENTITY_MATRIX if is_rgb else BT709
    target.color_range = FULL_RANGE if is_rgb else LIMITED_RANGE


def _checked(frames: Iterable[F32], shape: tuple[int, int, int]) -> Iterator[F32]:
    index = -1
    for index, linear in enumerate(frames):
        if linear.shape != shape:
            raise ImageError(f"frame {index} of the video has shape {linear.shape}, not {shape}")
        if np.isnan(linear).any():
            raise ImageError(f"frame {index} of the video holds a NaN; it can't be encoded")
        yield linear
    if index < 0:
        raise ImageError("a video of no frames can't be encoded")


def _planes(rgb: F32, bits: int, *, is_rgb: bool, is_halved: bool) -> tuple[Plane, ...]:
    if is_rgb:
        return tuple(quantized(rgb[..., c], bits, unit=2.0**bits - 1.0) for c in (1, 2, 0))
    return planes_from_rgb(rgb, bits=bits, is_halved=is_halved, is_dithered=bits == 8)
