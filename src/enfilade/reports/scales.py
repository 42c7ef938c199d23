"""Colour scales of maps: from a number to a colour, and to a place in the legend.

Lightness rises along each scale, for grey prints and readers with colour vision deficiencies.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from enfilade.images.stills import to_bytes
from enfilade.records import F32, U8

STEPS = 1024


@dataclass(frozen=True)
class Scale:
    """A colour scale, linear near 0 and logarithmic beyond.

    Attributes
    ----------
    knee : float
        Where it turns from linear to logarithmic.
    colors : mapping of float to str
        Six hexadecimal digits of sRGB by value, rising from 0; interpolated between them.
    """

    knee: float
    colors: Mapping[float, str]

    @property
    def top(self) -> float:
        """Largest value; beyond, the colour stays."""
        return max(self.colors)

    def place(self, values: npt.ArrayLike) -> F32:
        """Place of values, 0 or more, on the scale, 0..1."""
        bent = np.log1p(np.asarray(values, np.float32) / np.float32(self.knee))
        return np.asarray(np.minimum(bent / np.float32(np.log1p(self.top / self.knee)), 1.0), np.float32)

    def values(self, count: int) -> F32:
        """Values at even places of the scale."""
        bent = np.linspace(0.0, np.log1p(self.top / self.knee), count)
        return (self.knee * np.expm1(bent)).astype(np.float32)

    def step(self, values: F32) -> npt.NDArray[np.intp]:
        """Index of values in :attr:`ramp`."""
        return (self.place(values) * np.float32(STEPS - 1)).astype(np.intp)

    @cached_property
    def ramp(self) -> F32:
        """Colours at even places, (STEPS, 3), 0..1."""
        stops = np.array([list(bytes.fromhex(color)) for color in self.colors.values()]) / 255.0
        even, places = np.linspace(0.0, 1.0, STEPS), self.place(list(self.colors))
        return np.stack([np.interp(even, places, stops[:, i]) for i in range(3)], axis=-1).astype(np.float32)

    def paint(self, values: F32) -> U8:
        """Colour a map: (H, W) float32, 0 or more, to (H, W, 3) uint8 sRGB."""
        painted: U8 = to_bytes(self.ramp)[self.step(values)]
        return painted


VELOCITY = Scale(  # degrees per second; Matplotlib's viridis
    0.5,
    {0: "440154", 0.5: "46327e", 2: "31678e", 8: "20a486", 16: "4ec36b", 32: "a0da39", 64: "fde725"},
)
DIFFERENCE = Scale(  # percent of white; Matplotlib's inferno
    1.0, {0: "000004", 1: "380962", 2: "62146e", 5: "a92e5e", 10: "e05536", 20: "fb9906", 50: "fcffa4"}
)
VISIBLE = Scale(  # JND; path tracing with a few paths a pixel exceeds 32
    1.0,
    {0: "1a33b3", 1: "9429c7", 3: "db4075", 8: "f57833", 16: "fcba29", 32: "fff000", 64: "ffffff"},
)
