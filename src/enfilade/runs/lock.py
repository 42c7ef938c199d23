"""The lock of a run folder: one command that writes all of it, or several that share its tasks."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import socket
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from enfilade.errors import RunFolderError
from enfilade.files import unwritable

LOCK_FILE = "run.lock"


class Lock:
    """A claim on a run folder, until :meth:`release` or the end of the process.

    The kernel holds it (``flock``), so that it ends with the process. The file stays: removing it would let
    two processes lock two files of one name.

    Parameters
    ----------
    folder
        The run folder, which must exist.
    is_shared
        Whether other commands may hold a shared lock at the same time.

    Raises
    ------
    RunFolderError
        Another command holds the lock, or the folder can't be written.
    NoSpaceError
    """

    def __init__(self, folder: Path, *, is_shared: bool = False) -> None:
        file = folder / LOCK_FILE
        self._folder = folder
        try:
            self._handle = os.open(file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o666)
        except OSError as error:
            raise unwritable(file, error) from error
        try:
            fcntl.flock(self._handle, (fcntl.LOCK_SH if is_shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except OSError as error:
            os.close(self._handle)
            if not isinstance(error, BlockingIOError):
                raise RunFolderError(f"can't lock {file}: {error.strerror}") from error
            raise RunFolderError(
                f"another command is writing {folder}{_named(holder_of(folder))}; wait for it, stop it, or "
                "choose another --out"
            ) from error
        if not is_shared:
            self.sign()

    def sign(self) -> None:
        """Write this process into the file, for reports and messages."""
        name = {
            "host": socket.gethostname(),
            "pid": os.getpid(),
            "started": datetime.now(UTC).isoformat(timespec="seconds"),
            "ticks": _ticks_of(os.getpid()),
        }
        data, size = json.dumps(name).encode() + b"\n", 0
        with contextlib.suppress(OSError):  # a full disk: nothing depends on it
            size = os.pwrite(self._handle, data, 0)
        os.ftruncate(self._handle, size)

    def check(self) -> None:
        """Raise RunFolderError if the folder was deleted or replaced: its lock is another one, or is gone."""
        try:
            is_same = os.path.samestat(os.fstat(self._handle), (self._folder / LOCK_FILE).stat())
        except FileNotFoundError:
            is_same = False
        if not is_same:
            raise RunFolderError(f"{self._folder} was deleted or replaced while this command worked in it")

    def release(self) -> None:
        """Let others write. A second call does nothing."""
        if self._handle >= 0:
            holder = holder_of(self._folder) or {}
            if (holder.get("host"), holder.get("pid")) == (socket.gethostname(), os.getpid()):
                os.ftruncate(self._handle, 0)
            fcntl.flock(self._handle, fcntl.LOCK_UN)  # also for processes that were forked from this one
            os.close(self._handle)
            self._handle = -1


def holder_of(folder: Path) -> dict[str, Any] | None:
    """The command that works on a run folder, as it has signed the lock.

    Returns
    -------
    dict or None
        ``host``, ``pid`` and ``started`` (ISO 8601); None where the process is gone, which can't be seen of
        another host.
    """
    try:
        name = json.loads((folder / LOCK_FILE).read_bytes())
        pid, ticks = int(name["pid"]), int(name["ticks"])
        holder = {"host": str(name["host"]), "pid": pid, "started": str(name["started"])}
    except (OSError, ValueError, KeyError, TypeError, OverflowError):  # empty, or being written
        return None
    # In a container another process may have its number again.
    is_gone = holder["host"] == socket.gethostname() and ticks != _ticks_of(pid)
    return None if is_gone else holder


def _ticks_of(pid: int) -> int | None:
    """When a process of this host began, in clock ticks since the system did; None where it is gone."""
    try:
        return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[19])
    except OSError:
        return None


def _named(holder: dict[str, Any] | None) -> str:
    if holder is None:
        return ""
    return f": process {holder['pid']} on {holder['host']}, since {holder['started']}"
