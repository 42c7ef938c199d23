"""Readers of the published measurements in `data/`."""

from __future__ import annotations

import csv
from importlib.resources import files

import numpy as np

from enfilade.records import F32, F64

DATA = files("studies.observers") / "data"
WHITE = 65535.0  # of a 16-bit texture


def read_columns(name: str, *numbers: str) -> tuple[list[dict[str, str]], dict[str, F64]]:
    """Read a table: all rows as text, and the named columns as numbers.

    Parameters
    ----------
    name : str
        File in `data/`.
    *numbers : str
        Columns to convert.

    Returns
    -------
    list of dict
        One for each row, by the heading of the column.
    dict of (N,) float64
        The converted columns.
    """
    rows = list(csv.DictReader((DATA / name).read_text(encoding="utf-8").splitlines()))
    return rows, {n: np.array([float(row[n]) for row in rows]) for n in numbers}


def read_textures() -> dict[str, F32]:
    """Textures of the moving-texture experiment, (512, 512) float32 by name, linear, 1 is white."""
    with (DATA / "textures.npz").open("rb") as file, np.load(file) as archive:
        return {name: archive[name].astype(np.float32) / np.float32(WHITE) for name in archive.files}
