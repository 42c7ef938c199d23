"""A run folder that is opened, continued, read and checked."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from types import TracebackType
from typing import Any, Self

from enfilade.errors import DamagedFileError, RunFolderError
from enfilade.files import unwritable, write_json
from enfilade.store.checksum import checksum, size_of
from enfilade.store.guest import sweep_but_guests
from enfilade.store.identity import LEDGER_FILE, RUN_FILE, claim, identity_of, prepare
from enfilade.store.ledger import Ledger, covered
from enfilade.store.lock import LOCK_NAME, Lock, Wait
from enfilade.store.parts import PARTS, join_parts, part_file, part_files

__all__ = ["KINDS", "PARTS", "Run"]

KINDS = ("drafts", "keyframes", "cells", "raw", "frames", "clips")
RESERVED = frozenset({"unit", "files"})  # keys of a ledger line that are ours

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
    part : str or None
        Name of the share of the run that this command, or the one that it works for, has; None: all of it.
    """

    def __init__(
        self,
        folder: Path,
        identity: dict[str, Any],
        ledger: Ledger,
        *,
        lock: Lock | None = None,
        report: Report | None = None,
        part: str | None = None,
    ) -> None:
        self.folder = folder
        self.part = part
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
        prepare(folder)
        lock = Lock(folder)
        try:
            notes = claim(folder, wanted, kept)
            if left := sweep_but_guests(folder, KINDS):
                notes.append(f"removed {len(left)} unfinished files of a run that was interrupted")
            ledger = Ledger(folder / LEDGER_FILE, writable=True)
            ledger.begin(checksum(folder / RUN_FILE))
            join_parts(folder, ledger)
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
        identity = identity_of(folder)
        ledger = Ledger(folder / LEDGER_FILE, writable=False, is_lenient=is_lenient)
        ledger.read_on(*part_files(folder))
        if (folder / PARTS).is_dir():  # a command that takes them over puts them into the ledger first
            ledger.read_on()
        return cls(folder, identity, ledger)

    @classmethod
    def joining(cls, folder: Path, report: Report, *, part: str | None = None) -> Self:
        """Work on a run that another process writes: what is finished is reported to that one.

        Parameters
        ----------
        folder
        report
            Takes the ledger line of a finished unit.
        part
            The share that the other process has, if it shares the run. Then damaged lines are left out, as
            that one does, which would not begin with them.

        Raises
        ------
        RunFolderError
            It holds no run, or is damaged.
        """
        identity = identity_of(folder)
        ledger = Ledger(folder / LEDGER_FILE, writable=False, is_lenient=part is not None)
        ledger.read_on(*part_files(folder))
        return cls(folder, identity, ledger, report=report, part=part)

    @classmethod
    def sharing(cls, folder: Path, part: str, *, wait: Wait | None = None) -> Self:
        """Work on a run together with other commands, on a folder that all of them see.

        What is finished goes into a ledger of its own, ``parts/NAME.jsonl``, which the next command that has
        the folder to itself takes over.

        Parameters
        ----------
        folder
        part
            Name of this command's share, which no other has at the same time.
        wait
            See :class:`~enfilade.store.lock.Lock`.

        Raises
        ------
        RunFolderError
            It holds no run, or is damaged, also the ledger of another command; one command has it to itself,
            or another the same share.
        NoSpaceError
        """
        identity = identity_of(folder)
        file = part_file(folder, part)
        try:
            file.parent.mkdir(exist_ok=True)
        except OSError as error:
            raise unwritable(file, error) from error
        lock = Lock(folder, part=part, wait=wait)
        try:
            ledger = Ledger(file, writable=True)
            _read_others(folder, ledger)
            return cls(folder, identity, ledger, lock=lock, part=part)
        except BaseException:
            lock.release()
            raise

    @property
    def is_sole_writer(self) -> bool:
        """Whether it was opened to write in it, and no other command may."""
        return self._lock is not None and not self._lock.is_shared

    def refresh(self) -> None:
        """Read what all others have finished since: on a farm, from thousands of ledgers."""
        self._ledger.read_on(self.folder / LEDGER_FILE, *part_files(self.folder))

    def keep_up(self) -> None:
        """Read what the command for which this run was joined has recorded since, from its one ledger."""
        if self._report is not None:
            own = LEDGER_FILE if self.part is None else part_file(self.folder, self.part)
            self._ledger.read_on(self.folder / own)

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
            size_of(self.folder / name) != record["bytes"] for name, record in line["files"].items()
        ):
            return None
        return line

    def was_finished(self, unit: str) -> bool:
        """Whether a unit was finished once, also where its files don't stand any more."""
        return self._ledger.get(unit) is not None

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
        records = {self._relative(f): checksum(f) for f in files}
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
        if self._is_right(name):
            return
        if self._is_one_of_many:  # whose line of it this one may not have read
            self.refresh()
            if self._is_right(name):
                return
        line = self._ledger.writer(name)
        if line is None:
            raise DamagedFileError(f"{file} is in no ledger line: it was not finished; delete it", name)
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

        One that another command, with which the run is shared, has made again meanwhile stays.

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
        if self._is_one_of_many:
            self.refresh()
            if self._is_right(name):
                return
        try:
            file.unlink(missing_ok=True)
        except OSError as error:
            raise RunFolderError(f"can't remove {file}: {error.strerror}") from error

    def digest(self) -> str:
        """Checksum of the run: of all that the ledger says but times, whatever the order.

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

    @property
    def _is_one_of_many(self) -> bool:
        """Whether other commands write in the run, too, or the one that it was joined for."""
        return self._report is not None or (self._lock is not None and self._lock.is_shared)

    def _is_right(self, name: str) -> bool:
        line = self._ledger.writer(name)
        return line is not None and self._is_sound(name, line)

    def _is_sound(self, name: str, line: Mapping[str, Any]) -> bool:
        file, record = self.folder / name, line["files"][name]
        return bool(size_of(file) == record["bytes"] and checksum(file) == record)

    def _relative(self, file: Path) -> str:
        return file.relative_to(self.folder).as_posix()


def _read_others(folder: Path, ledger: Ledger) -> None:
    """Read what other commands have recorded; damaged lines of theirs are not this one's to take out."""
    known = len(ledger.notes)
    ledger.read_on(folder / LEDGER_FILE, *part_files(folder))
    if damaged := ledger.notes[known:]:
        ledger.close()
        raise RunFolderError(
            f"{damaged[0].rpartition(';')[0]}: `enfilade work {folder}`, with no other command beside it, "
            "takes it out and does its unit again; then run the same command again"
        )
