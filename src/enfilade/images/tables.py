"""Named arrays of any shape <-> NumPy's .npz files, each file whole or not there at all."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from enfilade.errors import ImageError
from enfilade.files import unwritable, whole_file

__all__ = ["read_arrays", "write_arrays"]

Array = npt.NDArray[Any]


def write_arrays(file: Path, arrays: Mapping[str, Array]) -> None:
    """Write arrays, exactly: the same arrays, the same bytes.

    Raises
    ------
    RunFolderError, NoSpaceError
        The file can't be written.
    """
    try:
        with whole_file(file) as beside, beside.open("wb") as raw:
            np.savez(raw, allow_pickle=False, **arrays)
    except OSError as error:
        raise unwritable(file, error) from error


def read_arrays(file: Path, *names: str) -> tuple[Array, ...]:
    """Read what :func:`write_arrays` wrote.

    Raises
    ------
    ImageError
        The file is missing, damaged, or lacks one of the names.
    """
    try:
        with np.load(file, allow_pickle=False) as arrays:
            return tuple(arrays[name] for name in names)
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise ImageError(f"can't read {file}: {error}; delete it to make it again") from error
