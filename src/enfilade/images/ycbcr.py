"""R'G'B' <-> Y'CbCr (ITU-T H.273, 8.3), and planes of samples <-> FFmpeg's frames.

FFmpeg's own converter repeats chroma, and its rounding depends on the processor; this one gives the same
bytes on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import av
import numpy as np
import numpy.typing as npt

from enfilade.records import F32

Plane = npt.NDArray[Any]

BT709 = (0.2126, 0.0722)  # K_R, K_B, ITU-R BT.709-6, item 3.2
BT601 = (0.299, 0.114)  # K_R, K_B, ITU-R BT.601-7, 2.5.1
MATRICES = {1: BT709, 5: BT601, 6: BT601}  # ITU-T H.273, table 4
LIMITED_RANGE, FULL_RANGE = 1, 2  # FFmpeg's AVColorRange


def _bayer(levels: int) -> F32:
    """A recursive matrix of thresholds in units of a code, evenly from -1/2 to 1/2, mean 0."""
    y, x = np.indices((1 << levels, 1 << levels))
    order = np.zeros_like(x)
    for bit in range(levels):
        order |= ((((x ^ y) >> bit) & 1) << 1 | ((y >> bit) & 1)) << 2 * (levels - 1 - bit)
    thresholds: F32 = ((order + 0.5) / order.size - 0.5).astype(np.float32)
    return thresholds


# Bayer, ICC 1973. As large as the transform blocks of H.264: few coefficients describe it, and x264 keeps it
# at CRF 16. Blue noise is removed by the encoder, and smooth walls show bands again.
DITHER = _bayer(3)


def planes_from_rgb(
    rgb: F32, *, bits: int, is_halved: bool, is_dithered: bool = False
) -> tuple[Plane, Plane, Plane]:
    """Encode as Y', Cb, Cr of BT.709 in limited range.

    Parameters
    ----------
    rgb : (H, W, 3) float32
        Encoded (not linear) values, 0..1.
    bits
        Of a sample: 8 (uint8 planes) to 16 (uint16).
    is_halved
        4:2:0: chroma has half the columns and rows, sited on the left luma column between two rows, the
        default of H.264 and AV1.
    is_dithered
        Add :data:`DITHER` before rounding, mirrored for each chroma. Values between two codes become a
        mixture of both with the right mean; values that are codes do not change.

    Returns
    -------
    tuple of (H, W), (H', W'), (H', W') uint8 or uint16
        Half sizes are rounded up.
    """
    kr, kb = BT709
    luma = rgb @ np.array([kr, 1.0 - kr - kb, kb], np.float32)
    blue = (rgb[..., 2] - luma) / np.float32(2.0 * (1.0 - kb))
    red = (rgb[..., 0] - luma) / np.float32(2.0 * (1.0 - kr))
    if is_halved:
        blue, red = _halved(blue), _halved(red)
    unit = 2.0 ** (bits - 8)
    y, cb, cr = (
        quantized(
            values * scale + zero + (_tiled(pattern, values) / unit if is_dithered else 0.0), bits, unit=unit
        )
        for values, scale, zero, pattern in (
            (luma, 219.0, 16.0, DITHER),
            (blue, 224.0, 128.0, DITHER[::-1]),
            (red, 224.0, 128.0, DITHER[:, ::-1]),
        )
    )
    return y, cb, cr


def rgb_from_planes(
    planes: Sequence[Plane], *, bits: int, weights: tuple[float, float], is_full_range: bool
) -> F32:
    """Decode Y', Cb, Cr to encoded R'G'B', the inverse of :func:`planes_from_rgb`.

    Parameters
    ----------
    planes : sequence of (H, W), (H', W'), (H', W')
        Chroma of full or half columns and rows, sited as there.
    bits
        Of a sample.
    weights
        K_R and K_B: :data:`BT709` or :data:`BT601`.
    is_full_range
        0..255 in place of 16..235 (of 8 bits).

    Returns
    -------
    (H, W, 3) float32
        0..1, clipped.
    """
    kr, kb = weights
    height, width = planes[0].shape
    unit = np.float32(2.0 ** (bits - 8))
    top = np.float32(2.0**bits - 1.0)
    black, luma_span, chroma_span = (0.0, top, top) if is_full_range else (16 * unit, 219 * unit, 224 * unit)
    luma = (planes[0].astype(np.float32) - np.float32(black)) / np.float32(luma_span)
    blue, red = (
        _doubled((plane.astype(np.float32) - 128 * unit) / np.float32(chroma_span), height, width)
        for plane in planes[1:]
    )
    r = luma + np.float32(2.0 * (1.0 - kr)) * red
    b = luma + np.float32(2.0 * (1.0 - kb)) * blue
    g = (luma - np.float32(kr) * r - np.float32(kb) * b) / np.float32(1.0 - kr - kb)
    rgb: F32 = np.clip(np.stack([r, g, b], axis=2), 0.0, 1.0)
    return rgb


def quantized(values: F32, bits: int, *, unit: float) -> Plane:
    """Round to integers of so many bits, ``floor(unit * values + 1/2)``, clipped to their range."""
    rounded = np.floor(values * np.float32(unit) + np.float32(0.5))
    integers: Plane = np.clip(rounded, 0.0, 2.0**bits - 1.0).astype(np.uint8 if bits == 8 else np.uint16)
    return integers


def frame_of(planes: Sequence[Plane], pixel_format: str) -> Any:
    """A frame of FFmpeg's planar `pixel_format` (little-endian), of the size of the first plane."""
    height, width = planes[0].shape
    frame = av.VideoFrame(width, height, pixel_format)
    for target, samples in zip(frame.planes, planes, strict=True):
        rows = np.zeros((target.height, target.line_size), np.uint8)
        raw = np.ascontiguousarray(samples).view(np.uint8)
        rows[:, : raw.shape[1]] = raw
        target.update(rows)
    return frame


