"""Joining of encoded clips without encoding them again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from enfilade.errors import ImageError
from enfilade.images.container import open_container, reading, written_container
from enfilade.images.encode import exact_fps

REMEDY = "delete it to make it again"


def join_videos(file: Path, clips: Sequence[tuple[Path, int]], *, fps: float | Fraction) -> None:
    """Concatenate clips as they were encoded; the same clips give the same bytes.

    Parameters
    ----------
    file
        With the suffix of the clips.
    clips : sequence of (Path, int)
        Videos by :func:`~enfilade.images.encode_video` with the same settings, and their numbers of frames.
    fps
        Frames per second of the clips.

    Raises
    ------
    ImageError
        A clip is missing or damaged, or has another number of frames.
    RunFolderError, NoSpaceError
        The file can't be written. An older one stays.
    """
    rate = exact_fps(fps)
    delay = max(_delay(clip, rate) for clip, _ in clips)  # that of a short clip may be less
    first, stream = 0, None
    with written_container(file) as container:
        for clip, count in clips:
            done = 0
            for packet in _packets(clip):
                stream = stream or _copied_stream(container, packet.stream)
                shown = first + _frame(packet.pts, packet, rate)
                packet.stream, packet.time_base = stream, 1 / rate
                packet.pts, packet.dts, packet.duration = shown, first + done - delay, 1
                container.mux(packet)
                done += 1
            if done != count:
                raise ImageError(f"{clip} has {done} frames, not {count}; {REMEDY}")
            first += count


def _delay(clip: Path, rate: Fraction) -> int:
    """Frames by which a clip is decoded before it is shown."""
    packet = next(_packets(clip), None)
    return 0 if packet is None else max(-_frame(packet.dts, packet, rate), 0)


def _frame(time: int, packet: Any, rate: Fraction) -> int:
    unit: Fraction = packet.time_base
    return round(time * unit * rate)


def _packets(clip: Path) -> Iterator[Any]:
    """Packets of the video stream but for the empty one at the end."""
    with reading(clip, REMEDY), open_container(clip) as container:
        for packet in container.demux(video=0):
            if packet.size:
                yield packet


def _copied_stream(container: Any, template: Any) -> Any:
    # Unless opaque, PyAV looks for an encoder of the decoder's name, which AV1 does not have.
    stream = container.add_stream_from_template(template, opaque=True)
    stream.codec_context.codec_tag = template.codec_context.codec_tag  # ProRes's profile is nowhere else
    return stream
