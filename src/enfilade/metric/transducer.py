"""Visual masking by a transducer: faint masks help, strong ones hide (Legge and Foley 1980)."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

__all__ = ["TRANSDUCER_EXPONENT", "transduced_difference", "transducer"]

Float32Array: TypeAlias = npt.NDArray[np.float32]

TRANSDUCER_EXPONENT = 2.0  # p, no unit: contrast energy, with which channels sum without ripple
# p - q = 0.4 makes thresholds rise with the power 0.6 of strong masks (Legge and Foley 1980, who have
# p = 2.4 and q = 2).
INHIBITION_EXPONENT = 1.6  # q, no unit
# The one number here that was fitted, to the ten masks of Foley 1994, J. Opt. Soc. Am. A 11.
SEMI_SATURATION = 2.0  # z, no unit


def transducer(contrast_jnd: Float32Array) -> Float32Array:
    """Response of a channel to contrast: r = (1 + z) c^2 / (z + abs(c)^1.6) with the sign of c.

    Parameters
    ----------
    contrast_jnd : (...) float32
        Contrast c in units of its threshold, of either sign.

    Returns
    -------
    (...) float32
        Response; 1 at threshold. It grows with the square of faint contrasts and the power 0.4 of
        strong ones.
    """
    size = np.abs(contrast_jnd)
    inhibition = size ** np.float32(INHIBITION_EXPONENT)
    inhibition += np.float32(SEMI_SATURATION)
    size *= contrast_jnd
    size *= np.float32(1.0 + SEMI_SATURATION)
    size /= inhibition
    return size


def transduced_difference(reference_jnd: Float32Array, difference_jnd: Float32Array) -> Float32Array:
    """Difference of a channel after masking: J = abs(r(c + d) - r(c)).

    Parameters
    ----------
    reference_jnd : (...) float32
        Contrast c of the reference in units of its threshold.
    difference_jnd : (...) float32
        Contrast d of the difference test - reference, likewise.

    Returns
    -------
    (...) float32
        J; exactly 0 where d is. Swapping the images swaps only the sign inside.
    """
    before = transducer(reference_jnd)
    after = transducer(reference_jnd + difference_jnd)
    after -= before
    return np.abs(after, out=after)
