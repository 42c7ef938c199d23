"""LDR-FLIP (Andersson et al. 2020): the difference between alternating images, by ``flip-evaluator``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enfilade.comparison.measures.displayed import DisplayedPair
from enfilade.errors import SettingsError
from enfilade.viewing import Viewing


class Flip:
    """Mean of the LDR-FLIP map, 0 (identical) to 1, at the pixels per degree of the viewing conditions.

    Each frame is measured by itself: flicker does not count.

    Parameters
    ----------
    viewing

    Raises
    ------
    SettingsError
        ``flip-evaluator`` is not installed.
    """

    name = "flip"

    def __init__(self, viewing: Viewing) -> None:
        try:
            from flip_evaluator import evaluate
        except ImportError as error:
            raise SettingsError(
                f"FLIP is not available: {error}; install it with: pip install flip-evaluator"
            ) from error
        self._evaluate = evaluate
        self._parameters = {"ppd": float(viewing.pixels_per_degree)}

    def measure(self, pair: DisplayedPair) -> float:
        """Mean of the frame's map."""
        # inputsRGB, applyMagma, computeMeanError
        found = self._evaluate(
            np.ascontiguousarray(pair.reference),
            np.ascontiguousarray(pair.test),
            "LDR",
            True,
            False,
            True,
            dict(self._parameters),
        )
        return float(found[1])

    def pool(self, values: Sequence[float | None]) -> float:
        """Mean over the frames."""
        known = [value for value in values if value is not None]
        return sum(known) / len(known)
