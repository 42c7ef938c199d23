"""Measures of the difference between two sequences.

>>> import numpy as np
>>> from enfilade.comparison.measures import Psnr, display_pair
>>> from enfilade.viewing import Viewing
>>> grey = np.full((48, 64, 3), 0.5, np.float32)
>>> pair = display_pair(grey * 1.1, grey, Viewing(64, 48))
>>> measure = Psnr()
>>> round(measure.pool([measure.measure(pair)]), 1)
30.2
"""

from __future__ import annotations

from importlib.util import find_spec

from enfilade.comparison.measures.base import Measure, Scale
from enfilade.comparison.measures.colorvideovdp import ColorVideoVdp
from enfilade.comparison.measures.displayed import DisplayedPair, display_pair
from enfilade.comparison.measures.flip import Flip
from enfilade.comparison.measures.psnr import Psnr
from enfilade.errors import SettingsError
from enfilade.viewing import Viewing

__all__ = [
    "SCALES",
    "ColorVideoVdp",
    "DisplayedPair",
    "Flip",
    "Measure",
    "Psnr",
    "Scale",
    "display_pair",
    "open_measure",
    "why_missing",
]

SCALES: dict[str, Scale] = {of.SCALE.name: of.SCALE for of in (Flip, Psnr, ColorVideoVdp)}


def open_measure(name: str, viewing: Viewing) -> Measure:
    """A measure for one pair of sequences.

    Parameters
    ----------
    name
        One of :data:`SCALES`.
    viewing
        Viewing conditions.

    Raises
    ------
    SettingsError
        There is no such measure, or it is not installed.
    """
    match name:
        case "flip":
            return Flip(viewing)
        case "psnr":
            return Psnr()
        case "cvvdp":
            return ColorVideoVdp(viewing)
        case _:
            raise SettingsError(f"there is no measure {name!r}; choose one of {', '.join(SCALES)}")


def why_missing(name: str) -> str:
    """Reason why a measure is not available, with the remedy; empty where it is."""
    if name == "flip" and find_spec("flip_evaluator") is None:
        return "FLIP is left out; install it with: pip install flip-evaluator"
    if name == "cvvdp" and find_spec("pycvvdp") is None:
        return "ColorVideoVDP is left out; install it with: pip install cvvdp"
    return ""
