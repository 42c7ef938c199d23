"""What the metric refuses, by name: shapes, types, values that are not luminances."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.errors import InputError

__all__ = ["check_luminance", "check_map", "check_valid"]

BoolArray: TypeAlias = npt.NDArray[np.bool_]
Float32Array: TypeAlias = npt.NDArray[np.float32]


def _check_form(
    name: str, array: npt.NDArray[np.generic], dtype: type[np.generic], shape: tuple[int, ...]
) -> None:
    if not isinstance(array, np.ndarray):
        msg = f"metric: {name} is a {type(array).__name__}; give a NumPy array"
        raise InputError(msg)
    if array.dtype != dtype:
        msg = f"metric: {name} has type {array.dtype}; convert it to {np.dtype(dtype)}"
        raise InputError(msg)
    if array.shape != shape:
        msg = f"metric: {name} has shape {array.shape}; the viewing conditions ask for {shape}"
        raise InputError(msg)


def _refuse(name: str, bad: BoolArray, what: str, remedy: str) -> None:
    count = np.count_nonzero(bad)
    if count:
        row, column = (int(index) for index in np.argwhere(bad)[0][:2])
        msg = (
            f"metric: {name} is {what} at {count} judged pixels, the first at row {row}, "
            f"column {column}; {remedy}"
        )
        raise InputError(msg)


def check_valid(valid: BoolArray, shape: tuple[int, int]) -> None:
    """Refuse a mask that is not (H, W) bool.

    Parameters
    ----------
    valid : (H, W) bool
        Pixels to judge.
    shape : tuple of int
        Height and width asked for.

    Raises
    ------
    InputError
        Wrong type or shape.
    """
    _check_form("valid", valid, np.bool_, shape)


def check_map(
    name: str,
    values: Float32Array,
    shape: tuple[int, ...],
    valid: BoolArray | None,
    *,
    is_signed: bool,
) -> None:
    """Refuse a map of the wrong form, or with NaN, infinite or (if unsigned) negative values.

    Parameters
    ----------
    name : str
        What the message calls it.
    values : float32
        The map.
    shape : tuple of int
        Shape asked for; the first two are height and width.
    valid : (H, W) bool or None
        Pixels to judge; others may hold anything.
    is_signed : bool
        Whether negative values mean something.

    Raises
    ------
    InputError
        With the name, the number of bad pixels and the first of them.
    """
    _check_form(name, values, np.float32, shape)
    extremes = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
    if np.isfinite(extremes).all() and (is_signed or extremes[0] >= 0):
        return
    is_judged = np.ones(shape[:2], dtype=np.bool_) if valid is None else valid
    is_judged = is_judged.reshape(is_judged.shape + (1,) * (values.ndim - is_judged.ndim))
    remedy = "repair it or take these pixels out of valid"
    _refuse(name, ~np.isfinite(values) & is_judged, "not finite", remedy)
    if not is_signed:
        _refuse(name, (values < 0) & is_judged, "negative", remedy)


def check_luminance(name: str, image: Float32Array, shape: tuple[int, int], valid: BoolArray | None) -> None:
    """Refuse what is not an image of luminances in cd/m2.

    Parameters
    ----------
    name : str
        "test" or "reference".
    image : (H, W) float32
        Luminance, cd/m2.
    shape : tuple of int
        Height and width asked for.
    valid : (H, W) bool or None
        Pixels to judge; others may hold anything.

    Raises
    ------
    InputError
        With the name, the number of bad pixels and the first of them.
    """
    check_map(name, image, shape, valid, is_signed=False)