def planes_of(frame: Any) -> list[Plane]:
    """The first three planes of a frame of FFmpeg in a planar little-endian format, not copied."""
    kind = np.dtype("<u2") if frame.format.components[0].bits > 8 else np.dtype(np.uint8)
    rows = [np.frombuffer(p, kind).reshape(p.height, p.line_size // kind.itemsize) for p in frame.planes[:3]]
    return [samples[:, : p.width] for samples, p in zip(rows, frame.planes, strict=False)]


def _tiled(pattern: F32, values: F32) -> F32:
    height, width = values.shape
    tiled: F32 = np.tile(pattern, (height // len(pattern) + 1, width // len(pattern) + 1))[:height, :width]
    return tiled


def _halved(plane: F32) -> F32:
    height, width = plane.shape
    # columns: weights 1 2 1 around every even one
    wide = np.pad(plane, ((0, height % 2), (1, 1 + width % 2)), mode="edge")
    columns = 0.25 * wide[:, :-2:2] + 0.5 * wide[:, 1:-1:2] + 0.25 * wide[:, 2::2]
    # rows: mean of each pair
    halved: F32 = (0.5 * (columns[0::2] + columns[1::2])).astype(np.float32)
    return halved


def _doubled(plane: F32, height: int, width: int) -> F32:
    if plane.shape[1] < width:
        following = np.pad(plane, ((0, 0), (0, 1)), mode="edge")[:, 1:]
        plane = np.stack([plane, 0.5 * (plane + following)], axis=2).reshape(plane.shape[0], -1)[:, :width]
    if plane.shape[0] < height:
        around = np.pad(plane, ((1, 1), (0, 0)), mode="edge")
        above, below = 0.25 * around[:-2] + 0.75 * plane, 0.25 * around[2:] + 0.75 * plane
        plane = np.stack([above, below], axis=1).reshape(-1, plane.shape[1])[:height]
    return plane
