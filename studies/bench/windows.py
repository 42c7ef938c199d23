"""Windows of the image in which a bench measures: drawn from the scene before any configuration is rendered.

A window is a square of pixels, the same in all frames. One is drawn for each of four kinds of content: edges
of objects, gloss (glossy, mirroring and transparent surfaces), shadows (light that varies over one surface),
and flat surfaces without any of these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from enfilade.errors import InputError
from enfilade.kernels.tone import REC709_LUMINANCE
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import F32, Geometry
from enfilade.renderer import PixelFilter, Purpose

KINDS = ("edges", "gloss", "shadows", "flat")
MARGIN_PX = 1  # between a window and the border of the image: the Gaussian filter reaches beyond its pixels
LARGEST_PX = 256  # side
SHARE_OF_SIDE = 0.4  # side of a window over the shorter side of the image, below `LARGEST_PX`
MIN_SHARE = 0.02  # of a kind in its window; a scene with less has no window of this kind
STEPS = 4  # positions of candidates per side
SAMPLED_FRAMES = 4  # spread over the path
PREVIEW_SPP = 32
BLOCK_PX = 4  # side of the blocks over which irradiance is averaged
SIGNIFICANT = 4.0  # standard deviations of the preview's noise: a smaller change is none
FULL_CHANGE = 1.0  # change of log irradiance between neighbouring blocks that counts fully as a shadow

Map = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Window:
    """A rectangle of pixels.

    Attributes
    ----------
    kind : str
        One of :data:`KINDS`.
    left, top, side : int
        Pixels.
    """

    kind: str
    left: int
    top: int
    side: int

    def crop(self, image: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """The window's pixels of an image (H, W, ...)."""
        return image[self.top : self.top + self.side, self.left : self.left + self.side]


