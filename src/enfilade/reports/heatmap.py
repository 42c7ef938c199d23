"""Heat maps: visible differences in colour over the grey image, with a legend, as a video or as PNGs.

Where no difference is seen, the image is grey.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from enfilade.errors import SettingsError
from enfilade.images import encode_video
from enfilade.images.stills import DECODED, to_bytes
from enfilade.records import F32, U8
from enfilade.reports.charts import Figure, pixels, save_picture
from enfilade.reports.scales import VISIBLE
from enfilade.settings import VideoSettings

VIDEO_CODECS = {".mp4": "h264", ".mkv": "ffv1", ".mov": "prores"}  # by suffix
FAINT_JND, SOLID_JND = 0.25, 1.0  # where colour begins, and hides most of the grey
OPACITY = 0.9  # largest
DARKEST, LIGHTEST = 0.06, 0.62  # encoded black and white of the grey image, so that colours stand out
LEAST_WIDTH_PX = 480  # narrower images are enlarged by a whole factor, for a legible legend
BACKGROUND, INK = "#111111", "#EEEEEE"


def overlay(jnd: F32, grey: F32) -> F32:
    """Colour a map of visible differences over an image.

    Parameters
    ----------
    jnd : (H, W) float32
        Visible difference, JND, on the scale :data:`~enfilade.reports.scales.VISIBLE`.
    grey : (H, W) float32
        The image, encoded for a screen, 0..1.

    Returns
    -------
    (H, W, 3) float32
        Encoded sRGB, 0..1.
    """
    opacity = OPACITY * np.clip((jnd - FAINT_JND) / (SOLID_JND - FAINT_JND), 0.0, 1.0)[..., None]
    shown = DARKEST + (LIGHTEST - DARKEST) * np.clip(grey, 0.0, 1.0)[..., None]
    mixed: F32 = (opacity * VISIBLE.ramp[VISIBLE.step(jnd)] + (1.0 - opacity) * shown).astype(np.float32)
    return mixed


class HeatmapPainter:
    """Paints heat maps of one size, with the legend and a caption below.

    Parameters
    ----------
    width, height : int
        Of the maps, pixels.

    Attributes
    ----------
    width, height : int
        Of the pictures, even. Narrow maps are enlarged by a whole factor; the legend is below.
    """

    def __init__(self, width: int, height: int) -> None:
        self._scale = -(-LEAST_WIDTH_PX // width) if width < LEAST_WIDTH_PX else 1
        self._map_size = (height * self._scale, width * self._scale)
        self.width = self._map_size[1] + self._map_size[1] % 2
        self._text_px = int(np.clip(self.width / 52, 10, 30))
        self._legend = self._drawn_legend()
        strips = self._legend.shape[0] + self._caption_height
        self.height = self._map_size[0] + strips + (self._map_size[0] + strips) % 2

    @property
    def _caption_height(self) -> int:
        return 2 * self._text_px

    @property
    def _side(self) -> float:
        return 1.2 * self._text_px / self.width

    def paint(self, jnd: F32, grey: F32, caption: str) -> U8:
        """Paint one frame.

        Parameters
        ----------
        jnd, grey : (H, W) float32
            See :func:`overlay`.
        caption
            One line, below the image.

        Returns
        -------
        (height, width, 3) uint8
            Encoded sRGB.
        """
        picture: U8 = np.full((self.height, self.width, 3), int(BACKGROUND[1:3], 16), np.uint8)
        painted = to_bytes(overlay(jnd, grey))
        rows, columns = self._map_size
        picture[:rows, :columns] = painted.repeat(self._scale, axis=0).repeat(self._scale, axis=1)
        below = rows + self._caption_height
        picture[rows:below] = self._drawn_caption(caption)
        picture[below : below + self._legend.shape[0]] = self._legend
        return picture

    def _figure(self, height_px: int) -> Figure:
        # At 72 dots per inch, a point of text is a pixel.
        return Figure(figsize=(self.width / 72, height_px / 72), dpi=72, facecolor=BACKGROUND)

    def _drawn_caption(self, text: str) -> U8:
        figure = self._figure(self._caption_height)
        figure.text(self._side, 0.45, text, color=INK, fontsize=self._text_px, va="center")
        return pixels(figure)

    def _drawn_legend(self) -> U8:
        height_px = round(4.2 * self._text_px)
        figure = self._figure(height_px)
        side = self._side
        ax = figure.add_axes((side, 0.72, 1.0 - 2.0 * side, 0.24))
        ramp = VISIBLE.values(self.width)[None, :]
        ax.imshow(overlay(ramp, np.full_like(ramp, 0.5)), aspect="auto", extent=(0.0, 1.0, 0.0, 1.0))
        ax.set_yticks([])
        *labels, last = (f"{jnd:g}" for jnd in VISIBLE.colors)
        ax.set_xticks(VISIBLE.place(list(VISIBLE.colors)).tolist(), [*labels, f"≥ {last}"])
        ax.get_xticklabels()[-1].set_horizontalalignment("right")
        ax.tick_params(colors=INK, labelsize=0.9 * self._text_px, length=3, pad=1)
        ax.spines[:].set_visible(False)
        figure.text(
            side, 0.06, "just noticeable differences (JND): 1 is noticed in 3 of 4 cases",
            color=INK, fontsize=0.9 * self._text_px, va="bottom",
        )  # fmt: skip
        return pixels(figure)


def write_heatmap_video(file: Path, pictures: Iterable[U8], *, size: tuple[int, int], fps: float) -> None:
    """Encode pictures of :class:`HeatmapPainter` as a video, whole or not at all.

    Parameters
    ----------
    file
        The suffix chooses the codec: `.mp4` H.264, `.mkv` FFV1 (lossless), `.mov` ProRes.
    pictures : iterable of (height, width, 3) uint8
    size
        Width and height.
    fps

    Raises
    ------
    SettingsError
        Another suffix.
    RunFolderError
        The file can't be written.
    """
    codec = VIDEO_CODECS.get(file.suffix.lower())
    if codec is None:
        raise SettingsError(f"{file}: a heat map is written as {', '.join(VIDEO_CODECS)}, or into a folder")
    linear = (DECODED[picture] for picture in pictures)
    settings = VideoSettings(codec=codec)
    encode_video(file, linear, fps=fps, width=size[0], height=size[1], settings=settings, exposure_ev=0.0)


def write_heatmap_images(folder: Path, pictures: Iterable[tuple[str, U8]]) -> None:
    """Write pictures as PNGs.

    Parameters
    ----------
    folder
        Made where it is missing. Files of the same names in it are replaced.
    pictures : iterable of (str, (height, width, 3) uint8)
        Name of the file without its suffix, and the picture.

    Raises
    ------
    RunFolderError
        The folder can't be written.
    """
    for name, picture in pictures:
        save_picture(picture, folder / f"{name}.png")
