"""Viewing conditions: screen and distance, pixels to degrees (§6)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from enfilade.errors import InputError

MAX_PIXELS_PER_DEGREE = 1000.0  # ten times what the eye resolves: distances in centimetres are refused
Quantity = TypeVar("Quantity", float, npt.NDArray[np.float32], npt.NDArray[np.float64])


@dataclass(frozen=True)
class Viewing:
    """Viewing conditions: screen, image and distance of the eye.

    The defaults are the paper's (§6), but for the persistence: its tube flashed, for about 0.05.

    Angles are those at the centre of the screen, looked at straight on; towards the corners of a
    screen that is near, a pixel covers a smaller angle, which is left out.

    Parameters
    ----------
    width_px, height_px : int
        Size of the image in pixels, which fills the screen; at least 1.
    diagonal_m : float
        Diagonal of the image on the screen, metres.
    distance_m : float
        From the eye to the screen, metres.
    fps : float
        Frames per second at which the sequence is shown.
    persistence : float
        Share of a frame's time for which the display shows it: 1 on desktops, phones and televisions,
        a few percent in headsets and on tubes.
    peak_cd_m2, black_cd_m2 : float
        Luminance of white and of black on the screen, reflected room light included, cd/m2;
        black may be zero.

    Raises
    ------
    InputError
        A number is not finite or out of range; the message names the field.
    """

    width_px: int
    height_px: int
    diagonal_m: float = 0.25
    distance_m: float = 0.5
    fps: float = 30.0
    peak_cd_m2: float = 100.0
    black_cd_m2: float = 0.1
    persistence: float = 1.0

    def __post_init__(self) -> None:
        for name in ("width_px", "height_px"):
            if not isinstance(pixels := getattr(self, name), (int, np.integer)) or pixels < 1:
                raise InputError(f"viewing: {name} is {pixels!r}; give a whole number of pixels, 1 or more")
        for name in ("diagonal_m", "distance_m", "fps", "peak_cd_m2"):
            if not 0 < (number := getattr(self, name)) < math.inf:
                raise InputError(f"viewing: {name} is {number!r}; give a finite number above 0")
        if not 0 <= self.persistence <= 1:
            raise InputError(f"viewing: persistence is {self.persistence!r}; give a share from 0 to 1")
        if not 0 <= self.black_cd_m2 < self.peak_cd_m2:
            raise InputError(
                f"viewing: black_cd_m2 is {self.black_cd_m2!r}; "
                f"give 0 or more, and less than peak_cd_m2 ({self.peak_cd_m2!r})"
            )
        if self.pixels_per_degree > MAX_PIXELS_PER_DEGREE:
            raise InputError(
                f"viewing: distance_m = {self.distance_m:g} and diagonal_m = {self.diagonal_m:g} show "
                f"{self.pixels_per_degree:.0f} pixels in a degree, more than {MAX_PIXELS_PER_DEGREE:.0f}; "
                "both are in metres"
            )

    @property
    def pixel_pitch_m(self) -> float:
        """Distance between neighbouring pixels on the screen, metres (pixels are square)."""
        return self.diagonal_m / math.hypot(self.width_px, self.height_px)

    @property
    def pixels_per_degree(self) -> float:
        """Pixels in one degree of visual angle at the centre (27.93 for the paper's 640x480)."""
        return self.distance_m * math.tan(math.radians(1.0)) / self.pixel_pitch_m

    def velocity_deg_s(self, flow_px_per_frame: Quantity) -> Quantity:
        """Image velocity in degrees per second, from motion vectors in pixels per frame."""
        return flow_px_per_frame * (self.fps / self.pixels_per_degree)

    def cropped(self, width_px: int, height_px: int) -> Viewing:
        """Conditions for an image of another size shown with the same pixels, pixel for pixel.

        Parameters
        ----------
        width_px, height_px : int
            Size of the crop (or of a larger image), pixels.

        Returns
        -------
        Viewing
            Same pixels per degree, frame rate and luminances.
        """
        diagonal_m = self.pixel_pitch_m * math.hypot(width_px, height_px)
        return replace(self, width_px=width_px, height_px=height_px, diagonal_m=diagonal_m)


# Screens at the distance from which they are usually looked at, and what they stand for. Sizes are those of
# common devices. Distances: 0.6 m at a desk (ISO 9241-303 asks for 0.4 m or more), three picture heights
# before a television (ITU-R BT.2022), half a cinema's length. Luminances: typical settings, the office's
# reflections in the black; the cinema's 48 cd/m2 are SMPTE ST 431-1's.
DISPLAYS = {
    "paper": (Viewing(640, 480, 0.25, 0.5, 30.0, 100.0, 0.1, 0.05), "the paper's tube (§6), 28 px/deg"),
    "desktop-24-fhd": (Viewing(1920, 1080, 0.61, 0.6, 30.0, 200.0, 0.3), "24 inch monitor, in an office"),
    "desktop-27-4k": (Viewing(3840, 2160, 0.686, 0.6, 30.0, 250.0, 0.3), "27 inch monitor, in an office"),
    "laptop-14": (Viewing(1920, 1200, 0.356, 0.5, 30.0, 250.0, 0.4), "14 inch laptop, in an office"),
    "phone": (Viewing(2532, 1170, 0.155, 0.35, 30.0, 450.0, 0.5), "6.1 inch phone in the hand, indoors"),
    "tv-55-4k": (Viewing(3840, 2160, 1.397, 2.05, 30.0, 250.0, 0.1), "55 inch television, in the evening"),
    "cinema": (Viewing(4096, 2160, 13.6, 12.0, 30.0, 48.0, 0.024), "12 m wide screen, middle row, dark"),
}  # fmt: skip


def display_named(name: str) -> Viewing:
    """Viewing conditions of a preset, for an image that fills the screen at 30 frames per second.

    Raises
    ------
    InputError
        There is none of that name.
    """
    if name not in DISPLAYS:
        raise InputError(f"unknown display {name!r}; known are: {', '.join(DISPLAYS)}")
    return DISPLAYS[name][0]
