"""The ledger of a run: one line of JSON for each finished unit of work, only ever appended to."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from enfilade.codec import whole
from enfilade.errors import RunFolderError

__all__ = ["Ledger"]


class Ledger:
    """The finished units of a run.

    Parameters
    ----------
    file
        ``ledger.jsonl``; need not exist.
    writable
        Whether a torn last line is cut off in the file, and lines can be appended. Otherwise it is left
        out: someone may be writing it just now.
    is_lenient
        Leave damaged lines out, and say so in `notes`, instead of raising: for readers that show what
        there is.

    Attributes
    ----------
    notes : list of str
        What was recovered or left out, for the user to know.

    Raises
    ------
    RunFolderError
        The file can't be read, or a line before the last one is damaged.
    """

    def __init__(self, file: Path, *, writable: bool, is_lenient: bool = False) -> None:
        self.notes: list[str] = []
        self._is_lenient = is_lenient
        self._file = file
        self._handle = -1
        self._units: dict[str, dict[str, Any]] = {}
        self._writers: dict[str, str] = {}  # file -> unit that wrote it last
        try:
            data = file.read_bytes() if file.exists() else b""
            whole_size = self._take(data)
            if writable:
                self._handle = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o666)
                self._cut(len(data), whole_size)
                whole.flush(file.parent)
        except OSError as error:
            raise RunFolderError(f"can't open {file}: {error.strerror}") from error

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Newest line of each unit, in the order in which they were finished."""
        return iter(list(self._units.values()))

    def get(self, unit: str) -> dict[str, Any] | None:
        """Newest line of a unit, or None."""
        return self._units.get(unit)

    def writer(self, name: str) -> dict[str, Any] | None:
        """Newest line of the unit that wrote a file last, or None."""
        line = self._units.get(self._writers.get(name, ""))
        return line if line is not None and name in line["files"] else None

    def append(self, line: Mapping[str, Any]) -> None:
        """Add a line and flush it to the disk: when this returns, it stays.

        Parameters
        ----------
        line
            With ``unit`` and ``files``. NumPy's numbers are written as plain ones.

        Raises
        ------
        RunFolderError
            It can't be written. The ledger is as before.
        ValueError
            A fact is NaN or infinite, for which JSON has no word.
        """
        text = json.dumps(line, ensure_ascii=False, allow_nan=False, default=_plain)
        data = text.encode() + b"\n"
        size = os.fstat(self._handle).st_size
        try:
            _write_all(self._handle, data)
            os.fsync(self._handle)
        except OSError as error:
            os.ftruncate(self._handle, size)
            raise whole.unwritable(self._file, error.strerror or str(error)) from error
        self._keep(json.loads(text))

    def close(self) -> None:
        """Close the file. A second call does nothing."""
        if self._handle >= 0:
            os.close(self._handle)
            self._handle = -1

    def _take(self, data: bytes) -> int:
        # returns the bytes that hold whole lines: a process killed while appending leaves part of one
        good = 0
        lines = data.splitlines(keepends=True)
        for number, raw in enumerate(lines, 1):
            line = _parsed(raw) if raw.endswith(b"\n") else None
            if line is None and number < len(lines):
                self._refuse(number)
            if line is not None:
                self._keep(line)
                good += len(raw)
        return good

    def _refuse(self, number: int) -> None:
        text = f"{self._file}, line {number} is damaged"
        if not self._is_lenient:
            raise RunFolderError(
                f"{text}: delete that line, then run the same command again to redo its unit"
            )
        self.notes.append(f"{text}; it was left out")

    def _cut(self, size: int, whole_size: int) -> None:
        if size == whole_size:
            return
        os.ftruncate(self._handle, whole_size)
        os.fsync(self._handle)
        self.notes.append(
            f"the last line of {self._file.name} was torn ({size - whole_size} bytes) and was cut off; "
            "its unit is done again"
        )

    def _keep(self, line: dict[str, Any]) -> None:
        self._units.pop(line["unit"], None)  # a unit done again counts where it was done last
        self._units[line["unit"]] = line
        self._writers.update(dict.fromkeys(line["files"], line["unit"]))


def _parsed(raw: bytes) -> dict[str, Any] | None:
    try:
        line = json.loads(raw.decode())
    except (ValueError, RecursionError):
        return None
    if not isinstance(line, dict) or not isinstance(line.get("unit"), str):
        return None
    files = line.get("files")
    if not isinstance(files, dict) or not all(_is_record(name, record) for name, record in files.items()):
        return None
    return line


def _is_record(name: str, record: Any) -> bool:
    place = PurePosixPath(name)
    return (
        not place.is_absolute()
        and ".." not in place.parts
        and isinstance(record, dict)
        and isinstance(record.get("bytes"), int)
        and isinstance(record.get("sha256"), str)
    )


def _write_all(handle: int, data: bytes) -> None:
    while data:
        data = data[os.write(handle, data) :]


def _plain(value: Any) -> Any:
    if hasattr(value, "item") and getattr(value, "ndim", None) == 0:
        return value.item()
    raise TypeError(f"a ledger line can't hold {value!r} ({type(value).__name__})")
