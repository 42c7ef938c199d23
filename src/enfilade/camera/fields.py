"""Checked values of a camera path's JSON: what is wrong is said with the file, the place and the key."""

from __future__ import annotations

import json
import reprlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.camera.pinhole import Matrix
from enfilade.errors import CameraPathError

LARGEST_NUMBER = 1e15  # beyond it float32 can't square a coordinate without losing all meaning
LARGEST_SIZE = 16384  # pixels a side
LEAST_FPS, MOST_FPS = 0.01, 10_000.0  # wider than anybody needs; a video can say 1/1001


@dataclass(frozen=True)
class Table:
    """A JSON object, and where it stands.

    Attributes
    ----------
    values : dict
    where : str
        For messages: ``walk.json, key 3``.
    """

    values: dict[str, Any]
    where: str

    def __contains__(self, key: str) -> bool:
        return self.values.get(key) is not None

    def fail(self, problem: str) -> CameraPathError:
        """Error that says where it happened."""
        return CameraPathError(f"{self.where}: {problem}")

    def allow_only(self, *known: str) -> None:
        """Raise CameraPathError at an unknown key, listing the known ones."""
        for key in self.values:
            if key not in known:
                raise self.fail(f"unknown key {key!r}; known are: {', '.join(known)}")

    def number(self, key: str, default: float | None = None) -> float:
        """Finite number; without a default the key must be there."""
        if key not in self:
            if default is None:
                raise self.fail(f"{key} is missing; give a number")
            return default
        return self._finite(key, self.values[key])

    def positive(self, key: str) -> float:
        """Number above zero."""
        value = self.number(key)
        if value <= 0.0:
            raise self.fail(f"{key} is {value:g}; it must be above 0")
        return value

    def integer(self, key: str, *, least: int, most: int) -> int:
        """Whole number within a range, ends included."""
        value = self.number(key)
        if not value.is_integer() or not least <= value <= most:
            raise self.fail(f"{key} is {value:g}; it must be a whole number from {least} to {most}")
        return int(value)

    def flag(self, key: str) -> bool:
        """``true`` or ``false``; false where the key is missing."""
        value = self.values.get(key, False)
        if not isinstance(value, bool):
            raise self.fail(f"{key} is {reprlib.repr(value)}; it must be true or false")
        return value

    def vector(self, key: str, length: int) -> Matrix:
        """List of finite numbers, (length,) float64."""
        value = self.values.get(key)
        if not isinstance(value, list) or len(value) != length:
            raise self.fail(f"{key} is {reprlib.repr(value)}; it must be a list of {length} numbers")
        return np.array([self._finite(key, v) for v in value])

    def tables(self, key: str, name: str) -> list[Table]:
        """Non-empty list of objects; the n-th is called ``name n`` in messages, from 1."""
        value = self.values.get(key)
        if not isinstance(value, list):
            raise self.fail(f"{key} must be a list, not {reprlib.repr(value)}")
        if not value:
            raise self.fail(f"{key} is empty: a camera path needs at least one {name}")
        for n, v in enumerate(value, 1):
            if not isinstance(v, dict):
                raise self.fail(f"{name} {n} must be an object {{...}}, not {reprlib.repr(v)}")
        return [Table(v, f"{self.where}, {name} {n}") for n, v in enumerate(value, 1)]

    def fov(self) -> float:
        """The vertical field of view under the key ``fov``, degrees."""
        value = self.number("fov")
        if not 0.0 < value < 180.0:
            raise self.fail(f"fov is {value:g} degrees; it must lie between 0 and 180")
        return value

    def fps(self) -> float:
        """Frames per second under the key ``fps``."""
        value = self.number("fps")
        if not LEAST_FPS <= value <= MOST_FPS:
            raise self.fail(f"fps is {value:g}; it must be from {LEAST_FPS:g} to {MOST_FPS:g}")
        return value

    def _finite(self, key: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.fail(f"{key} holds {reprlib.repr(value)}; expected a number")
        if not abs(value) <= LARGEST_NUMBER:
            kind = "an infinite or absurdly large number" if abs(value) > LARGEST_NUMBER else "a NaN"
            raise self.fail(f"{key} holds {kind}; give a number up to {LARGEST_NUMBER:g}")
        return float(value)


def read_table(file: Path) -> Table:
    """The JSON object of a file.

    Raises
    ------
    CameraPathError
        The file can't be read, is no JSON, or holds something other than an object.
    """
    try:
        values = json.loads(file.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise CameraPathError(f"can't read the camera path {file}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise CameraPathError(f"the camera path {file} is not valid JSON: {error}") from error
    if not isinstance(values, dict):
        raise CameraPathError(f"the camera path {file} must hold a JSON object {{...}}")
    return Table(values, str(file))
