"""Viewing conditions of experiments that state pixels per degree."""

from __future__ import annotations

import math

import numpy as np

from enfilade.records import F64
from enfilade.viewing import Viewing

DISTANCE_M = 1.0  # arbitrary: only the angle of a pixel matters


def screen(
    size_px: int, pixels_per_degree: float, *, fps: float = 60.0, peak_cd_m2: float = 100.0
) -> Viewing:
    """Viewing conditions of a square image, from the angle that a pixel covers.

    Parameters
    ----------
    size_px : int
        Side of the image, pixels.
    pixels_per_degree : float
        At the centre of the screen.
    fps : float
        Images per second.
    peak_cd_m2 : float
        Luminance of white, cd/m2; black is 0.

    Returns
    -------
    Viewing
        With `pixels_per_degree` as given.
    """
    pitch_m = DISTANCE_M * math.tan(math.radians(1.0)) / pixels_per_degree
    return Viewing(
        size_px,
        size_px,
        diagonal_m=pitch_m * math.hypot(size_px, size_px),
        distance_m=DISTANCE_M,
        fps=fps,
        peak_cd_m2=peak_cd_m2,
        black_cd_m2=0.0,
    )


def plane(size_px: int, pixels_per_degree: float) -> tuple[F64, F64]:
    """Degrees from the centre of an image, which is a pixel: x to the right, y down."""
    steps = (np.arange(size_px) - size_px // 2) / pixels_per_degree
    x, y = np.meshgrid(steps, steps)
    return x, y
