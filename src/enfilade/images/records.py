"""Records <-> files: images as OpenEXR layers, other arrays as NumPy's ``.npz``; exact, bit by bit."""

from __future__ import annotations

import typing
import zipfile
from collections.abc import Collection, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from enfilade.errors import ImageError
from enfilade.files import whole_file
from enfilade.images.exr import read_attributes, read_exr, write_exr

Array = npt.NDArray[Any]
R = TypeVar("R")

WIDER = {np.dtype(np.bool_): np.uint32, np.dtype(np.uint8): np.uint32}  # types that OpenEXR does not have
OF_IMAGES = (np.float16, np.float32, np.uint32, *WIDER)


def write_record(stem: Path, record: Any) -> Path:
    """Write a record.

    Parameters
    ----------
    stem
        File name without its suffix.
    record
        A dataclass of arrays, integers, and records of the same kind; None is left out. If all arrays are
        images of one size, (H, W), (H, W, 2) or (H, W, 3), the file is OpenEXR, otherwise ``.npz``.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RunFolderError, NoSpaceError
        The file can't be written.
    """
    arrays, numbers = _flat(record)
    if _are_images(arrays.values()):
        file = stem.with_name(f"{stem.name}.exr")
        layers = {name: array.astype(WIDER.get(array.dtype, array.dtype)) for name, array in arrays.items()}
        write_exr(file, layers, attributes={name: str(number) for name, number in numbers.items()})
        return file
    file = stem.with_name(f"{stem.name}.npz")
    with whole_file(file) as beside, beside.open("wb") as stream:
        np.savez(stream, allow_pickle=False, **arrays, **{n: np.int64(v) for n, v in numbers.items()})
    return file


def read_record(file: Path, kind: type[R]) -> R:
    """Read a record that :func:`write_record` wrote.

    Parameters
    ----------
    file
    kind
        Class of the record.

    Raises
    ------
    ImageError
        The file is missing, damaged, or holds another record.
    """
    try:
        if file.suffix == ".exr":
            values: dict[str, Any] = {**read_attributes(file), **read_exr(file)}
        else:
            with np.load(file, allow_pickle=False) as arrays:
                values = dict(arrays)
        return _built(kind, values, "")
    except (OSError, KeyError, TypeError, ValueError, EOFError, zipfile.BadZipFile) as error:
        if isinstance(error, ImageError):
            raise
        raise ImageError(f"{file} holds no {kind.__name__}: {error}; delete it to make it again") from error


def _are_images(arrays: Collection[Array]) -> bool:
    """Whether arrays are images of one size and of types that OpenEXR holds, one at least."""
    if len({array.shape[:2] for array in arrays}) != 1:
        return False
    are_shaped = all(0 not in a.shape and (a.ndim == 2 or a.shape[2:] in ((2,), (3,))) for a in arrays)
    return are_shaped and all(array.dtype in OF_IMAGES for array in arrays)


def _flat(record: Any, prefix: str = "") -> tuple[dict[str, Array], dict[str, int]]:
    """Arrays and integers of a record and those in it, by dotted names."""
    arrays: dict[str, Array] = {}
    numbers: dict[str, int] = {}
    for field in fields(record):
        name, value = f"{prefix}{field.name}", getattr(record, field.name)
        if is_dataclass(value):
            inner_arrays, inner_numbers = _flat(value, f"{name}.")
            arrays |= inner_arrays
            numbers |= inner_numbers
        elif isinstance(value, np.ndarray):
            arrays[name] = value
        elif value is not None:
            numbers[name] = int(value)
    return arrays, numbers


def _built(kind: type[R], values: Mapping[str, Any], prefix: str) -> R:
    """A record of some of the values."""
    found: dict[str, Any] = {}
    hints = typing.get_type_hints(kind)
    for field in fields(kind):  # type: ignore[arg-type]
        name = f"{prefix}{field.name}"
        hint = _without_none(hints[field.name])
        is_optional = hint is not hints[field.name]
        if isinstance(hint, type) and is_dataclass(hint):
            is_there = any(key.startswith(f"{name}.") for key in values)
            found[field.name] = _built(hint, values, f"{name}.") if is_there else None
        elif is_optional and name not in values:
            found[field.name] = None
        elif hint is int:
            found[field.name] = int(values[name])
        else:
            found[field.name] = values[name].astype(_dtype_of(hint), copy=False)
    return kind(**found)


def _without_none(hint: Any) -> Any:
    options = [option for option in typing.get_args(hint) if option is not type(None)]
    return options[0] if type(None) in typing.get_args(hint) else hint


def _dtype_of(hint: Any) -> Any:
    """The scalar type of an array's annotation, ``NDArray[np.float32]``: its innermost argument.

    NumPy 2.5 made ``NDArray`` an alias with one argument; it was an array's shape and type before.
    """
    while arguments := typing.get_args(hint):
        hint = arguments[-1]
    return hint
