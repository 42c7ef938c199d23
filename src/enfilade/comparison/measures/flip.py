"""LDR-FLIP (Andersson et al. 2020): the difference of images that flip in place, by ``flip-evaluator``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enfilade.comparison.measures.judge import Scale
from enfilade.comparison.measures.shown import Shown
from enfilade.errors import SettingsError
from enfilade.viewing import Viewing

__all__ = ["Flip"]


class Flip:
    """Mean of the LDR-FLIP map, 0 (identical) to 1, at the pixels per degree of the viewing conditions.

    It looks at each frame by itself: flicker is nothing to it.

    Parameters
    ----------
    viewing

    Raises
    ------
    SettingsError
        ``flip-evaluator`` is not installed.
    """

    SCALE = Scale("flip", "FLIP", "mean")

    def __init__(self, viewing: Viewing) -> None:
        try:
            from flip_evaluator import evaluate
        except ImportError as error:
            raise SettingsError(
                f"FLIP can't judge: {error}; install it with: pip install 'enfilade[judges]'"
            ) from error
        self._evaluate = evaluate
        self._parameters = {"ppd": float(viewing.pixels_per_degree)}

    def judge(self, pair: Shown) -> float:
        """Judge the next frame: mean of its map."""
        # inputsRGB, applyMagma, computeMeanError; the mean it gives back is 0 where the maps are.
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

    def pooled(self, values: Sequence[float | None]) -> float:
        """Mean over the frames."""
        known = [value for value in values if value is not None]
        return sum(known) / len(known)
