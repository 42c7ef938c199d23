"""The codecs that a video can be encoded with, and what each is told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from enfilade.errors import SettingsError

__all__ = ["Codec", "codec_named", "odd_size_note", "video_suffix"]


@dataclass(frozen=True)
class Codec:
    """A codec and its container.

    Attributes
    ----------
    encoder : str
        FFmpeg's name.
    container, suffix : str
    pixels : str
        FFmpeg's pixel format.
    bits : int
        Of a sample.
    odd_pixels : str
        Pixel format where width or height is odd; empty where that can't be encoded.
    least : int
        Smallest width and height.
    worst_quality : int
        Largest rate factor; 0 where there is none to choose.
    options : mapping of str to str
        For the encoder.
    """

    encoder: str
    container: str
    suffix: str
    pixels: str
    bits: int
    odd_pixels: str
    least: int
    worst_quality: int
    options: Mapping[str, str]

    def pixels_for(self, width: int, height: int) -> str:
        """Pixel format for an image of that size.

        Raises
        ------
        SettingsError
            The codec can't encode it.
        """
        if min(width, height) < self.least:
            raise SettingsError(
                f"{self.encoder} can't encode {width}x{height} pixels, {self.least} is its least; "
                "choose another [video] codec"
            )
        if not (width % 2 or height % 2):
            return self.pixels
        if not self.odd_pixels:
            raise SettingsError(
                f"{self.encoder} can't encode {width}x{height} pixels; choose an even size or another "
                "[video] codec"
            )
        return self.odd_pixels

    def options_for(self, quality: int) -> dict[str, str]:
        """Options of the encoder for a rate factor.

        Raises
        ------
        SettingsError
            The factor is out of the codec's range.
        """
        if not self.worst_quality:
            return dict(self.options)
        if quality > self.worst_quality:
            raise SettingsError(
                f"[video] quality = {quality} is out of range for {self.encoder}: it must be between 0 and "
                f"{self.worst_quality}"
            )
        return {**self.options, "crf": str(quality)}


CODECS = {
    # H.264 with more than one thread gives other bytes from run to run, and so do x264's approximations for
    # one type of CPU, whatever the number of threads. Short look-aheads bound the frames
    # held: at 1920x1080 memory stops growing after 30 frames of H.264 (0.5 GB), 100 of AV1 (1.1 GB).
    "h264": Codec(
        "libx264", "mp4", ".mp4", "yuv420p", 8, "yuv444p", 2, 51,
        {
            "preset": "medium",
            "threads": "1",
            "x264-params": "threads=1:lookahead-threads=1:rc-lookahead=16:cpu-independent=1",
        },
    ),
    "ffv1": Codec(
        "ffv1", "matroska", ".mkv", "gbrp12le", 12, "gbrp12le", 1, 0,
        {"level": "3", "slicecrc": "1", "slices": "4", "coder": "1"},
    ),
    "av1": Codec(
        "libsvtav1", "mp4", ".mp4", "yuv420p10le", 10, "", 64, 63,
        {"preset": "6", "svtav1-params": "lp=1:lookahead=16"},
    ),
    "prores": Codec("prores_ks", "mov", ".mov", "yuv444p10le", 10, "yuv444p10le", 2, 0, {"profile": "4444"}),
}  # fmt: skip


def codec_named(name: str) -> Codec:
    """Codec of a setting.

    Raises
    ------
    SettingsError
        There is none of that name.
    """
    if name not in CODECS:
        raise SettingsError(f"unknown [video] codec {name!r}; known are: {', '.join(CODECS)}")
    return CODECS[name]


def video_suffix(codec: str) -> str:
    """Suffix of a video file, with its dot, by the codec's name in the settings.

    Raises
    ------
    SettingsError
        There is none of that name.
    """
    return codec_named(codec).suffix


def odd_size_note(codec: str, width: int, height: int) -> str:
    """Say where few players show a video because its width or height is odd; empty where it is not so.

    Parameters
    ----------
    codec
        Its name in the settings.
    width, height
        Pixels.

    Returns
    -------
    str
        With the even size next below.
    """
    known = codec_named(codec)
    if known.pixels_for(width, height) == known.pixels:
        return ""
    return (
        f"{width}x{height} pixels: of odd sizes {codec} makes 4:4:4 video, which QuickTime, Safari, Firefox "
        f"and most hardware can't play; --size {max(width // 2 * 2, 2)}x{max(height // 2 * 2, 2)} is even"
    )
