"""The codecs of encoded videos, with their containers and encoder options."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from enfilade.errors import SettingsError


@dataclass(frozen=True)
class Codec:
    """A codec and its container.

    Attributes
    ----------
    encoder : str
        FFmpeg's name.
    suffix : str
        Of the file; it determines the container.
    bits : int
        Of a sample.
    pixel_format : str
        FFmpeg's name.
    odd_pixel_format : str
        Pixel format for an odd width or height; empty if the codec can't encode one.
    min_side : int
        Smallest width and height, pixels.
    max_quality : int
        Largest rate factor; 0 if the codec has none.
    options : mapping of str to str
        Of the encoder.
    max_height, max_fps : float
        Largest height in pixels, and frames per second.
    """

    encoder: str
    suffix: str
    bits: int
    pixel_format: str
    odd_pixel_format: str
    min_side: int
    max_quality: int
    options: Mapping[str, str]
    max_height: float = math.inf
    max_fps: float = math.inf

    def pixel_format_for(self, width: int, height: int) -> str:
        """Pixel format for an image size; SettingsError if the codec can't encode it."""
        problem = f"{self.encoder} can't encode {width}x{height} pixels"
        if min(width, height) < self.min_side:
            raise SettingsError(
                f"{problem}: each side must have {self.min_side} at least; choose a larger size"
                + (", or another [video] codec" if self.min_side > 2 else "")
            )
        if height > self.max_height:
            raise SettingsError(
                f"{problem}: {self.max_height} is its greatest height; choose another [video] codec"
            )
        chosen = self.odd_pixel_format if width % 2 or height % 2 else self.pixel_format
        if not chosen:
            raise SettingsError(f"{problem}; choose an even size or another [video] codec")
        return chosen

    def check_rate(self, fps: float | Fraction) -> None:
        """Refuse frames per second that the codec can't encode, by a SettingsError."""
        if fps > self.max_fps:
            raise SettingsError(
                f"{self.encoder} can't encode {float(fps):g} frames per second: {self.max_fps} is its most; "
                "choose another [video] codec"
            )

    def options_for(self, quality: int) -> dict[str, str]:
        """Options of the encoder for a rate factor; SettingsError if it is out of range."""
        if not self.max_quality:
            return dict(self.options)
        if quality > self.max_quality:
            known = f"between 0 and {self.max_quality} for {self.encoder}"
            raise SettingsError(f"[video] quality = {quality} is out of range: it must be {known}")
        return {**self.options, "crf": str(quality)}


CODECS = {
    # H.264 with more than one thread gives other bytes from run to run, and so do x264's approximations for
    # one type of CPU, whatever the number of threads. Short look-aheads bound the frames
    # held: at 1920x1080 memory stops growing after 30 frames of H.264 (0.5 GB), 100 of AV1 (1.1 GB).
    "h264": Codec(
        "libx264", ".mp4", 8, "yuv420p", "yuv444p", 2, 51,
        {
            "preset": "medium",
            "threads": "1",
            "x264-params": "threads=1:lookahead-threads=1:rc-lookahead=16:cpu-independent=1",
        },
    ),
    "ffv1": Codec(
        "ffv1", ".mkv", 12, "gbrp12le", "gbrp12le", 2, 0,
        {"level": "3", "slicecrc": "1", "slices": "4", "coder": "1"},
    ),
    "av1": Codec(
        "libsvtav1", ".mp4", 10, "yuv420p10le", "", 64, 63,
        {"preset": "6", "svtav1-params": "lp=1:lookahead=16"}, 8704, 240,
    ),
    "prores": Codec("prores_ks", ".mov", 10, "yuv444p10le", "yuv444p10le", 2, 0, {"profile": "4444"}),
}  # fmt: skip


def video_suffix(codec: str) -> str:
    """Suffix of a video file, with its dot."""
    return CODECS[codec].suffix


def odd_size_note(codec: str, width: int, height: int) -> str:
    """Note that few players show a video of odd width or height, with the next smaller even size; or ""."""
    known = CODECS[codec]
    if known.pixel_format_for(width, height) == known.pixel_format:
        return ""
    return (
        f"{width}x{height} pixels: of odd sizes {codec} makes 4:4:4 video, which QuickTime, Safari, Firefox "
        f"and most hardware can't play; --size {max(width // 2 * 2, 2)}x{max(height // 2 * 2, 2)} is even"
    )
