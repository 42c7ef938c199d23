"""A run folder that is opened, continued, read and checked."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from types import TracebackType
from typing import Any, Self

from enfilade.codec import read_json, sweep, write_json
from enfilade.codec.whole import MARK
from enfilade.errors import RunFolderError
from enfilade.store.ledger import Ledger
from enfilade.store.lock import LOCK_NAME, Lock, writer_of

__all__ = ["KINDS", "Run"]

KINDS = ("keyframes", "cells", "raw", "frames")
FORMAT = 1  # of the folder; another number is refused
RUN_FILE, LEDGER_FILE = "run.json", "ledger.jsonl"
RESERVED = frozenset({"unit", "files"})  # keys of a ledger line that are ours
SHOWN_DIFFERENCES = 12
SHOWN_LETTERS = 80  # of one value: a list of frames has many


class Run:
    """A run folder. Made by :meth:`open` to write in it, by :meth:`existing` to read it.

    Attributes
    ----------
    folder : Path
    identity : dict
        What makes the results what they are, as ``run.json`` has it.
    notes : list of str
        What was recovered or removed when the folder was opened, for the user to know.
    """

    def __init__(
        self, folder: Path, identity: dict[str, Any], lock: Lock | None, *, is_lenient: bool = False
    ) -> None:
        self.folder = folder
        self.identity = identity
        self.notes: list[str] = []
        self._lock = lock
        if lock is not None and (left := sweep(folder)):
            self.notes.append(f"removed {len(left)} unfinished files of a run that was interrupted")
        self._ledger = Ledger(folder / LEDGER_FILE, writable=lock is not None, is_lenient=is_lenient)
        self.notes.extend(self._ledger.notes)

    @classmethod
    def open(cls, folder: Path, identity: Mapping[str, Any]) -> Self:
        """Begin a run in a new or empty folder, or continue the same run in its own.

        Parameters
        ----------
        folder
        identity
            What makes the results what they are; fit for JSON, nested as you like.

        Raises
        ------
        RunFolderError
            The folder holds another run, or something else; is damaged; another command is writing it;
            it can't be written.
        """
        wanted = json.loads(json.dumps(identity, allow_nan=False))
        _prepare(folder)
        lock = Lock(folder)
        try:
            if (folder / RUN_FILE).exists():
                _check_same(folder, _read_identity(folder), wanted)
            else:
                write_json(folder / RUN_FILE, {"format": FORMAT, "identity": wanted})
            return cls(folder, wanted, lock)
        except BaseException:
            lock.release()
            raise

    @classmethod
    def existing(cls, folder: Path, *, is_lenient: bool = False) -> Self:
        """Open the folder of a finished or running run, to read it and nothing else.

        Parameters
        ----------
        folder
        is_lenient
            Leave damaged lines of the ledger out, and say so in `notes`.

        Raises
        ------
        RunFolderError
            It holds no run, or is damaged.
        """
        if not folder.is_dir():
            raise RunFolderError(f"there is no folder {folder}")
        if not (folder / RUN_FILE).is_file():
            raise RunFolderError(f"{folder} is no run folder: it has no {RUN_FILE}")
        return cls(folder, _read_identity(folder), None, is_lenient=is_lenient)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let others write. A second call does nothing."""
        self._ledger.close()
        if self._lock is not None:
            self._lock.release()
            self._lock = None

    def writer(self) -> dict[str, Any] | None:
        """Who is writing here now, see :func:`~enfilade.store.lock.writer_of`."""
        return writer_of(self.folder)

    def file(self, kind: str, number: int) -> Path:
        """File of a frame, by the number by which the user knows it.

        Parameters
        ----------
        kind
            One of :data:`KINDS`.
        number
            Four digits or more in the name; a negative one has its sign before them.
        """
        if kind not in KINDS:
            raise ValueError(f"a file of kind {kind!r}; known are: {', '.join(KINDS)}")
        sign = "-" if number < 0 else ""
        return self.folder / kind / f"{sign}{abs(number):04d}.exr"

    def done(self, unit: str) -> dict[str, Any] | None:
        """Ledger line of a finished unit, or None where it isn't finished or its files don't stand.

        Only sizes are looked at; :meth:`check` looks into a file when it is used.
        """
        line = self._ledger.get(unit)
        if line is None or any(
            _size(self.folder / name) != record["bytes"] for name, record in line["files"].items()
        ):
            return None
        return line

    def finish(self, unit: str, *, files: Sequence[Path], facts: Mapping[str, Any]) -> None:
        """Record a unit as finished: a line in the ledger that stays when this returns.

        Parameters
        ----------
        unit
            Its name, the same in every run of the same work.
        files
            What it has written into the folder, all of it in place.
        facts
            What else the ledger shall say, fit for JSON.

        Raises
        ------
        RunFolderError
            The ledger can't be written, or a file isn't there.
        ValueError
            A file outside the folder, a fact that JSON has no word for, or a run opened for reading.
        """
        if self._lock is None:
            raise ValueError(f"{self.folder} is open for reading only")
        if taken := RESERVED.intersection(facts):
            raise ValueError(f"the ledger keeps these keys for itself: {', '.join(sorted(taken))}")
        records = {self._relative(f): _record(f) for f in files}
        self._ledger.append({"unit": unit, "files": records, **facts})

    def lines(self) -> Iterator[dict[str, Any]]:
        """Ledger lines of all finished units, in order; of a unit done twice, the newest."""
        return iter(self._ledger)

    def check(self, file: Path) -> None:
        """Compare a file with the checksum on record: to be called before it is used.

        Raises
        ------
        RunFolderError
            It is missing, damaged, or not on record.
        """
        name = self._relative(file)
        line = self._ledger.writer(name)
        if line is None:
            raise RunFolderError(f"{file} is in no ledger line: it was not finished; delete it")
        if _size(file) is None or _record(file) != line["files"][name]:
            raise RunFolderError(
                f"{file} isn't what unit {line['unit']!r} wrote: it is missing or damaged; delete it and run "
                "the same command again"
            )

    def write_json(self, name: str, value: Any) -> None:
        """Write a JSON file into the folder, whole or not at all.

        Raises
        ------
        RunFolderError
            It can't be written.
        ValueError
            The name leads out of the folder or is that of the run's own files.
        """
        place = PurePosixPath(name)
        if place.is_absolute() or ".." in place.parts or name in (RUN_FILE, LEDGER_FILE, LOCK_NAME):
            raise ValueError(f"{name!r} is no name for a file of the caller's")
        write_json(self.folder / name, value)

    def _relative(self, file: Path) -> str:
        return file.relative_to(self.folder).as_posix()


