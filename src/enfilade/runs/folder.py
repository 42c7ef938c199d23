"""A run folder: its identity, its finished tasks, and the files that they wrote.

::

    run.json         identity: method, settings that it reads, scene, camera path, versions
    job.json         everything that a worker needs
    ledger.jsonl     one line for each finished task
    PASS/NNNN.exr    records of a pass, by frame number; frames/ are the delivered ones
    clips/ video.mp4 summary.json plots/ failed/ logs/
    run.lock         the command that writes here
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from enfilade.errors import DamagedFileError, RunFolderError
from enfilade.files import MARK, is_full, read_json, sweep, unwritable, write_json
from enfilade.runs.ledger import Ledger, digest_line
from enfilade.runs.lock import LOCK_FILE, Lock

__all__ = ["FORMAT", "LEDGER_FILE", "RUN_FILE", "RunFolder"]

FORMAT = 4  # of the folder; another number is refused
RUN_FILE, LEDGER_FILE = "run.json", "ledger.jsonl"
SHOWN_DIFFERENCES, SHOWN_LETTERS = 12, 80
RECORD_SUFFIXES = (".exr", ".npz")
LATE_S, LOOK_S = 5.0, 0.5  # a network file system may show files of other hosts late


class RunFolder:
    """A run folder, opened to write in it (:meth:`create`, :meth:`share`) or to read it (:meth:`read`).

    Parameters
    ----------
    folder
    identity
    lock
        None: it is only read.

    Attributes
    ----------
    folder : Path
    identity : dict
        Everything on which the results depend.
    notes : list of str
        What was recovered when the folder was opened.
    """

    def __init__(self, folder: Path, identity: dict[str, Any], lock: Lock | None = None) -> None:
        self.folder = folder
        self.identity = identity
        self.notes: list[str] = []
        self.lock = lock
        self._ledger = Ledger(folder / LEDGER_FILE)
        if damaged := self._ledger.damaged:
            numbers = ", ".join(map(str, damaged))
            self.notes.append(f"{LEDGER_FILE}: line {numbers} is damaged; its task is done again")

    @classmethod
    def create(cls, folder: Path, identity: Mapping[str, Any]) -> Self:
        """Begin a run in a new or empty folder, or continue the same run.

        Parameters
        ----------
        folder
        identity
            Everything on which the results depend; fit for JSON.

        Raises
        ------
        RunFolderError
            The folder holds another run, or something else, or can't be written; another command is writing it.
        NoSpaceError
        """
        wanted: dict[str, Any] = json.loads(json.dumps(identity, allow_nan=False))
        check_place(folder)
        lock = Lock(folder)
        try:
            head = {"format": FORMAT, "identity": _digest(wanted)}
            known = Ledger(folder / LEDGER_FILE).head
            if known != head:
                _check_same(folder, wanted, is_begun=bool(known))
            if _read_or_none(folder) != wanted:
                write_json(folder / RUN_FILE, {"format": FORMAT, "identity": wanted})
            left = sweep(folder)
            run = cls(folder, wanted, lock)
            run._ledger.write_head(head)
        except BaseException:
            lock.release()
            raise
        if left:
            run.notes.append(f"removed {len(left)} unfinished files of a run that was interrupted")
        return run

    @classmethod
    def share(cls, folder: Path) -> Self:
        """Work on a run together with other commands, on a folder that all of them see.

        Raises
        ------
        RunFolderError
            It holds no run, is damaged, or one command has it to itself.
        NoSpaceError
        """
        identity = identity_of(folder)
        return cls(folder, identity, Lock(folder, is_shared=True))

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Open the folder of a finished or running run, to read it.

        Raises
        ------
        RunFolderError
            It holds no run, or is damaged.
        """
        return cls(folder, identity_of(folder))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let others write. A second call does nothing."""
        if self.lock is not None:
            self.lock.release()

    def stem(self, pass_name: str, number: int) -> Path:
        """Path, without suffix, of the file of a pass for a frame number, of four digits or more."""
        sign = "-" if number < 0 else ""
        return self.folder / pass_name / f"{sign}{abs(number):04d}"

    def line(self, pass_name: str, number: int) -> dict[str, Any] | None:
        """Ledger line of a finished task whose files have the size on record; otherwise None."""
        line = self._ledger.get((pass_name, number))
        if line is None:
            return None
        is_there = all(_size(self._file(name)) == record["bytes"] for name, record in line["files"].items())
        return line if is_there else None

    def was_finished(self, pass_name: str, number: int) -> bool:
        """Whether a task was finished once, even if its files are gone."""
        return self._ledger.get((pass_name, number)) is not None

    def lines(self) -> Iterator[dict[str, Any]]:
        """Newest ledger line of each finished task, in order."""
        return iter(self._ledger)

    def refresh(self) -> None:
        """Read what other commands have finished since."""
        self._ledger.refresh()

    def finish(self, line: Mapping[str, Any]) -> None:
        """Append a line to the ledger; when this returns, its task is finished.

        Raises
        ------
        RunFolderError, NoSpaceError
        """
        self._ledger.append(line)

    def record_of(self, files: Sequence[Path]) -> dict[str, dict[str, Any]]:
        """Sizes and checksums of files of this folder, for the line of the task that wrote them."""
        return {file.relative_to(self.folder).as_posix(): _checksum(file) for file in files}

    def check(self, name: str) -> Path:
        """Compare a file with the checksum on record, before it is used.

        Parameters
        ----------
        name
            As the ledger has it.

        Raises
        ------
        DamagedFileError
            It is missing, damaged, or not on record.
        """
        file = self._file(name)
        until = time.monotonic() + LATE_S
        while not file.exists() and time.monotonic() < until:
            time.sleep(LOOK_S)
            list(file.parent.glob("*"))  # makes NFS query its server
        line = self._ledger.writer(name)
        if line is not None and _checksum(file) == line["files"][name]:
            return file
        raise DamagedFileError(f"{file} is missing or damaged; run the same command again to make it again", name)

    def file_of(self, pass_name: str, number: int) -> Path:
        """The file of a pass for a frame number, compared with its checksum.

        Raises
        ------
        DamagedFileError
            It is missing, damaged, or not on record.
        """
        stem = self.stem(pass_name, number).relative_to(self.folder).as_posix()
        names = [f"{stem}{suffix}" for suffix in RECORD_SUFFIXES]
        if not any(self._ledger.writer(name) for name in names):  # finished by another process, perhaps
            self.refresh()
        return self.check(next((name for name in names if self._ledger.writer(name)), names[0]))

    def damaged(self) -> list[str]:
        """Names of all files that are missing or do not have the checksum on record."""
        records = {name: record for line in self.lines() for name, record in line["files"].items()}
        return [name for name, record in records.items() if _checksum(self._file(name)) != record]

    def forget(self, name: str) -> None:
        """Remove a damaged file, so that its task counts as not done.

        Raises
        ------
        RunFolderError
            It can't be removed.
        """
        file = self._file(name)
        try:
            file.unlink(missing_ok=True)
        except OSError as error:
            raise RunFolderError(f"can't remove {file}: {error.strerror}") from error

    def digest(self) -> str:
        """Checksum of the results: of all lines but their times, in whatever order they were finished."""
        text = "\n".join(sorted(digest_line(line) for line in self.lines()))
        return hashlib.sha256(text.encode()).hexdigest()

    def _file(self, name: str) -> Path:
        file = self.folder / name
        if not file.parent.resolve().is_relative_to(self.folder.resolve()):
            raise RunFolderError(f"{file} lies outside of the run folder")
        return file


def check_place(folder: Path) -> None:
    """Make a folder for a run; it must be new, empty, or hold one.

    Raises
    ------
    RunFolderError
        It holds something else, or can't be made.
    NoSpaceError
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        names = sorted(entry.name for entry in folder.iterdir())
    except OSError as error:
        if is_full(error):
            raise unwritable(folder, error) from error
        raise RunFolderError(f"can't make a run in {folder}: {error.strerror}; choose another --out") from error
    foreign = [name for name in names if name != LOCK_FILE and MARK not in name]
    if foreign and RUN_FILE not in names and LEDGER_FILE not in names:
        raise RunFolderError(
            f"{folder} is not empty and holds no run (it has {', '.join(foreign[:3])}); choose another --out"
        )


