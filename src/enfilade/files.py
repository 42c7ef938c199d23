"""Atomic file writes: files are written under a temporary name, flushed to the disk and renamed.

A killed process leaves the older file or none under the final name, and possibly a temporary file
``.NAME.writing-HOST-PID-RANDOM.SUFFIX``. :func:`sweep` removes those in a folder, :func:`sweep_beside` the
folders beside a final name.
"""

from __future__ import annotations

import errno
import glob
import json
import os
import re
import secrets
import shutil
import socket
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from enfilade.errors import EnfiladeError, NoSpaceError, RunFolderError

MARK = ".writing-"  # in the name of every temporary file
WRITER = re.compile(re.escape(MARK) + r"(?P<host>.+)-(?P<pid>\d+)-[0-9a-f]{8}(\.[^.]*)?$")
ABANDONED_S = 86_400.0  # a day without a write
FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
LASTING = FULL | {
    errno.EACCES, errno.EEXIST, errno.EISDIR, errno.ELOOP, errno.ENAMETOOLONG, errno.ENOENT, errno.ENOTDIR,
    errno.EPERM, errno.EROFS,
}  # fmt: skip
NO_FLUSH = frozenset({errno.EINVAL, errno.ENOTSUP})  # folders on 9p and other shares of virtual machines


@contextmanager
def whole_file(file: Path) -> Iterator[Path]:
    """Write a file under a temporary name, and rename it when the block ends without an error.

    Parameters
    ----------
    file
        The final name. A missing folder is made; an existing file is replaced.

    Yields
    ------
    Path
        Temporary name in the same folder, with the same suffix. The block has to create it.

    Raises
    ------
    RunFolderError, NoSpaceError
        The folder or the file can't be written, or the disk is full. No temporary file is left.
    """
    temporary = _beside(file)
    try:
        if not file.parent.is_dir():
            file.parent.mkdir(parents=True, exist_ok=True)
            flush(file.parent.parent)
        yield temporary
        flush(temporary)
        temporary.replace(file)
        flush(file.parent)
    except OSError as error:
        raise unwritable(file, error) from error
    finally:
        with suppress(OSError):  # the folder can't be written: the error being raised says so
            temporary.unlink(missing_ok=True)


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """Write a folder under a temporary name, and rename it when the block ends without an error.

    Parameters
    ----------
    folder
        The final name. An existing folder is replaced.

    Yields
    ------
    Path
        An empty folder beside the final one.

    Raises
    ------
    RunFolderError, NoSpaceError
        A folder or a file can't be written, or the disk is full. No temporary folder is left.
    """
    folder = folder.resolve()  # a link stays
    temporary, old = _beside(folder), _beside(folder)
    try:
        temporary.mkdir(parents=True)
        yield temporary
        for place in (*temporary.rglob("*"), temporary):
            flush(place)
        if folder.exists():
            folder.rename(old)
        temporary.rename(folder)
        flush(folder.parent)
        sweep_beside(folder)  # not earlier: a process killed between the renames left the older folder there
    except OSError as error:
        raise unwritable(folder, error) from error
    finally:
        if old.exists() and not folder.exists():
            old.rename(folder)
        for place in (temporary, old):
            shutil.rmtree(place, ignore_errors=True)


@contextmanager
def scratch_folder(name: str) -> Iterator[Path]:
    """A folder for temporary files, removed when the block ends, with those that killed processes have left.

    Parameters
    ----------
    name
        Of what it is for; in the system's folder of temporary files.

    Yields
    ------
    Path
        An empty folder that other users can't read.
    """
    place = Path(tempfile.gettempdir(), name)
    sweep_beside(place)
    folder = _beside(place)
    try:
        folder.mkdir(mode=0o700)
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _beside(final: Path) -> Path:
    """A temporary name of this process, in the same folder and with the same suffix."""
    writer = f"{socket.gethostname()}-{os.getpid()}-{secrets.token_hex(4)}"
    return final.with_name(f".{final.stem}{MARK}{writer}{final.suffix}")


def sweep(folder: Path) -> list[Path]:
    """Remove abandoned temporary files and folders in a folder and those in it; returns them, sorted.

    A file is abandoned if its process on this host has ended, or if nothing was written to it for a day.
    """
    removed = []
    for file in sorted(folder.rglob(f".*{MARK}*")):
        with suppress(FileNotFoundError):  # its writer has just renamed it
            if _is_abandoned(file):
                shutil.rmtree(file) if file.is_dir() else file.unlink()
                removed.append(file)
    return removed


def sweep_beside(final: Path) -> None:
    """Remove abandoned temporary folders of one final name, as far as they can be removed."""
    for folder in final.parent.glob(f".{glob.escape(final.stem)}{MARK}*"):
        with suppress(OSError):  # another process removes it, too, or the folder is not this user's
            if folder.is_dir() and _is_abandoned(folder):
                shutil.rmtree(folder)


def _is_abandoned(file: Path) -> bool:
    status = file.lstat()
    if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
        return False
    writer = WRITER.search(file.name)
    if writer and writer["host"] == socket.gethostname() and not Path("/proc", writer["pid"]).exists():
        return True
    return time.time() - status.st_mtime > ABANDONED_S


def write_json(file: Path, value: Any) -> None:
    """Write a value as JSON, see :func:`json_bytes` and :func:`whole_file`."""
    data = json_bytes(value)
    with whole_file(file) as temporary:
        temporary.write_bytes(data)


def json_bytes(value: Any) -> bytes:
    """Encode a value as indented JSON; ValueError or TypeError for a NaN and other values JSON lacks."""
    return (json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode()


def read_json(file: Path) -> Any:
    """Read a JSON file; RunFolderError if it can't be read or is damaged."""
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise RunFolderError(f"can't read {file}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise RunFolderError(f"{file} is damaged ({error}); run the command that made it again") from error


def unwritable(file: Path, error: OSError) -> EnfiladeError:
    """Make the error for a file that can't be written: a RunFolderError, or a NoSpaceError on a full disk."""
    reason, again = error.strerror or str(error), "then run the same command again: finished files are kept"
    if is_full(error):
        return NoSpaceError(f"can't write {file}: no room on the disk ({reason}); make room, {again}")
    remedy = "check its disk" if is_passing(error) else "check its permissions, or choose another folder"
    return RunFolderError(f"can't write {file}: {reason}; {remedy}, {again}")


def is_passing(error: OSError) -> bool:
    """Whether the operation may succeed later: the disk or the network failed, not the name or the room."""
    return error.errno in errno.errorcode and error.errno not in LASTING


def is_full(error: OSError) -> bool:
    """Whether the disk is full or the quota exhausted."""
    return error.errno in FULL


def flush(path: Path) -> None:
    """Wait until the disk has the bytes of a file or the names in a folder; OSError if it fails."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in NO_FLUSH or not path.is_dir():
            raise
    finally:
        os.close(handle)
