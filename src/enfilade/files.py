"""Files that appear whole or not at all: written beside, flushed to the disk, renamed.

A process killed at any moment leaves the old file, or none, under the final name; what it leaves beside
is a hidden file with :data:`MARK` in its name, which :func:`sweep` removes.
"""

from __future__ import annotations

import errno
import json
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from enfilade.errors import EnfiladeError, NoSpaceError, RunFolderError

__all__ = [
    "MARK",
    "flush",
    "is_full",
    "is_passing",
    "json_bytes",
    "read_json",
    "sweep",
    "unwritable",
    "whole_file",
    "write_json",
]

MARK = ".writing-"  # in the name of every file that isn't finished
FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
LASTING = FULL | {
    errno.EACCES, errno.EEXIST, errno.EISDIR, errno.ELOOP, errno.ENAMETOOLONG, errno.ENOENT, errno.ENOTDIR,
    errno.EPERM, errno.EROFS,
}  # fmt: skip
NO_FLUSH = frozenset({errno.EINVAL, errno.ENOTSUP})  # folders: 9p, folders shared with virtual machines


@contextmanager
def whole_file(file: Path) -> Iterator[Path]:
    """Give a path beside `file` to write to; it becomes `file` when the block ends without an error.

    Parameters
    ----------
    file
        The final name. Its folder is made where it is missing; a file that stands there is replaced.

    Yields
    ------
    Path
        In the same folder, with the same suffix. It need not be created before the block ends: nothing
        written is an error.

    Raises
    ------
    RunFolderError, NoSpaceError
        The folder or the file can't be written, or the disk is full. Nothing is left beside it.
    """
    beside = file.with_name(f".{file.stem}{MARK}{os.getpid()}-{secrets.token_hex(4)}{file.suffix}")
    try:
        _make(file.parent)
        yield beside
        flush(beside)
        beside.replace(file)
        flush(file.parent)
    except OSError as error:
        raise unwritable(file, error) from error
    finally:
        _remove(beside)


def sweep(folder: Path) -> list[Path]:
    """Remove unfinished files that a killed process left in a folder and those in it.

    Only for the one process that may write there: what another is writing would go too.

    Parameters
    ----------
    folder

    Returns
    -------
    list of Path
        What was removed, sorted.
    """
    left = sorted(f for f in folder.rglob(f".*{MARK}*") if f.is_file() and not f.is_symlink())
    for file in left:
        file.unlink(missing_ok=True)
    return left


def write_json(file: Path, value: Any) -> None:
    """Write a value as JSON, indented, keys in the order given: the same value, the same bytes.

    Parameters
    ----------
    file
    value
        Of dicts, lists, strings, finite numbers, booleans and None.

    Raises
    ------
    RunFolderError
        The file can't be written.
    ValueError, TypeError
        The value holds a NaN, an infinity, or something that JSON has no word for.
    """
    data = json_bytes(value)
    with whole_file(file) as beside:
        beside.write_bytes(data)


def json_bytes(value: Any) -> bytes:
    """What :func:`write_json` writes."""
    return (json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode()


def read_json(file: Path) -> Any:
    """Read what :func:`write_json` wrote.

    Raises
    ------
    RunFolderError
        The file can't be read or is no JSON.
    """
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise RunFolderError(f"can't read {file}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise RunFolderError(f"{file} is damaged ({error}); delete it or its folder") from error


def unwritable(file: Path, reason: OSError | str) -> EnfiladeError:
    """Describe a file that can't be written, and what to do.

    Parameters
    ----------
    file
    reason
        What the operating system or a library said.

    Returns
    -------
    NoSpaceError or RunFolderError
    """
    if isinstance(reason, OSError) and is_passing(reason):
        return RunFolderError(
            f"can't write {file}: {reason.strerror}; look at its disk, then run the same command again: what "
            "is finished stays"
        )
    text = reason.strerror or str(reason) if isinstance(reason, OSError) else reason
    if isinstance(reason, OSError) and is_full(reason):
        return NoSpaceError(
            f"can't write {file}: no room on the disk ({text}); what is finished stays: make room, then run "
            "the same command again"
        )
    return RunFolderError(
        f"can't write {file}: {text}; make room or choose another folder, then run the same command "
        "again: what is finished stays"
    )


def is_passing(error: OSError) -> bool:
    """Whether the same may succeed a little later: a disk or a network did not answer as it should.

    Not so where a file is missing, in the way, or forbidden, nor where the disk is full.
    """
    return error.errno in errno.errorcode and error.errno not in LASTING


def is_full(error: OSError) -> bool:
    """Whether there is no room on the disk, or no more of it for this user."""
    return error.errno in FULL


def flush(path: Path) -> None:
    """Wait until the disk has a file's bytes, or a folder's names.

    A file system that can't do it for folders need not.

    Raises
    ------
    OSError
    """
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in NO_FLUSH or not path.is_dir():
            raise
    finally:
        os.close(handle)


def _make(folder: Path) -> None:
    if not folder.is_dir():
        folder.mkdir(parents=True, exist_ok=True)
        flush(folder.parent)


def _remove(beside: Path) -> None:
    try:
        beside.unlink(missing_ok=True)
    except OSError:  # its folder is a file, or has become read-only: the error on its way says so
        return