def draw_windows(walk: Walkthrough) -> list[Window]:
    """Draw a window of each kind that the scene has, without overlap.

    Candidates lie on a grid. Each kind in turn takes the candidate with the largest share of its content,
    averaged over frames along the path.

    Parameters
    ----------
    walk
        The walkthrough. Traces :data:`PREVIEW_SPP` paths a pixel of a few frames.

    Raises
    ------
    InputError
        The image is too small, or shows no surfaces.
    """
    height, width = walk.path.height, walk.path.width
    side = min(LARGEST_PX, int(SHARE_OF_SIDE * min(height, width)) // 8 * 8)
    if side < 8:
        raise InputError(f"a bench needs images of 20 pixels or more on each side; this is {width}x{height}")
    count = min(SAMPLED_FRAMES, len(walk.path))
    frames = sorted({round((i + 0.5) * len(walk.path) / count - 0.5) for i in range(count)})
    maps = [content(walk, frame) for frame in frames]
    step = max(side // STEPS, 1)
    corners = [
        (top, left)
        for top in range(MARGIN_PX, height - side - MARGIN_PX + 1, step)
        for left in range(MARGIN_PX, width - side - MARGIN_PX + 1, step)
    ]
    chosen: list[Window] = []
    for kind in KINDS:
        mean = np.mean([shares[kind] for shares in maps], axis=0)
        found = [
            (float(window.crop(mean).mean()), window)
            for window in (Window(kind, left, top, side) for top, left in corners)
            if not any(_overlap(window, other) for other in chosen)
        ]
        share, window = max(found, key=lambda one: one[0], default=(0.0, None))  # the first of equal shares
        if window is not None and share > MIN_SHARE:
            chosen.append(window)
    if not chosen:
        raise InputError(
            f"no window of {side}x{side} pixels has surfaces in {MIN_SHARE:.0%} of it; choose other frames"
        )
    return chosen


def content(walk: Walkthrough, frame: int) -> dict[str, Map]:
    """Presence of each kind of content in a frame, (H, W), 0 to 1."""
    geometry = walk.view(frame).geometry
    edges = _edges(geometry)
    gloss = geometry.is_specular & geometry.is_hit
    shadows = _shadows(walk, frame, geometry)
    plain = geometry.is_hit & ~edges & ~gloss
    return {
        "edges": edges.astype(np.float64),
        "gloss": gloss.astype(np.float64),
        "shadows": shadows,
        "flat": plain * (1.0 - shadows),
    }


def _edges(geometry: Geometry) -> npt.NDArray[np.bool_]:
    """Pixels whose right or lower neighbour shows another shape."""
    index = geometry.shape_index
    found = np.zeros(index.shape, np.bool_)
    found[:, :-1] |= index[:, :-1] != index[:, 1:]
    found[:-1] |= index[:-1] != index[1:]
    return found


def _shadows(walk: Walkthrough, frame: int, geometry: Geometry) -> Map:
    """Change of irradiance between blocks of the same diffuse shape, by a preview."""
    shape = geometry.shape_index.shape
    traced = walk.trace(frame, Purpose.PREVIEW, spp=PREVIEW_SPP, pixel_filter=PixelFilter.CENTRE)
    color, albedo = (i @ np.array(REC709_LUMINANCE) for i in (traced.color, geometry.albedo))
    is_lit = geometry.has_diffuse & ~geometry.is_specular
    gain = np.where(is_lit, 1.0 / np.maximum(albedo, 1e-3), 0.0)
    mean, count = _blocks(gain * color), _blocks(is_lit.astype(np.float64))
    variance = _blocks(gain**2 * traced.variance) / BLOCK_PX**2
    index = geometry.shape_index[BLOCK_PX // 2 :: BLOCK_PX, BLOCK_PX // 2 :: BLOCK_PX].astype(np.int64)
    index = index[: mean.shape[0], : mean.shape[1]]
    change = np.zeros(mean.shape)
    for axis in (0, 1):
        (a, b), (var_a, var_b), (count_a, count_b), (shape_a, shape_b) = (
            _neighbours(blocks, axis) for blocks in (mean, variance, count, index)
        )
        step = np.abs(np.log(np.maximum(a, 1e-6)) - np.log(np.maximum(b, 1e-6))) / FULL_CHANGE
        is_counted = (np.abs(a - b) > SIGNIFICANT * np.sqrt(var_a + var_b)) & (shape_a == shape_b)
        is_counted &= (count_a == 1.0) & (count_b == 1.0)
        part = _neighbours(change, axis)[0]
        np.maximum(part, np.where(is_counted, np.minimum(step, 1.0), 0.0), out=part)
    found = np.zeros(shape)
    whole = change.repeat(BLOCK_PX, axis=0).repeat(BLOCK_PX, axis=1)[: shape[0], : shape[1]]
    found[: whole.shape[0], : whole.shape[1]] = whole
    return found


def _blocks(image: F32 | Map) -> Map:
    """Means over blocks of :data:`BLOCK_PX`; an incomplete block at the border is left out."""
    rows, columns = image.shape[0] // BLOCK_PX, image.shape[1] // BLOCK_PX
    cut = image[: rows * BLOCK_PX, : columns * BLOCK_PX].astype(np.float64)
    means: Map = cut.reshape(rows, BLOCK_PX, columns, BLOCK_PX).mean(axis=(1, 3))
    return means


def _neighbours(blocks: npt.NDArray[Any], axis: int) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Views of the blocks and of their lower (axis 0) or right neighbours."""
    return (blocks[:-1], blocks[1:]) if axis == 0 else (blocks[:, :-1], blocks[:, 1:])


def _overlap(a: Window, b: Window) -> bool:
    return abs(a.left - b.left) < a.side and abs(a.top - b.top) < a.side


def windows_of(table: Sequence[dict[str, object]]) -> list[Window]:
    """Windows of their JSON form, a list of their attributes."""
    return [Window(**one) for one in table]  # type: ignore[arg-type]
