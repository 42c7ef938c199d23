"""A run folder that is opened, continued, read and checked."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from types import TracebackType
from typing import Any, Self

from enfilade.codec import read_json, sweep, write_json
from enfilade.codec.whole import MARK, json_bytes
from enfilade.errors import DamagedFileError, RunFolderError
from enfilade.store.ledger import Ledger, covered, head_of
from enfilade.store.lock import LOCK_NAME, Lock, writer_of

__all__ = ["KINDS", "Run"]

KINDS = ("drafts", "keyframes", "cells", "raw", "frames")
FORMAT = 1  # of the folder; another number is refused
RUN_FILE, LEDGER_FILE, PARTS = "run.json", "ledger.jsonl", "parts"
RESERVED = frozenset({"unit", "files"})  # keys of a ledger line that are ours
SHOWN_DIFFERENCES = 12
SHOWN_LETTERS = 80  # of one value: a list of frames has many

Report = Callable[[dict[str, Any]], None]


class Run:
    """A run folder. Made by :meth:`open` to write in it, by :meth:`existing` to read it.

    :meth:`joining` is for the workers of who writes in it, :meth:`sharing` for several commands that work on
    it at once, each with a ledger of its own.

    Attributes
    ----------
    folder : Path
    identity : dict
        What makes the results what they are, as ``run.json`` has it.
    notes : list of str
        What was recovered or removed when the folder was opened, for the user to know.
    """

    def __init__(
        self,
        folder: Path,
        identity: dict[str, Any],
        ledger: Ledger,
        *,
        lock: Lock | None = None,
        report: Report | None = None,
    ) -> None:
        self.folder = folder
        self.identity = identity
        self.notes: list[str] = list(ledger.notes)
        self._lock = lock
        self._ledger = ledger
        self._report = report

    @classmethod
    def open(
        cls, folder: Path, identity: Mapping[str, Any], *, kept: Callable[[list[str]], str] | None = None
    ) -> Self:
        """Begin a run in a new or empty folder, or continue the same run in its own.

        Parameters
        ----------
        folder
        identity
            What makes the results what they are; fit for JSON, nested as you like.
        kept
            Says of another run, by the keys in which it differs, what of it would have been the same.

        Raises
        ------
        RunFolderError
            The folder holds another run, or something else; is damaged; another command is writing it;
            it can't be written.
        NoSpaceError
        """
        wanted = json.loads(json.dumps(identity, allow_nan=False))
        _prepare(folder)
        lock = Lock(folder)
        try:
            notes = _claim(folder, wanted, kept)
            if left := sweep(folder):
                notes.append(f"removed {len(left)} unfinished files of a run that was interrupted")
            ledger = Ledger(folder / LEDGER_FILE, writable=True)
            ledger.begin(_record(folder / RUN_FILE))
            _join_parts(folder, ledger)
            run = cls(folder, wanted, ledger, lock=lock)
        except BaseException:
            lock.release()
            raise
        run.notes[:0] = notes
        return run

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
        identity = _found(folder)
        ledger = Ledger(folder / LEDGER_FILE, writable=False, is_lenient=is_lenient)
        ledger.read_on(*_parts(folder))
        return cls(folder, identity, ledger)

    @classmethod
    def joining(cls, folder: Path, report: Report) -> Self:
        """Work on a run that another process writes: what is finished is reported to that one.

        Parameters
        ----------
        folder
        report
            Takes the ledger line of a finished unit.

        Raises
        ------
        RunFolderError
            It holds no run, or is damaged.
        """
        return cls(folder, _found(folder), Ledger(folder / LEDGER_FILE, writable=False), report=report)

    @classmethod
    def sharing(cls, folder: Path, part: str) -> Self:
        """Work on a run together with other commands, on a folder that all of them see.

        What is finished goes into a ledger of its own, ``parts/NAME.jsonl``, which the next command that has
        the folder to itself takes over.

        Parameters
        ----------
        folder
        part
            Name of this command's share, which no other has at the same time.

        Raises
        ------
        RunFolderError
            It holds no run, or is damaged; one command has it to itself, or another the same share.
        """
        identity = _found(folder)
        file = folder / PARTS / f"{part}.jsonl"
        file.parent.mkdir(exist_ok=True)
        lock = Lock(folder, part=part)
        try:
            ledger = Ledger(file, writable=True)
            ledger.read_on(folder / LEDGER_FILE, *_parts(folder))
            return cls(folder, identity, ledger, lock=lock)
        except BaseException:
            lock.release()
            raise

    def refresh(self) -> None:
        """Read what other processes have finished since."""
        self._ledger.read_on(self.folder / LEDGER_FILE, *_parts(self.folder))

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

        A run that was joined reports the line instead.

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
        NoSpaceError
        ValueError
            A file outside the folder, a fact that JSON has no word for, or a run opened for reading.
        """
        if taken := RESERVED.intersection(facts):
            raise ValueError(f"the ledger keeps these keys for itself: {', '.join(sorted(taken))}")
        if self._lock is None and self._report is None:
            raise ValueError(f"{self.folder} is open for reading only")
        records = {self._relative(f): _record(f) for f in files}
        line = {"unit": unit, "files": records, **facts}
        if self._report is None:
            self._ledger.append(line)
        else:
            self._report(self._ledger.keep(line))

    def record(self, line: Mapping[str, Any]) -> None:
        """Put a line into the ledger that a run which joined this one has reported.

        Raises
        ------
        RunFolderError, NoSpaceError
        """
        self._ledger.append(line)

    def lines(self) -> Iterator[dict[str, Any]]:
        """Ledger lines of all finished units, in order; of a unit done twice, the newest."""
        return iter(self._ledger)

    def check(self, file: Path) -> None:
        """Compare a file with the checksum on record: to be called before it is used.

        Raises
        ------
        DamagedFileError
            It is missing, damaged, or not on record.
        """
        name = self._relative(file)
        line = self._ledger.writer(name)
        if line is None:
            raise DamagedFileError(f"{file} is in no ledger line: it was not finished; delete it", name)
        if not self._is_sound(name, line):
            raise DamagedFileError(
                f"{file} isn't what unit {line['unit']!r} wrote: it is missing or damaged; delete it and run "
                "the same command again",
                name,
            )

    def damaged(self) -> list[str]:
        """Compare every file with its checksum; names of those that are missing or damaged, in order."""
        return [name for line in self.lines() for name in line["files"] if not self._is_sound(name, line)]

    def forget(self, name: str) -> None:
        """Remove a damaged file, so that its unit counts as not done.

        Parameters
        ----------
        name
            In the folder, as :attr:`~enfilade.errors.DamagedFileError.file` has it.

        Raises
        ------
        RunFolderError
            It can't be removed, or a link leads out of the folder.
        """
        file = self.folder / name
        if not file.parent.resolve().is_relative_to(self.folder.resolve()):
            raise RunFolderError(f"{file} lies outside the run folder: a link leads there; remove the link")
        try:
            file.unlink(missing_ok=True)
        except OSError as error:
            raise RunFolderError(f"can't remove {file}: {error.strerror}") from error

    def digest(self) -> str:
        """Checksum of the run: of all that the ledger says but times and tries, whatever the order.

        Two runs of the same work have the same one, however often they were stopped and whoever did what.
        """
        text = "\n".join(sorted(covered(line) for line in self.lines()))
        return hashlib.sha256(text.encode()).hexdigest()

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

    def _is_sound(self, name: str, line: Mapping[str, Any]) -> bool:
        file, record = self.folder / name, line["files"][name]
        return bool(_size(file) == record["bytes"] and _record(file) == record)

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
    if foreign and RUN_FILE not in names and head_of(folder / LEDGER_FILE) is None:
        raise RunFolderError(
            f"{folder} is not empty and holds no run (it has {', '.join(foreign[:3])}); choose another --out"
        )


