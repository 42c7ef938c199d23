"""The lock of a run folder: one writer at a time, named, and gone with its holder."""

from __future__ import annotations

import fcntl
import json
import os
import socket
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from enfilade.errors import RunFolderError

__all__ = ["LOCK_NAME", "Lock", "sign_workers", "writers_of"]

LOCK_NAME = "run.lock"
PART_LOCKS = "parts/*.lock"


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

    Raises
    ------
    RunFolderError
        Another process is writing there, or the folder can't be written.
    """

    def __init__(self, folder: Path, *, part: str | None = None) -> None:
        self._own = self._shared = -1
        try:
            if part is not None:
                self._shared = _locked(folder / LOCK_NAME, fcntl.LOCK_SH)
            self._own = _locked(folder / (LOCK_NAME if part is None else f"parts/{part}.lock"), fcntl.LOCK_EX)
        except BaseException:
            self.release()
            raise
        for handle in (self._shared, self._own):
            if handle >= 0:
                _sign(handle)

    def release(self) -> None:
        """Let others write. A second call does nothing."""
        for handle in (self._own, self._shared):
            if handle >= 0:
                if handle == self._own:
                    os.ftruncate(handle, 0)
                fcntl.flock(handle, fcntl.LOCK_UN)  # closing alone leaves it with forked processes
                os.close(handle)
        self._own = self._shared = -1


def _locked(file: Path, kind: int) -> int:
    try:
        handle = os.open(file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o666)
    except OSError as error:
        raise RunFolderError(
            f"can't write in {file.parent}: {error.strerror}; choose another --out"
        ) from error
    try:
        fcntl.flock(handle, kind | fcntl.LOCK_NB)
    except OSError as error:
        holder = _holder(handle)
        os.close(handle)
        if not isinstance(error, BlockingIOError):
            raise RunFolderError(f"can't lock {file}: {error.strerror}") from error
        raise RunFolderError(
            f"another command is writing {file.parent}: {holder}; wait for it, stop it, "
            "or choose another --out"
        ) from error
    return handle


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
    found: dict[tuple[str, int], dict[str, Any]] = {}
    for file in _locks(folder):
        name = _signature(file)
        if name is None or (
            name["host"] == socket.gethostname() and not Path(f"/proc/{name['pid']}").exists()
        ):
            continue
        found.setdefault((name["host"], name["pid"]), name)  # who shares a run signs two locks
    return list(found.values())


def sign_workers(folder: Path, workers: int) -> None:
    """Say in the lock that this process holds how many units it does at once.

    Parameters
    ----------
    folder
    workers
    """
    for file in _locks(folder):
        name = _signature(file)
        if name is not None and (name["host"], name["pid"]) == (socket.gethostname(), os.getpid()):
            with file.open("r+b") as stream:
                _write(stream.fileno(), {**name, "workers": workers})
            return


def _locks(folder: Path) -> list[Path]:
    return [*sorted(folder.glob(PART_LOCKS)), folder / LOCK_NAME]


def _signature(file: Path) -> dict[str, Any] | None:
    try:
        name = json.loads(file.read_bytes())
        return {
            "host": str(name["host"]),
            "pid": int(name["pid"]),
            "started": str(name["started"]),
            "workers": int(name.get("workers", 1)),
        }
    except (OSError, ValueError, KeyError, TypeError, OverflowError):  # it is just signing, or has gone
        return None


def _sign(handle: int) -> None:
    name = {
        "host": socket.gethostname(),
        "pid": os.getpid(),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    _write(handle, name)


def _write(handle: int, name: dict[str, Any]) -> None:
    os.ftruncate(handle, 0)
    os.pwrite(handle, json.dumps(name).encode() + b"\n", 0)


def _holder(handle: int) -> str:
    try:
        name = json.loads(os.pread(handle, 4096, 0))
        return f"process {name['pid']} on {name['host']}, since {name['started']}"
    except (OSError, ValueError, KeyError, TypeError):  # it is just signing, or has gone
        return "a process that hasn't given its name"
