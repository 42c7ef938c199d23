"""The ledger of a run: one line of JSON for each finished task, only ever appended to.

Several processes, also on several hosts, may append: each append holds the file's lock. Each line ends with a
checksum of itself; damaged lines are left out, so that their tasks are done again.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from enfilade.errors import RunFolderError
from enfilade.files import unwritable

LEDGER_FILE = "ledger.jsonl"  # in a run folder

Key = tuple[str, int]  # pass and number of the frame

SUM = "sum"  # last key of a line
SUM_DIGITS = 16  # of SHA-256
NOT_IN_DIGEST = ("cost", "reduction")  # times differ from run to run, and so may the memory
APPENDING = os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC | os.O_NOFOLLOW


class Ledger:
    """The finished tasks of a run.

    Parameters
    ----------
    file
        ``ledger.jsonl``; it need not exist.

    Attributes
    ----------
    head : dict
        The line of the run itself, usually the first; empty where there is none.
    damaged : list of int
        Numbers of the lines that are left out, from 1.

    Raises
    ------
    RunFolderError
        The file can't be read.
    """

    def __init__(self, file: Path) -> None:
        self.head: dict[str, Any] = {}
        self.damaged: list[int] = []
        self._file = file
        self._lines: dict[Key, bytes] = {}  # unparsed: a long run has many, which are rarely looked up
        self._writers: dict[str, Key] = {}  # file -> task that wrote it last
        self._known = 0  # bytes
        self._count = 0  # lines
        self.refresh()

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Newest line of each task, in the order in which they were finished."""
        return map(_parsed, list(self._lines.values()))

    def get(self, key: Key) -> dict[str, Any] | None:
        """Newest line of a task; None where it never finished."""
        raw = self._lines.get(key)
        return None if raw is None else _parsed(raw)

    def writer(self, name: str) -> dict[str, Any] | None:
        """Newest line of the task that wrote a file last."""
        key = self._writers.get(name)
        line = None if key is None else self.get(key)
        return line if line is not None and name in line["files"] else None

    def refresh(self) -> None:
        """Read the lines that were appended since."""
        try:
            with self._file.open("rb") as stream:
                stream.seek(self._known)
                data = stream.read()
        except FileNotFoundError:
            return
        except OSError as error:
            raise RunFolderError(f"can't read {self._file}: {error.strerror}") from error
        self._take(data[: data.rfind(b"\n") + 1])  # a line without an end is being written, or is torn

    def write_head(self, head: Mapping[str, Any]) -> None:
        """Write the line of the run itself, where there is none."""
        with self._appending() as handle:
            if not self.head:
                self._write(handle, head)

    def append(self, line: Mapping[str, Any]) -> None:
        """Add a line and flush it to the disk.

        Parameters
        ----------
        line
            With ``pass``, ``frame`` and ``files``, as :func:`plain` makes it.

        Raises
        ------
        RunFolderError, NoSpaceError
            It can't be written. The ledger is as before.
        """
        with self._appending() as handle:
            self._write(handle, line)

    @contextmanager
    def _appending(self) -> Iterator[int]:
        """The file, locked, with all lines read and the torn end of a killed process cut off."""
        try:
            handle = os.open(self._file, APPENDING, 0o666)
        except OSError as error:
            raise unwritable(self._file, error) from error
        try:
            fcntl.flock(handle, fcntl.LOCK_EX)
            self.refresh()
            if os.fstat(handle).st_size > self._known:
                os.ftruncate(handle, self._known)
            yield handle
        finally:
            os.close(handle)

    def _write(self, handle: int, line: Mapping[str, Any]) -> None:
        data = _sealed(line)
        try:
            written = 0
            while written < len(data):
                written += os.write(handle, data[written:])
            os.fsync(handle)
        except OSError as error:
            os.ftruncate(handle, self._known)
            raise unwritable(self._file, error) from error
        self._take(data)

    def _take(self, data: bytes) -> None:
        """Take over whole lines."""
        for raw in data.splitlines(keepends=True):
            self._count += 1
            line = _checked(raw)
            if line is None:
                self.damaged.append(self._count)
            elif "pass" not in line:
                self.head = _parsed(raw)
            else:
                key = line["pass"], line["frame"]
                self._lines.pop(key, None)  # a task done again counts where it was done last
                self._lines[key] = raw
                self._writers.update(dict.fromkeys(line["files"], key))
        self._known += len(data)


def digest_line(line: Mapping[str, Any]) -> str:
    """The part of a line that is the same whenever the same work is done: all but times and `reduction`."""
    kept = {key: value for key, value in line.items() if key not in NOT_IN_DIGEST}
    return json.dumps(kept, sort_keys=True, ensure_ascii=False)


def plain(line: Mapping[str, Any]) -> dict[str, Any]:
    """A line as it will be read back.

    Raises
    ------
    ValueError, TypeError
        A value is NaN, infinite, or not fit for JSON.
    """
    read_back: dict[str, Any] = json.loads(json.dumps(line, allow_nan=False, default=_number))
    return read_back


def _sealed(line: Mapping[str, Any]) -> bytes:
    text = json.dumps(line, ensure_ascii=False, allow_nan=False)
    return f'{text[:-1]}, "{SUM}": "{_sum(text.encode())}"}}\n'.encode()


def _sum(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:SUM_DIGITS]


def _checked(raw: bytes) -> dict[str, Any] | None:
    """The line, or None where its checksum is not that of its text."""
    tail = len(f', "{SUM}": "{"0" * SUM_DIGITS}"}}\n')
    body = raw[:-tail] + b"}"
    if raw[-tail:] != f', "{SUM}": "{_sum(body)}"}}\n'.encode():
        return None
    line: dict[str, Any] = json.loads(raw)
    return line


def _parsed(raw: bytes) -> dict[str, Any]:
    line: dict[str, Any] = json.loads(raw)
    del line[SUM]
    return line


def _number(value: Any) -> Any:
    """NumPy's numbers as plain ones."""
    if hasattr(value, "item") and getattr(value, "ndim", None) == 0:
        return value.item()
    raise TypeError(f"a ledger line can't hold {value!r} ({type(value).__name__})")