def _found(folder: Path) -> dict[str, Any]:
    if not folder.is_dir():
        raise RunFolderError(f"there is no folder {folder}")
    if not (folder / RUN_FILE).is_file():
        raise RunFolderError(f"{folder} is no run folder: it has no {RUN_FILE}")
    identity = _read_identity(folder)
    if head_of(folder / LEDGER_FILE) not in (None, _record(folder / RUN_FILE)):
        raise RunFolderError(
            f"{folder / RUN_FILE} is damaged: it isn't what was written; run the command that made it again"
        )
    return identity


def _claim(folder: Path, wanted: dict[str, Any], kept: Callable[[list[str]], str] | None) -> list[str]:
    """Say in ``run.json`` what the folder holds, or check that it is that; returns what was mended."""
    file, text = folder / RUN_FILE, {"format": FORMAT, "identity": wanted}
    head, data = head_of(folder / LEDGER_FILE), json_bytes(text)
    is_there = file.exists()
    if is_there and (head is None or _record(file) == head):
        _check_same(folder, _read_identity(folder), wanted, kept)
        return []
    if head is not None and head != {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}:
        raise RunFolderError(
            f"{file} is {'damaged' if is_there else 'missing'}, and its checksum in the ledger isn't that of "
            "this command: continue with the command that began it, or choose another --out"
        )
    write_json(file, text)
    return [] if head is None else [f"{RUN_FILE} was damaged or missing and was written again"]


def _parts(folder: Path) -> list[Path]:
    return sorted((folder / PARTS).glob("*.jsonl"))


def _join_parts(folder: Path, ledger: Ledger) -> None:
    """Take over the lines of those who shared the run."""
    for file in _parts(folder):
        part = Ledger(file, writable=True)
        ledger.notes.extend(part.notes)
        for line in part:
            ledger.append(line)
        part.close()
        file.unlink()


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


def _check_same(
    folder: Path,
    there: dict[str, Any],
    now: dict[str, Any],
    kept: Callable[[list[str]], str] | None,
) -> None:
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
        f"{folder} holds another run:{shown}{more}\n{'' if kept is None else kept(keys)}"
        f"Choose another --out, or delete {folder} to begin anew"
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
