"""The ledger of a run: one line of JSON for each finished unit of work, only ever appended to.

Each line ends with a checksum of itself. The first one holds the checksum of ``run.json``.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from enfilade import files as whole
from enfilade.errors import RunFolderError

__all__ = ["Ledger", "covered", "head_of"]

HEAD = "identity"  # key of the first line
SUM = "sum"  # last key of each line
SUM_LETTERS = 16  # of SHA-256
VOLATILE = ("cost",)  # wall times: outside the checksum of a run


class Ledger:
    """The finished units of a run.

    Parameters
    ----------
    file
        ``ledger.jsonl``; need not exist.
    writable
        Whether damaged lines are taken out of the file, and lines can be appended. Otherwise a torn last
        line is left out: someone may be writing it just now.
    is_lenient
        Leave damaged lines out, and say so in `notes`, instead of raising: for readers that show what
        there is.

    Attributes
    ----------
    notes : list of str
        What was recovered or left out, for the user to know.
    head : dict or None
        Checksum of ``run.json``; None where the ledger has none.

    Raises
    ------
    RunFolderError
        The file can't be read, or a line before the last one is damaged and may not be taken out.
    NoSpaceError
    """

    def __init__(self, file: Path, *, writable: bool, is_lenient: bool = False) -> None:
        self.notes: list[str] = []
        self.head: dict[str, Any] | None = None
        self._is_lenient = is_lenient or writable
        self._writable = writable
        self._handle = -1
        self._units: dict[str, bytes] = {}  # lines as they stand: a long run has many, seldom asked for
        self._writers: dict[str, str] = {}  # file -> unit that wrote it last
        self._read: dict[Path, int] = {}  # bytes of each file that are known
        self._file = file
        try:
            self._open()
        except OSError as error:
            if whole.is_full(error):
                raise whole.unwritable(file, error) from error
            raise RunFolderError(f"can't open {file}: {error.strerror}") from error

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Newest line of each unit, in the order in which they were finished."""
        return map(_read, list(self._units.values()))

    def get(self, unit: str) -> dict[str, Any] | None:
        """Newest line of a unit, or None."""
        raw = self._units.get(unit)
        return None if raw is None else _read(raw)

    def writer(self, name: str) -> dict[str, Any] | None:
        """Newest line of the unit that wrote a file last, or None."""
        line = self.get(self._writers.get(name, ""))
        return line if line is not None and name in line["files"] else None

    def begin(self, head: Mapping[str, Any]) -> None:
        """Write the first line, where there is none.

        Parameters
        ----------
        head
            Size and checksum of ``run.json``.

        Raises
        ------
        RunFolderError, NoSpaceError
        """
        if self.head is None:
            self._write([{HEAD: dict(head)}, *self])
            self.head = dict(head)

    def append(self, line: Mapping[str, Any]) -> dict[str, Any]:
        """Add a line and flush it to the disk: when this returns, it stays.

        Parameters
        ----------
        line
            With ``unit`` and ``files``. NumPy's numbers are written as plain ones.

        Returns
        -------
        dict
            The line as it was written.

        Raises
        ------
        RunFolderError, NoSpaceError
            It can't be written. The ledger is as before.
        ValueError
            A fact is NaN or infinite, for which JSON has no word.
        """
        return self.extend([line])[0]

    def extend(self, lines: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """Add many lines with one write and one flush, all of them or none; see :meth:`append`."""
        raws = [sealed(line) for line in lines]
        data = b"".join(raws)
        size = os.fstat(self._handle).st_size
        try:
            _write_all(self._handle, data)
            os.fsync(self._handle)
        except OSError as error:
            os.ftruncate(self._handle, size)
            raise whole.unwritable(self._file, error) from error
        self._read[self._file] = size + len(data)
        return [self._keep(raw) for raw in raws]

    def keep(self, line: Mapping[str, Any]) -> dict[str, Any]:
        """Know a line without writing it; returns it as it would be read again."""
        return self._keep(sealed(line))

    def _keep(self, raw: bytes) -> dict[str, Any]:
        line = _read(raw)
        self._units.pop(line["unit"], None)  # a unit done again counts where it was done last
        self._units[line["unit"]] = raw
        self._writers.update(dict.fromkeys(line["files"], line["unit"]))
        return line

    def read_on(self, *files: Path) -> None:
        """Read what others have appended since, to this ledger or to some more files.

        Raises
        ------
        RunFolderError
            A file can't be read, or a line of it is damaged.
        """
        for file in files or (self._file,):
            known = self._read.get(file, 0)
            try:
                with file.open("rb") as stream:
                    stream.seek(known)
                    data = stream.read()
            except FileNotFoundError:
                continue
            except OSError as error:
                raise RunFolderError(f"can't read {file}: {error.strerror}") from error
            self._read[file] = known + self._take(data, file)[0]

    def close(self) -> None:
        """Close the file. A second call does nothing."""
        if self._handle >= 0:
            os.close(self._handle)
            self._handle = -1

    def _open(self) -> None:
        data = self._file.read_bytes() if self._file.exists() else b""
        size, has_damage = self._take(data, self._file)
        self._read[self._file] = size
        if not self._writable:
            return
        if has_damage:
            head = [] if self.head is None else [{HEAD: self.head}]
            self._write([*head, *self])
            return
        self._handle = _appending(self._file)
        if size < len(data):
            os.ftruncate(self._handle, size)
            os.fsync(self._handle)
            self.notes.append(
                f"the last line of {self._file.name} was torn ({len(data) - size} bytes) and was cut off; "
                "its unit is done again"
            )
        whole.flush(self._file.parent)

    def _take(self, data: bytes, file: Path) -> tuple[int, bool]:
        # Returns the bytes that hold whole lines, and whether one of them is damaged. The last line may be
        # torn: a process killed while appending leaves part of one.
        lines = data.splitlines(keepends=True)
        parsed = [_parsed(raw) if raw.endswith(b"\n") else None for raw in lines]
        is_sealed = any(line is not None and SUM in line for line in parsed)
        has_damage, good = False, len(data)
        for number, (raw, line) in enumerate(zip(lines, parsed, strict=True), 1):
            if line is None or (is_sealed and SUM not in line):
                if number == len(lines):
                    good -= len(raw)
                else:
                    has_damage = True
                    self._refuse(file, number)
            elif HEAD in line:
                self.head = line[HEAD]
            else:
                self._keep(raw)
        return good, has_damage

    def _refuse(self, file: Path, number: int) -> None:
        text = f"{file}, line {number} is damaged"
        if not self._is_lenient:
            raise RunFolderError(f"{text}: run the command that made it again, which does its unit again")
        is_mended = self._writable and file == self._file
        what = "its unit is done again" if is_mended else "it was left out"
        self.notes.append(f"{text}; {what}")

    def _write(self, lines: list[dict[str, Any]]) -> None:
        # All of it anew, whole or not at all; then go on after it.
        self.close()
        data = b"".join(sealed(line) for line in lines)
        with whole.whole_file(self._file) as beside:
            beside.write_bytes(data)
        self._handle = _appending(self._file)
        self._read[self._file] = len(data)


def covered(line: Mapping[str, Any]) -> str:
    """What the checksum of a run covers of a line: all but times."""
    kept = {key: value for key, value in line.items() if key not in VOLATILE}
    return json.dumps(kept, sort_keys=True, ensure_ascii=False)


def head_of(file: Path) -> dict[str, Any] | None:
    """Checksum of ``run.json`` as the first line of a ledger has it; None where it has none."""
    try:
        with file.open("rb") as stream:
            line = _parsed(stream.readline(1 << 16))
    except OSError:  # opening the ledger says why
        return None
    head: dict[str, Any] | None = (line or {}).get(HEAD)
    return head


def sealed(line: Mapping[str, Any]) -> bytes:
    """A line as it stands in the file, with its checksum."""
    text = json.dumps(line, ensure_ascii=False, allow_nan=False, default=_plain)
    return f'{text[:-1]}, "{SUM}": "{_sum(text.encode())}"}}\n'.encode()


def _sum(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:SUM_LETTERS]


def _read(raw: bytes) -> dict[str, Any]:
    line: dict[str, Any] = json.loads(raw)
    line.pop(SUM, None)
    return line


def _parsed(raw: bytes) -> dict[str, Any] | None:
    try:
        line = json.loads(raw.decode())
    except (ValueError, RecursionError):
        return None
    if not isinstance(line, dict) or (SUM in line and not _is_sound(raw)):
        return None
    if HEAD in line:
        return line if _is_record("run.json", line[HEAD]) else None
    if not isinstance(line.get("unit"), str):
        return None
    files = line.get("files")
    if not isinstance(files, dict) or not all(_is_record(name, record) for name, record in files.items()):
        return None
    return line


def _is_sound(raw: bytes) -> bool:
    tail = len(f', "{SUM}": "{"0" * SUM_LETTERS}"}}\n')
    body = raw[:-tail] + b"}"
    return raw[-tail:] == f', "{SUM}": "{_sum(body)}"}}\n'.encode()


def _is_record(name: str, record: Any) -> bool:
    place = PurePosixPath(name)
    return (
        not place.is_absolute()
        and ".." not in place.parts
        and isinstance(record, dict)
        and isinstance(record.get("bytes"), int)
        and isinstance(record.get("sha256"), str)
    )


def _appending(file: Path) -> int:
    flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC | os.O_NOFOLLOW
    return os.open(file, flags, 0o666)


def _write_all(handle: int, data: bytes) -> None:
    while data:
        data = data[os.write(handle, data) :]


def _plain(value: Any) -> Any:
    if hasattr(value, "item") and getattr(value, "ndim", None) == 0:
        return value.item()
    raise TypeError(f"a ledger line can't hold {value!r} ({type(value).__name__})")
