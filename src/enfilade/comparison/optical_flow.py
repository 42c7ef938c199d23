"""Image flow estimated from the images alone: dense inverse search (Kroeger et al. 2016), by OpenCV.

For sequences that come without flow: videos, PNG, OpenEXR of a renderer that writes no motion vectors.
OpenCV's implementation takes 0.04 s of CPU time a flow at 640x480, where scikit-image's TV-L1 and
iterative Lucas-Kanade take seconds, and it is kept by the largest project of the field.

Kroeger, Timofte, Dai, Van Gool: "Fast Optical Flow using Dense Inverse Search", ECCV 2016.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from enfilade.errors import InputError
from enfilade.records import F32, U8, Flow

WIDEST_PX = 1024  # larger images are halved before the search: 0.1 s a flow at most
LEAST_PX = 32  # the search's patches are 8 pixels, over three levels; smaller images are enlarged
SMOOTH_PX = 1.0  # sigma of a blur before the search: pixel noise is no motion
BLOCK_PX = 8  # images are compared by blocks of this, in which noise is averaged out
CUT_RESIDUAL = 10.0  # of 255 encoded levels: what is left after compensation where a shot ends ...
CUT_SHARE = 0.6  # ... and its part of what there was before
TRUSTED, REFUSED = 0.7, 0.9  # part of the difference that is left: flow that explains less is taken for noise
WINDOW = 1 / 16  # of the width: sigma of the window in which that is looked at


class FlowEstimator:
    """Flow between neighbouring frames of one sequence, frame by frame, with one frame of look-ahead.

    Parameters
    ----------
    width, height : int
        Of the images, pixels.

    Notes
    -----
    Within 0.05 px (median) of the truth on textured surfaces up to 1024 pixels wide, twice that on
    larger ones; where there is no texture, flow is filled in smoothly from around. Where a flow leaves
    the images nearly as different as they were, they differ by noise, and nothing moves. Reflections and
    shadows are followed as if they were surfaces. Between two shots there is no flow. One thread: OpenCV
    cuts the image into as many stripes as there are threads, and each stripe count has its own result.
    """

    def __init__(self, width: int, height: int) -> None:
        cv2.setNumThreads(1)
        self._size = (width, height)
        self._reduced_size = _reduced(width, height)
        self._search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
        self._grid = _grid(self._reduced_size)

    def luma(self, grey: F32) -> U8:
        """Image as the search takes it: 8 bits, at its own size.

        Parameters
        ----------
        grey : (H, W) float32
            Luminance, encoded for an sRGB display, 1 = white; clipped.

        Raises
        ------
        InputError
            The image has another size than was announced.
        """
        if grey.shape != self._size[::-1]:
            raise InputError(f"flow: the image has shape {grey.shape}, not {self._size[::-1]}")
        levels: U8 = np.rint(np.clip(grey, 0.0, 1.0) * np.float32(255.0)).astype(np.uint8)
        if self._reduced_size != self._size:
            levels = np.asarray(
                cv2.resize(levels, self._reduced_size, interpolation=cv2.INTER_AREA), np.uint8
            )
        return np.asarray(cv2.GaussianBlur(levels, (0, 0), SMOOTH_PX), np.uint8)

    def flow(self, image: U8, previous: U8 | None, following: U8 | None) -> Flow:
        """Flow of one frame to its neighbours.

        Parameters
        ----------
        image, previous, following
            From :meth:`luma`; None where the sequence begins or ends.

        Returns
        -------
        Flow
            Pixels per frame of the full-size images. A neighbour across a cut counts as none.
        """
        backward, has_backward = self._to(image, previous)
        forward, has_forward = self._to(image, following)
        return Flow(backward, forward, has_backward, has_forward)

    def _to(self, image: U8, other: U8 | None) -> tuple[F32, bool]:
        width, height = self._size
        still = np.zeros((height, width, 2), np.float32)
        if other is None:
            return still, False
        if np.array_equal(image, other):
            return still, True
        found = np.asarray(self._search.calc(image, other, None), np.float32)  # type: ignore[call-overload]
        place = self._grid + found
        compensated = np.asarray(
            cv2.remap(other, place[..., 0], place[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE),
            np.uint8,
        )
        if _is_cut(image, other, compensated):
            return still, False
        found *= _trust(image, other, compensated)[..., None]
        if found.shape[:2] != (height, width):
            scale = np.array([width / found.shape[1], height / found.shape[0]], np.float32)
            found = np.asarray(cv2.resize(found, self._size, interpolation=cv2.INTER_LINEAR)) * scale
        return found, True


def _is_cut(image: U8, other: U8, compensated: U8) -> bool:
    now, before, after = (_blocks(of.astype(np.float32)) for of in (image, other, compensated))
    left = float(np.abs(now - after).mean())
    return left > CUT_RESIDUAL and left > CUT_SHARE * float(np.abs(now - before).mean())


def _trust(image: U8, other: U8, compensated: U8) -> F32:
    """Confidence of the flow, (H, W): 0 where it explains none of the difference, 1 where it explains all."""
    height, width = image.shape
    sigma = max(WINDOW * width / BLOCK_PX, 1.0)
    before, after = (
        cv2.GaussianBlur(_blocks(cv2.absdiff(image, of).astype(np.float32)), (0, 0), sigma)
        for of in (other, compensated)
    )
    remainder = after / np.maximum(before, np.float32(1e-3))
    trust = np.clip((REFUSED - remainder) / (REFUSED - TRUSTED), 0.0, 1.0)
    return np.asarray(cv2.resize(trust, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)


def _blocks(image: F32) -> F32:
    height, width = (max(n // BLOCK_PX, 1) for n in image.shape)
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), np.float32)


def _reduced(width: int, height: int) -> tuple[int, int]:
    """Size at which a flow is searched: halved until its longer side is short enough."""
    factor = 1.0
    while max(width, height) * factor > WIDEST_PX:
        factor *= 0.5
    return max(round(width * factor), LEAST_PX), max(round(height * factor), LEAST_PX)


def _grid(size: tuple[int, int]) -> npt.NDArray[np.float32]:
    columns, rows = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    return np.stack([columns, rows], axis=-1).astype(np.float32)
