"""Frame interpolation by FFmpeg's ``minterpolate``, which estimates motion from the images alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Any

import av
import av.filter
import numpy as np

from enfilade.errors import SettingsError
from enfilade.images.ycbcr import BT709, frame_of, planes_from_rgb, planes_of, rgb_from_planes
from enfilade.kernels.tone import srgb_decode, srgb_encode
from enfilade.records import F32

FILTER = "minterpolate"
OPTIONS = "mi_mode=mci:mc_mode=aobmc:me_mode=bidir:vsbmc=1:scd=none"  # best quality
PIXELS = "yuv444p"  # the filter supports 8 bits only
MARGIN = 4  # repeats of the first and the last frame: the filter uses two frames on either side


def interpolate(keyframes: Mapping[int, F32], fps: Fraction) -> Iterator[tuple[int, F32]]:
    """Interpolate the frames between keyframes.

    Parameters
    ----------
    keyframes : mapping of int to (H, W, 3) float32
        Linear Rec.709, two or more, by frame number.
    fps
        Frames per second.

    Yields
    ------
    int, (H, W, 3) float32
        Number and image of each frame from the first keyframe to the last, keyframes included, rounded to
        8 bits, the format of FFmpeg's filter.

    Raises
    ------
    SettingsError
        FFmpeg was built without the filter.
    """
    if why := why_no_interpolation():
        raise SettingsError(why)
    numbers = sorted(keyframes)
    first, last = numbers[0], numbers[-1]
    height, width = keyframes[first].shape[:2]
    graph, source = _graph(width, height, fps)
    lead = [(first - k, first) for k in range(MARGIN, 0, -1)]
    tail = [(last + k, last) for k in range(1, MARGIN + 1)]
    for at, number in [*lead, *((n, n) for n in numbers), *tail]:
        picture = _picture(keyframes[number])
        picture.pts, picture.time_base = at - first + MARGIN, 1 / fps
        source.push(picture)
        yield from _frames(graph, first, last)
    source.push(None)
    yield from _frames(graph, first, last)


def why_no_interpolation() -> str:
    """Reason why the filter is missing; empty if it is there."""
    if FILTER in av.filter.filters_available:
        return ""
    return f"the FFmpeg inside PyAV {av.__version__} was built without its filter {FILTER}"


def _graph(width: int, height: int, fps: Fraction) -> tuple[Any, Any]:
    graph = av.filter.Graph()
    source = graph.add_buffer(width=width, height=height, format=PIXELS, time_base=1 / fps)
    interpolator = graph.add(FILTER, f"fps={fps.numerator}/{fps.denominator}:{OPTIONS}")
    sink = graph.add("buffersink")
    source.link_to(interpolator)
    interpolator.link_to(sink)
    graph.configure()
    return graph, source


def _frames(graph: Any, first: int, last: int) -> Iterator[tuple[int, F32]]:
    while True:
        try:
            picture = graph.pull()
        except (av.BlockingIOError, av.EOFError):
            return
        number = int(picture.pts) + first - MARGIN
        if first <= number <= last:
            yield number, _linear(picture)


def _picture(linear: F32) -> Any:
    encoded = srgb_encode(np.clip(linear, 0.0, 1.0)).astype(np.float32)
    return frame_of(planes_from_rgb(encoded, bits=8, is_halved=False), PIXELS)


def _linear(picture: Any) -> F32:
    return srgb_decode(rgb_from_planes(planes_of(picture), bits=8, weights=BT709, is_full_range=False))
