"""Scales of colours for maps: from a number to a colour, and to a place in the legend."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from enfilade.records import F32, U8

__all__ = ["DIFFERENCE", "VELOCITY", "Scale"]

STEPS = 1024  # of the colours of a scale

# Matplotlib's viridis and inferno at nine even places: they grow lighter evenly, in grey print too, and
# are told apart with any of the common colour deficiencies. Here as numbers: a page needs no more of it.
VIRIDIS = ("440154", "472d7b", "3b528b", "2c728e", "21918c", "28ae80", "5ec962", "addc30", "fde725")
INFERNO = ("000004", "210c4a", "57106e", "8a226a", "bc3754", "e45a31", "f98e09", "f9cb35", "fcffa4")


@dataclass(frozen=True)
class Scale:
    """A scale of colours, linear near 0 and logarithmic beyond: faint and strong both show.

    Attributes
    ----------
    knee : float
        Where it bends.
    top : float
        From here on the colour stays.
    ticks : tuple of float
        For the legend, rising, the first 0 and the last `top`.
    colors : tuple of str
        At even places, each six hexadecimal digits of sRGB.
    """

    knee: float
    top: float
    ticks: tuple[float, ...]
    colors: tuple[str, ...]

    def place(self, values: npt.ArrayLike) -> F32:
        """Place of numbers, 0 or more, on the scale, 0..1; the shape stays."""
        bent = np.log1p(np.asarray(values, np.float32) / np.float32(self.knee))
        return np.asarray(np.minimum(bent / np.float32(np.log1p(self.top / self.knee)), 1.0), np.float32)

    def paint(self, values: F32) -> U8:
        """Colour a map: (H, W) float32, 0 or more, to (H, W, 3) uint8 sRGB."""
        painted: U8 = self._ramp[(self.place(values) * np.float32(STEPS - 1)).astype(np.intp)]
        return painted

    @cached_property
    def _ramp(self) -> U8:
        stops = np.array([[int(c[i : i + 2], 16) for i in (0, 2, 4)] for c in self.colors], np.float64)
        place, at = np.linspace(0.0, 1.0, STEPS), np.linspace(0.0, 1.0, len(stops))
        ramp = np.stack([np.interp(place, at, stops[:, c]) for c in range(3)], axis=-1)
        return np.rint(ramp).astype(np.uint8)


# Degrees per second, and percent of white.
VELOCITY = Scale(knee=0.5, top=64.0, ticks=(0, 0.5, 2, 8, 16, 32, 64), colors=VIRIDIS)
DIFFERENCE = Scale(knee=1.0, top=50.0, ticks=(0, 1, 2, 5, 10, 20, 50), colors=INFERNO)
