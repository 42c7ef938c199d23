"""Peak signal-to-noise ratio of display-encoded values."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from enfilade.comparison.measures.displayed import DisplayedPair


def psnr_db(squared_error: float) -> float:
    """Peak signal-to-noise ratio of values in 0..1: -10 log10 of the mean squared error; infinite at 0."""
    return math.inf if squared_error == 0.0 else -10.0 * math.log10(squared_error)


class Psnr:
    """-10 log10 of the mean squared error over pixels and channels, sRGB-encoded, 1 = white.

    Infinite for identical frames. Noise counts in full, wherever it is and whether or not it is seen.
    """

    name = "psnr"

    def measure(self, pair: DisplayedPair) -> float:
        """PSNR of the next frame, dB."""
        difference = (pair.test - pair.reference).ravel()
        return psnr_db(float(np.vdot(difference, difference)) / difference.size)

    def pool(self, values: Sequence[float | None]) -> float:
        """PSNR of the whole sequence: of the mean squared error over all frames."""
        squared = [10.0 ** (-value / 10.0) for value in values if value is not None]
        return psnr_db(sum(squared) / len(squared))
