"""Checked access to the entries of a JSON object; errors name the file, the entry and the key."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from reprlib import repr as shorten
from typing import Any

import numpy as np

from enfilade.camera.pinhole import Matrix
from enfilade.errors import CameraPathError

Range = tuple[float, float]  # both ends included
ANY: Range = (-1e15, 1e15)  # products of two coordinates stay far within float32
FPS: Range = (0.01, 10_000.0)
FOV_DEG: Range = (0.01, 179.0)
SIDE_PX: Range = (1.0, 16384.0)


@dataclass(frozen=True)
class JsonObject:
    """A JSON object and its position, such as ``walk.json, key 3``. A key whose value is null is missing."""

    values: dict[str, Any]
    where: str

    def __contains__(self, key: str) -> bool:
        return self.values.get(key) is not None

    def error(self, problem: str) -> CameraPathError:
        """Error that starts with the object's position."""
        return CameraPathError(f"{self.where}: {problem}")

    def allow_only(self, *known: str) -> None:
        """Raise CameraPathError at an unknown key."""
        for key in self.values:
            if key not in known:
                raise self.error(f"unknown key {key!r}; known are: {', '.join(known)}")

    def array(
        self,
        key: str,
        *shapes: tuple[int, ...],
        within: Range = ANY,
        whole: bool = False,
        default: Any = None,
    ) -> Matrix:
        """Finite numbers of a range, float64 of one of the shapes; CameraPathError if they are not."""
        value = self.values[key] if key in self else default
        array = np.array(value, dtype=object)
        if array.shape not in shapes or not all(_is_number(v, within, whole) for v in array.flat):
            kind = "whole number" if whole else "number"
            expected = f"a {kind}" if () in shapes else f"a list of {math.prod(shapes[0])} {kind}s"
            found = "missing" if value is None else shorten(value)
            raise self.error(f"{key} is {found}; expected {expected} from {within[0]:g} to {within[1]:g}")
        return array.astype(np.float64)

    def number(self, key: str, within: Range = ANY, *, whole: bool = False, default: Any = None) -> float:
        """Finite number of a range; see :meth:`array`."""
        return float(self.array(key, (), within=within, whole=whole, default=default))

    def flag(self, key: str) -> bool:
        """``true`` or ``false``; false where the key is missing."""
        value = self.values[key] if key in self else False
        if not isinstance(value, bool):
            raise self.error(f"{key} is {shorten(value)}; expected true or false")
        return value

    def objects(self, key: str, name: str) -> list[JsonObject]:
        """Non-empty list of objects; messages call the n-th ``name n``, from 1."""
        entries = self.values.get(key)
        if not isinstance(entries, list) or not entries:
            raise self.error(f"{key} is {shorten(entries)}; expected a list of at least one {name}")
        for n, entry in enumerate(entries, 1):
            if not isinstance(entry, dict):
                raise self.error(f"{name} {n} is {shorten(entry)}; expected an object {{...}}")
        return [JsonObject(entry, f"{self.where}, {name} {n}") for n, entry in enumerate(entries, 1)]


def _is_number(value: Any, within: Range, whole: bool) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return within[0] <= value <= within[1] and (not whole or value % 1 == 0)


def read_object(file: Path) -> JsonObject:
    """The object that a JSON file holds; CameraPathError if it can't be read or holds none."""
    try:
        values = json.loads(file.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise CameraPathError(f"can't read the camera path {file}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise CameraPathError(f"the camera path {file} is not valid JSON: {error}") from error
    if not isinstance(values, dict):
        raise CameraPathError(f"the camera path {file} must hold a JSON object {{...}}")
    return JsonObject(values, str(file))
