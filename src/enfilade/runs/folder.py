"""A run folder: its identity, its finished tasks, and the files that they wrote.

::

    run.json         identity: method, settings that it reads, scene, camera path, versions
    job.json         everything that a worker needs
    ledger.jsonl     one line for each finished task
    PASS/NNNN.exr    records of a pass, by frame number; frames/ are the delivered ones
    clips/ video.mp4 summary.json failed/ logs/
    run.lock         the command that writes here
"""

from __future__ import annotations

import hashlib
import json
import shlex
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from enfilade.errors import DamagedFileError, RunFolderError
from enfilade.files import sweep, write_json
from enfilade.runs.identity import FORMAT, RUN_FILE, check_place, check_same, digest_of, identity_of
from enfilade.runs.ledger import LEDGER_FILE, Ledger, digest_line
from enfilade.runs.lock import Lock

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
            self.notes.append(f"{LEDGER_FILE}: line {numbers} is damaged and left out")

    @classmethod
    def create(cls, folder: Path, identity: Mapping[str, Any]) -> Self:
        """Begin a run in a new or empty folder, or continue the same run.

        Parameters
        ----------
        folder
        identity
            Everything on which the results depend, fit for JSON.

        Raises
        ------
        RunFolderError
            The folder holds another run, or something else, or can't be written; another command is writing
            it.
        NoSpaceError
        """
        wanted: dict[str, Any] = json.loads(json.dumps(identity, allow_nan=False))
        check_place(folder)
        lock = Lock(folder)
        try:
            run = cls(folder, wanted, lock)
            known = run._ledger.head
            head = {"format": FORMAT, "identity": digest_of(wanted)}
            if known != head:
                check_same(folder, wanted, is_begun=bool(known), has_results=any(run.lines()))
            if not _has_identity(folder, wanted):
                write_json(folder / RUN_FILE, {"format": FORMAT, "identity": wanted})
            run._ledger.write_head(head)
            if left := run.sweep():
                run.notes.append(f"removed {left} unfinished files of a run that was interrupted")
        except BaseException:
            lock.release()
            raise
        return run

    @classmethod
    def share(cls, folder: Path) -> Self:
        """Work on a run together with other commands, on a folder that all of them see.

        Raises
        ------
        RunFolderError
            It holds no run, is damaged, or another command has it to itself.
        NoSpaceError
        """
        run = cls.read(folder)
        run.lock = Lock(folder, is_shared=True)
        run.refresh()
        return run

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Open the folder of a finished or running run, to read it.

        Raises
        ------
        RunFolderError
            It holds no run, or is damaged.
        """
        run = cls(folder, identity_of(folder))
        if run._ledger.head.get("identity", digest_of(run.identity)) != digest_of(run.identity):
            raise RunFolderError(f"{folder / RUN_FILE} is damaged; run the command that made it again")
        return run

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

    def sweep(self) -> int:
        """Remove the unfinished files of killed processes; returns how many there were."""
        return len(sweep(self.folder))

    def stem(self, pass_name: str, number: int) -> Path:
        """Path, without suffix, of the file of a pass for a frame number, of four digits or more."""
        sign = "-" if number < 0 else ""
        return self.folder / pass_name / f"{sign}{abs(number):04d}"

    def line(self, pass_name: str, number: int) -> dict[str, Any] | None:
        """Ledger line of a finished task whose files have the size on record; otherwise None."""
        line = self.recorded(pass_name, number)
        if line is None:
            return None
        is_there = all(_size(self._file(name)) == record["bytes"] for name, record in line["files"].items())
        return line if is_there else None

    def recorded(self, pass_name: str, number: int) -> dict[str, Any] | None:
        """Ledger line of a task that was finished once, even if its files are gone; otherwise None."""
        return self._ledger.get((pass_name, number))

    def lines(self) -> Iterator[dict[str, Any]]:
        """Newest ledger line of each finished task, in order."""
        return iter(self._ledger)

    def refresh(self) -> None:
        """Read the tasks that other commands have finished since."""
        self._ledger.refresh()

    def finish(self, line: Mapping[str, Any]) -> None:
        """Append a line to the ledger; when this returns, its task is finished.

        Files that an earlier line of the task names, and the new one does not, are removed.

        Raises
        ------
        RunFolderError, NoSpaceError
            The folder was deleted or replaced; or it can't be written.
        """
        if self.lock is not None:
            self.lock.check()
        earlier = self.recorded(line["pass"], line["frame"]) or {"files": ()}
        self._ledger.append(line)
        for name in earlier["files"]:
            if self._ledger.writer(name) is None:
                _remove(self._file(name))

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
            It is missing or damaged.
        KeyError
            No finished task has written it.
        """
        file = self._file(name)
        self.refresh()  # another process may have written it
        line = self._ledger.writer(name)
        if line is None:
            raise KeyError(f"no finished task has written {name}")
        until = time.monotonic() + LATE_S
        while not file.exists() and time.monotonic() < until:
            time.sleep(LOOK_S)
            list(file.parent.glob("*"))  # makes NFS query its server
        if _is_intact(file, line["files"][name]):
            return file
        raise DamagedFileError(
            f"{file} is missing or damaged; `enfilade work {shlex.quote(str(self.folder))} --verify` "
            "makes it again",
            name,
        )

    def file_of(self, pass_name: str, number: int) -> Path:
        """The file of a pass for a frame number, compared with its checksum.

        Raises
        ------
        DamagedFileError
            It is missing or damaged.
        KeyError
            Its task is not finished.
        """
        stem = self.stem(pass_name, number).relative_to(self.folder).as_posix()
        names = [f"{stem}{suffix}" for suffix in RECORD_SUFFIXES]
        if not any(map(self._ledger.writer, names)):
            self.refresh()
        return self.check(next(filter(self._ledger.writer, names), names[0]))

    def damaged(self) -> list[str]:
        """Names of all files that are missing, can't be read, or do not have the checksum on record."""
        found = []
        for name, record in {n: r for line in self.lines() for n, r in line["files"].items()}.items():
            try:
                is_intact = _is_intact(self._file(name), record)
            except RunFolderError:
                is_intact = False
            if not is_intact:
                found.append(name)
        return found

    def forget(self, name: str) -> None:
        """Remove a damaged file, so that its task counts as not done; one that was made again stays.

        Raises
        ------
        RunFolderError
            It can't be removed.
        """
        file = self._file(name)
        self.refresh()
        line = self._ledger.writer(name)
        if line is None or not _is_intact(file, line["files"][name]):
            _remove(file)

    def digest(self) -> str:
        """Checksum of the results: of all lines but their times, independent of their order."""
        text = "\n".join(sorted(digest_line(line) for line in self.lines()))
        return hashlib.sha256(text.encode()).hexdigest()

    def _file(self, name: str) -> Path:
        file = self.folder / name
        if not file.parent.resolve().is_relative_to(self.folder.resolve()):
            raise RunFolderError(f"{file} lies outside of the run folder")
        return file


def _has_identity(folder: Path, wanted: Mapping[str, Any]) -> bool:
    try:
        return identity_of(folder) == wanted
    except RunFolderError:  # it is missing or damaged
        return False


def _size(file: Path) -> int | None:
    try:
        return file.stat().st_size
    except OSError:
        return None


def _remove(file: Path) -> None:
    try:
        file.unlink(missing_ok=True)
    except OSError as error:
        raise RunFolderError(f"can't remove {file}: {error.strerror}") from error


def _is_intact(file: Path, record: Mapping[str, Any]) -> bool:
    return file.exists() and _checksum(file) == record


def _checksum(file: Path) -> dict[str, Any]:
    try:
        with file.open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
            return {"bytes": stream.tell(), "sha256": digest}
    except OSError as error:
        raise RunFolderError(f"can't read {file}: {error.strerror}") from error
