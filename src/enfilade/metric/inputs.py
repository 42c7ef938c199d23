"""A pair of images as the metric takes it, and the checks of its arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from enfilade.errors import InputError
from enfilade.records import F32, Mask


@dataclass(frozen=True, eq=False)
class Pair:
    """Two images, checked and finite everywhere; the arguments of `Aqm.compare`.

    Attributes
    ----------
    test, reference : (H, W) float32
        Luminance, cd/m2; equal where not valid.
    valid : (H, W) bool
        Pixels to compare.
    velocity : (2, h, w) float32 or None
        Image velocity at every second pixel, deg/s; None where nothing moves.
    change : (H, W) float32 or None
        As in `Aqm.compare`.
    """

    test: F32
    reference: F32
    valid: Mask
    velocity: F32 | None
    change: F32 | None


def check_pair(
    shape: tuple[int, int], test: F32, reference: F32, velocity: F32 | None, valid: Mask | None
) -> None:
    """Check the arguments of `Aqm.compare` for images of a shape; raise InputError as it does."""
    if valid is not None:
        _check_form("valid", valid, np.bool_, shape)
    check_map("test", test, shape, valid)
    check_map("reference", reference, shape, valid)
    if velocity is not None:
        check_map("velocity", velocity, (*shape, 2), valid, is_signed=True)


def check_map(
    name: str, values: F32, shape: tuple[int, ...], valid: Mask | None, *, is_signed: bool = False
) -> None:
    """Check that a map is float32 of a shape, finite and (if unsigned) not negative where valid.

    Raises
    ------
    InputError
        With the name, the number of bad pixels and the first of them.
    """
    _check_form(name, values, np.float32, shape)
    extremes = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
    if np.isfinite(extremes).all() and (is_signed or extremes[0] >= 0):
        return
    for word, is_bad in (("not finite", ~np.isfinite(values)), ("negative", (values < 0) & (not is_signed))):
        bad = is_bad.reshape(*shape[:2], -1).any(axis=2) & (True if valid is None else valid)
        if bad.any():
            row, column = np.argwhere(bad)[0]
            raise InputError(
                f"metric: {name} is {word} at {np.count_nonzero(bad)} valid pixels, the first at row {row}, "
                f"column {column}; repair it or take these pixels out of valid"
            )


def _check_form(
    name: str, array: npt.NDArray[np.generic], dtype: type[np.generic], shape: tuple[int, ...]
) -> None:
    if not isinstance(array, np.ndarray):
        raise InputError(f"metric: {name} is a {type(array).__name__}; give a NumPy array")
    if array.dtype != dtype:
        raise InputError(f"metric: {name} has type {array.dtype}; convert it to {np.dtype(dtype)}")
    if array.shape != shape:
        raise InputError(f"metric: {name} has shape {array.shape}; the viewing conditions need {shape}")


def fill_undefined(test: F32, reference: F32, valid: Mask) -> tuple[F32, F32]:
    """Test and reference, equal where not valid: the reference if finite, else the test, else its mean."""
    if valid.all():
        return test, reference
    known = reference[valid]
    mean = known.mean(dtype=np.float64) if known.size else 0.0
    filler = np.where(np.isfinite(test), test, np.float32(mean))
    filler = np.maximum(np.where(np.isfinite(reference), reference, filler), np.float32(0.0))
    return np.where(valid, test, filler), np.where(valid, reference, filler)
