"""The lock of a run folder: one writer at a time, named, and gone with its holder."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import socket
from collections.abc import Callable, Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from enfilade.errors import RunFolderError
from enfilade.files import is_full, unwritable

__all__ = ["LOCK_NAME", "PART_LOCKS", "Lock", "Wait", "sign_workers", "writers_of"]

LOCK_NAME = "run.lock"
PART_LOCKS = "parts/*.lock"
SHOWN = 3  # holders named in a message

Wait = Callable[[str], None]  # told who holds a lock before each new try; raises when that took long enough


class Lock:
    """A claim on a run folder, held until :meth:`release` or the end of the process.

    The kernel holds it (``flock``), so that it goes when its holder dies, however that happens; processes
    forked from the holder share it. The file stays, and only says who holds it: removing it would let two
    processes lock two files of one name.

    Parameters
    ----------
    folder
        The run folder, which must exist.
    part
        Name of a share of the run: those who share it keep away who wants the folder to itself, and others
        of the same name. None: the folder to itself.
    wait
        Told who holds it before each new try, and raises to give up: a file server keeps the locks of a host
        that lost its power for a minute and a half. None: one try.

    Attributes
    ----------
    is_shared : bool

    Raises
    ------
    RunFolderError
        Another process is writing there, or the folder can't be written.
    NoSpaceError
    """

    def __init__(self, folder: Path, *, part: str | None = None, wait: Wait | None = None) -> None:
        self.is_shared = part is not None
        self._own = self._shared = -1
        try:
            if part is None:
                self._own = _locked(folder / LOCK_NAME, fcntl.LOCK_EX, wait)
            else:
                self._shared = _locked(folder / LOCK_NAME, fcntl.LOCK_SH, wait)
                os.ftruncate(self._shared, 0)  # who had the folder to itself has gone
                self._own = _locked(folder / f"parts/{part}.lock", fcntl.LOCK_EX, wait)
            _sign(self._own)
        except BaseException:
            self.release()
            raise

    def release(self) -> None:
        """Let others write. A second call does nothing."""
        for handle in (self._own, self._shared):
            if handle >= 0:
                if handle == self._own:
                    os.ftruncate(handle, 0)
                fcntl.flock(handle, fcntl.LOCK_UN)  # closing alone leaves it with forked processes
                os.close(handle)
        self._own = self._shared = -1


def _locked(file: Path, kind: int, wait: Wait | None) -> int:
    try:
        handle = os.open(file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o666)
    except OSError as error:
        if is_full(error):
            raise unwritable(file, error) from error
        raise RunFolderError(
            f"can't write in {file.parent}: {error.strerror}; choose another --out"
        ) from error
    try:
        _hold(handle, kind, file, wait)
    except BaseException:
        os.close(handle)
        raise
    return handle


def _hold(handle: int, kind: int, file: Path, wait: Wait | None) -> None:
    while not _is_had(handle, kind, file):
        held = f"another command is writing {file.parent}: {_holders(file)}"
        if wait is None:
            raise RunFolderError(f"{held}; wait for it, stop it, or choose another --out")
        wait(held)


def _is_had(handle: int, kind: int, file: Path) -> bool:
    try:
        fcntl.flock(handle, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        raise RunFolderError(f"can't lock {file}: {error.strerror}") from error
    return True


def writers_of(folder: Path) -> list[dict[str, Any]]:
    """Who is writing in a run folder, told without touching the locks: one, or those who share it.

    Parameters
    ----------
    folder

    Returns
    -------
    list of dict
        ``host``, ``pid``, ``started`` (ISO 8601) and ``workers``: how many units it does at once. A process
        of this host that has gone writes no more; whether one of another host still lives can't be seen
        from here.
    """
    return _living([folder / LOCK_NAME]) or _living(_part_locks(folder))


def sign_workers(folder: Path, workers: int, part: str | None = None) -> None:
    """Say in the lock that this process holds how many units it does at once.

    Parameters
    ----------
    folder
    workers
    part
        Name of the share that it holds, where that is known: a farm has thousands of locks to look through.
    """
    known = [] if part is None else [folder / f"parts/{part}.lock"]
    for file in known or (*_part_locks(folder), folder / LOCK_NAME):
        name = _signature(file)
        if name is not None and (name["host"], name["pid"]) == (socket.gethostname(), os.getpid()):
            with contextlib.suppress(OSError), file.open("r+b") as stream:  # the name is only to be read
                _write(stream.fileno(), {**name, "workers": workers})
            return


def _living(locks: Iterable[Path]) -> list[dict[str, Any]]:
    """Names that stand in locks, but for those of this host that are known to be gone."""
    names = [name for name in map(_signature, locks) if name is not None]
    here = socket.gethostname()
    return [name for name in names if name["host"] != here or Path(f"/proc/{name['pid']}").exists()]


def _part_locks(folder: Path) -> list[Path]:
    return sorted(folder.glob(PART_LOCKS))


def _signature(file: Path) -> dict[str, Any] | None:
    try:
        name = json.loads(file.read_bytes())
        return {
            "host": str(name["host"]),
            "pid": int(name["pid"]),
            "started": str(name["started"]),
            "workers": int(name.get("workers", 1)),
        }
    except (OSError, ValueError, KeyError, TypeError, OverflowError):  # it is empty, or just being written
        return None


def _sign(handle: int) -> None:
    name = {
        "host": socket.gethostname(),
        "pid": os.getpid(),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    _write(handle, name)


def _write(handle: int, name: dict[str, Any]) -> None:
    data = json.dumps(name).encode() + b"\n"
    size = 0
    with contextlib.suppress(OSError):  # a full disk: the name is only to be read
        size = os.pwrite(handle, data, 0)
    os.ftruncate(handle, size)


def _holders(file: Path) -> str:
    name = _signature(file)
    names = _living(_part_locks(file.parent)) if name is None else [name]
    if not names:  # they are just signing, or have gone
        return "a process that hasn't given its name"
    shown = [f"process {name['pid']} on {name['host']}, since {name['started']}" for name in names[:SHOWN]]
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f"{'; '.join(shown)}{more}"
