"""Encoding of finished frames: the view transform, Y'CbCr, the codec, and tags that say what was done."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import Any

import av
import numpy as np

from enfilade import files as whole
from enfilade.errors import ImageError
from enfilade.images.codecs import Codec, codec_named
from enfilade.images.view import View, open_view
from enfilade.images.ycbcr import planes_from_rgb, quantized
from enfilade.records import F32
from enfilade.settings import VideoSettings

__all__ = ["check_encodable", "encode_video", "exact_fps", "join_videos"]

BT709 = 1  # primaries and matrix, ITU-T H.273, tables 2 and 4
IDENTITY_MATRIX = 0  # R'G'B' as it is, ITU-T H.273, table 4
LIMITED, FULL = 1, 2  # FFmpeg's AVColorRange
NTSC = Fraction(1000, 1001)
NTSC_TOLERANCE = 0.005  # people write 23.98 for 24000/1001


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
    """Encode frames as a video, tagged as what it is; the same frames, the same bytes.

    H.264 is 8 bit 4:2:0, or 4:4:4 where width or height is odd (few players show that); AV1 10 bit 4:2:0,
    even sizes only; ProRes 10 bit 4:4:4; FFV1 12 bit R'G'B', without loss beyond that rounding. Y'CbCr
    has the BT.709 matrix and limited range, primaries are BT.709, the transfer is sRGB's or that of the
    OpenColorIO display. To 8 bits it is rounded with an ordered dither, so that smooth walls show no bands.

    Parameters
    ----------
    file
        Its suffix should be that of :func:`~enfilade.images.codecs.video_suffix`.
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
        An unknown codec or view, or a size that the codec can't encode.
    ImageError
        There are no frames, or one has another size or holds a NaN.
    RunFolderError
        The file can't be written. An older one stays.
    """
    codec = codec_named(settings.codec)
    pixels = codec.pixels_for(width, height)
    options = codec.options_for(settings.quality)
    view = open_view(settings, exposure_ev)
    pictures = _pictures(frames, (height, width, 3), view, pixels, codec.bits)
    with _written(file, codec) as container:
        stream = _stream(container, codec, exact_fps(fps), options)
        stream.width, stream.height, stream.pix_fmt = width, height, pixels
        _tag(stream.codec_context, view, pixels)
        with _usual_scheduling():
            stream.codec_context.open()
        for picture in pictures:
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))


@contextmanager
def _usual_scheduling() -> Iterator[None]:
    """Give threads that are begun meanwhile, and those that are changed, the scheduling they should have.

    Opened by root, as in most containers, SVT-AV1 makes its threads and the one that opens it real-time
    threads. What that one begins later inherits it, so that nothing else gets to run where all cores are
    busy.
    """
    usual = os.sched_getscheduler(0), os.sched_getparam(0)
    before = dict(_scheduling())
    try:
        yield
    finally:
        for thread, (policy, _) in _scheduling():
            wanted = before.get(thread, usual)
            if policy != wanted[0]:
                with suppress(ProcessLookupError):  # it has ended
                    os.sched_setscheduler(thread, *wanted)


def _scheduling() -> Iterator[tuple[int, tuple[int, os.sched_param]]]:
    """The threads of this process, each with its scheduling policy and the parameters of that."""
    for thread in (int(entry.name) for entry in Path("/proc/self/task").iterdir()):
        with suppress(ProcessLookupError):
            yield thread, (os.sched_getscheduler(thread), os.sched_getparam(thread))


def join_videos(
    file: Path, clips: Sequence[tuple[Path, int]], *, fps: float | Fraction, settings: VideoSettings
) -> None:
    """Put clips one after another, as they were encoded; the same clips, the same bytes.

    Parameters
    ----------
    file
        Of the suffix of the clips.
    clips : sequence of (Path, int)
        Videos that :func:`encode_video` wrote with these settings, and the number of their frames.
    fps, settings
        Theirs.

    Raises
    ------
    ImageError
        A clip is missing or damaged, or does not hold as many frames.
    RunFolderError, NoSpaceError
        The file can't be written. An older one stays.
    """
    rate = exact_fps(fps)
    # A short clip may be decoded with less delay than the others.
    delay = max(_delay(clip, rate) for clip, _ in clips)
    first = 0
    with _written(file, codec_named(settings.codec)) as container:
        stream = None
        for clip, count in clips:
            with _opened(clip) as opened:
                stream = stream or _copied(container, opened.streams.video[0])
                held = 0
                for packet in _packets(clip, opened):
                    shown = first + _frame(packet.pts, packet, rate)
                    packet.stream, packet.time_base = stream, 1 / rate
                    packet.pts, packet.dts, packet.duration = shown, first + held - delay, 1
                    container.mux(packet)
                    held += 1
            if held != count:
                raise ImageError(f"{clip} holds {held} frames, not {count}; delete it to make it again")
            first += count


def _delay(clip: Path, rate: Fraction) -> int:
    """Frames by which a clip is decoded before it is shown."""
    with _opened(clip) as opened:
        return max(
            (-_frame(packet.dts, packet, rate) for packet in islice(_packets(clip, opened), 1)), default=0
        )


def _opened(clip: Path) -> Any:
    try:
        return av.open(str(clip.absolute()))
    except MemoryError:
        raise
    except (av.FFmpegError, OSError) as error:
        raise _damaged(clip, error) from error


def _copied(container: Any, template: Any) -> Any:
    """A stream for packets of another."""
    # Not opaque, PyAV looks for an encoder of the decoder's name, which AV1 has not.
    stream = container.add_stream_from_template(template, opaque=True)
    stream.codec_context.codec_tag = template.codec_context.codec_tag  # ProRes's profile stands nowhere else
    return stream


def _packets(clip: Path, opened: Any) -> Iterator[Any]:
    """Of the picture; the last one that FFmpeg gives is empty."""
    packets = opened.demux(video=0)
    while True:
        try:
            packet = next(packets)
        except StopIteration:
            return
        except MemoryError:
            raise
        except av.FFmpegError as error:
            raise _damaged(clip, error) from error
        if packet.size:
            yield packet


def _damaged(clip: Path, error: Exception) -> ImageError:
    return ImageError(f"{clip} is missing or damaged ({error}); delete it to make it again")


def _frame(time: int, packet: Any, rate: Fraction) -> int:
    """Number of the frame that a time means: containers round theirs."""
    unit: Fraction = packet.time_base
    return round(time * unit * rate)


def check_encodable(settings: VideoSettings, *, width: int, height: int, exposure_ev: float) -> None:
    """Raise now what :func:`encode_video` would raise after a night of rendering.

    Raises
    ------
    SettingsError
        An unknown codec, view or quality, or a size that the codec can't encode.
    """
    codec = codec_named(settings.codec)
    codec.pixels_for(width, height)
    codec.options_for(settings.quality)
    open_view(settings, exposure_ev)


def exact_fps(fps: float | Fraction) -> Fraction:
    """Frames per second as the fraction that is meant: 23.976 and 23.98 are 24000/1001.

    Parameters
    ----------
    fps
        Positive. A fraction is taken as it is.
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