def identity_of(folder: Path) -> dict[str, Any]:
    """Identity of the run in a folder.

    Raises
    ------
    RunFolderError
        The folder holds no run, one of another format, or is damaged.
    """
    file = folder / RUN_FILE
    if not file.is_file():
        raise RunFolderError(f"{folder} is no run folder: it has no {RUN_FILE}")
    value = read_json(file)
    if not isinstance(value, dict) or not isinstance(value.get("identity"), dict):
        raise RunFolderError(f"{file} is damaged; run the command that made it again")
    if value.get("format") != FORMAT:
        raise RunFolderError(
            f"{file} has format {value.get('format')!r}, this version reads format {FORMAT}; choose another --out"
        )
    identity: dict[str, Any] = value["identity"]
    return identity


def _read_or_none(folder: Path) -> dict[str, Any] | None:
    try:
        return identity_of(folder)
    except RunFolderError:
        return None


def _check_same(folder: Path, now: dict[str, Any], *, is_begun: bool) -> None:
    """Refuse a folder that holds another run, and list the differences."""
    if not is_begun and not (folder / RUN_FILE).exists():
        return
    before, after = _flat(identity_of(folder)), _flat(now)
    keys = [k for k in {**before, **after} if before.get(k, _ABSENT) != after.get(k, _ABSENT)]
    if not keys and not is_begun:
        return
    shown = "".join(
        f"\n  {key}: {_shown(before.get(key, _ABSENT))} there, {_shown(after.get(key, _ABSENT))} now"
        for key in keys[:SHOWN_DIFFERENCES]
    )
    more = f"\n  and {len(keys) - SHOWN_DIFFERENCES} more" if len(keys) > SHOWN_DIFFERENCES else ""
    raise RunFolderError(
        f"{folder} holds another run:{shown}{more}\nChoose another --out, or delete {folder} to begin anew"
    )


_ABSENT = object()


def _shown(value: Any) -> str:
    text = "nothing" if value is _ABSENT else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= SHOWN_LETTERS else f"{text[:SHOWN_LETTERS]}..."


def _flat(value: Any, prefix: str = "") -> dict[str, Any]:
    if isinstance(value, dict) and value:
        parts = [_flat(v, f"{prefix}.{k}" if prefix else str(k)) for k, v in value.items()]
        return {key: leaf for part in parts for key, leaf in part.items()}
    return {prefix: value}


def _digest(identity: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()


def _size(file: Path) -> int | None:
    try:
        return file.stat().st_size
    except OSError:
        return None


def _checksum(file: Path) -> dict[str, Any] | None:
    try:
        with file.open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
            return {"bytes": stream.tell(), "sha256": digest}
    except OSError:
        return None
