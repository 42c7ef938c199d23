"""Measures of the difference between two sequences.

>>> import numpy as np
>>> from enfilade.comparison.measures import Psnr, display_pair
>>> from enfilade.viewing import Viewing
>>> grey = np.full((48, 64, 3), 0.5, np.float32)
>>> pair = display_pair(grey * 1.1, grey, Viewing(64, 48))
>>> measure = Psnr()
>>> round(measure.pool([measure.measure(pair)]), 1)
29.9
"""

from __future__ import annotations

from enfilade.comparison.measures.base import Measure
from enfilade.comparison.measures.colorvideovdp import ColorVideoVdp
from enfilade.comparison.measures.displayed import DisplayedPair, display_pair
from enfilade.comparison.measures.flip import Flip
from enfilade.comparison.measures.psnr import Psnr
from enfilade.errors import SettingsError
from enfilade.viewing import Viewing

__all__ = [
    "MEASURES",
    "ColorVideoVdp",
    "DisplayedPair",
    "Flip",
    "Measure",
    "Psnr",
    "display_pair",
    "open_measure",
]

MEASURES = (Flip.name, Psnr.name, ColorVideoVdp.name)


def open_measure(name: str, viewing: Viewing) -> Measure:
    """A measure for one pair of sequences.

    Parameters
    ----------
    name
        One of :data:`MEASURES`.
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
            raise SettingsError(f"there is no measure {name!r}; choose one of {', '.join(MEASURES)}")