@contextmanager
def _written(file: Path, codec: Codec) -> Iterator[Any]:
    """A container that becomes `file` when the block ends without an error."""
    with whole.whole_file(file) as beside:
        beside.touch()
        try:
            with _container(beside, codec) as container:
                yield container
        except MemoryError:  # one of FFmpeg's errors, too
            raise
        except av.FFmpegError as error:
            if error.errno in whole.FULL:
                raise whole.unwritable(file, OSError(error.errno, error.strerror)) from error
            raise whole.unwritable(file, f"{codec.encoder}: {error}") from error


def _container(file: Path, codec: Codec) -> Any:
    # absolute: FFmpeg takes what a relative name has before a colon for a protocol
    # bitexact: Matroska would otherwise carry a random number, MP4 the name of the muxer's version
    options = {"fflags": "+bitexact"}
    if codec.container != "matroska":
        options["movflags"] = "+faststart+write_colr"
    return av.open(str(file.absolute()), "w", format=codec.container, container_options=options)


def _stream(container: Any, codec: Codec, fps: Fraction, options: dict[str, str]) -> Any:
    os.environ.setdefault("SVT_LOG", "1")  # SVT-AV1 has no other way to keep it from stderr: errors only
    stream = container.add_stream(codec.encoder, rate=fps, options=options)
    stream.codec_context.time_base = 1 / fps
    return stream


def _tag(target: Any, view: View, pixels: str) -> None:
    target.color_primaries = BT709
    target.color_trc = view.transfer
    target.colorspace = IDENTITY_MATRIX if _is_rgb(pixels) else BT709
    target.color_range = FULL if _is_rgb(pixels) else LIMITED


def _is_rgb(pixels: str) -> bool:
    return pixels.startswith("gbr")


def _pictures(
    frames: Iterable[F32], shape: tuple[int, int, int], view: View, pixels: str, bits: int
) -> Iterator[Any]:
    index = -1
    for index, linear in enumerate(frames):
        if linear.shape != shape:
            raise ImageError(f"frame {index} of the video has shape {linear.shape}, not {shape}")
        if np.isnan(linear).any():
            raise ImageError(f"frame {index} of the video holds a NaN; it can't be encoded")
        picture = _picture(view.encode(linear), pixels, bits)
        _tag(picture, view, pixels)
        picture.pts = index
        yield picture
    if index < 0:
        raise ImageError("a video of no frames can't be encoded")


def _picture(encoded: F32, pixels: str, bits: int) -> Any:
    height, width = encoded.shape[:2]
    if _is_rgb(pixels):
        planes = tuple(quantized(encoded[..., c], bits, unit=2.0**bits - 1.0) for c in (1, 2, 0))
    else:
        is_dithered = bits == 8  # in 10 bits, bands are seen nowhere
        planes = planes_from_rgb(encoded, bits=bits, is_halved="420" in pixels, is_dithered=is_dithered)
    picture = av.VideoFrame(width, height, pixels)
    for plane, values in zip(picture.planes, planes, strict=True):
        rows = np.zeros((plane.height, plane.line_size), np.uint8)
        raw = np.ascontiguousarray(values).view(np.uint8)
        rows[:, : raw.shape[1]] = raw
        plane.update(rows)
    return picture