def _prepare(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        names = sorted(entry.name for entry in folder.iterdir())
    except OSError as error:
        raise RunFolderError(
            f"can't make a run in {folder}: {error.strerror}; choose another --out"
        ) from error
    foreign = [name for name in names if name != LOCK_NAME and MARK not in name]
    if foreign and RUN_FILE not in names:
        raise RunFolderError(
            f"{folder} is not empty and holds no run (it has {', '.join(foreign[:3])}); choose another --out"
        )


def _read_identity(folder: Path) -> dict[str, Any]:
    file = folder / RUN_FILE
    value = read_json(file)
    if not isinstance(value, dict) or not isinstance(value.get("identity"), dict):
        raise RunFolderError(
            f"{file} is damaged: it holds no identity; choose another --out or delete {folder}"
        )
    if value.get("format") != FORMAT:
        raise RunFolderError(
            f"{file} has format {value.get('format')!r}, this version knows {FORMAT}; choose another --out"
        )
    identity: dict[str, Any] = value["identity"]
    return identity


def _check_same(folder: Path, there: dict[str, Any], now: dict[str, Any]) -> None:
    before, after = _flat(there), _flat(now)
    keys = [k for k in {**before, **after} if before.get(k, _ABSENT) != after.get(k, _ABSENT)]
    if not keys:
        return
    shown = "".join(
        f"\n  {key}: {_said(before.get(key, _ABSENT))} there, {_said(after.get(key, _ABSENT))} now"
        for key in keys[:SHOWN_DIFFERENCES]
    )
    more = f"\n  and {len(keys) - SHOWN_DIFFERENCES} more" if len(keys) > SHOWN_DIFFERENCES else ""
    raise RunFolderError(
        f"{folder} holds another run:{shown}{more}\nChoose another --out, or delete {folder} to begin anew"
    )


_ABSENT = object()  # a key that one of two runs doesn't have


def _said(value: Any) -> str:
    text = "nothing" if value is _ABSENT else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= SHOWN_LETTERS else f"{text[:SHOWN_LETTERS]}..."


def _flat(value: Any, prefix: str = "") -> dict[str, Any]:
    if isinstance(value, dict) and value:
        parts = [_flat(v, f"{prefix}.{k}" if prefix else str(k)) for k, v in value.items()]
        return {key: leaf for part in parts for key, leaf in part.items()}
    return {prefix: value}


def _size(file: Path) -> int | None:
    try:
        return file.stat().st_size
    except OSError:
        return None


def _record(file: Path) -> dict[str, Any]:
    try:
        with file.open("rb") as data:
            digest = hashlib.file_digest(data, "sha256").hexdigest()
            return {"bytes": data.tell(), "sha256": digest}
    except OSError as error:
        raise RunFolderError(f"can't read {file}: {error.strerror}") from error
