"""Sizes and checksums of files, as the ledger records them."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from enfilade.errors import RunFolderError

__all__ = ["checksum", "size_of"]


def size_of(file: Path) -> int | None:
    """Bytes of a file; None where there is none that can be read."""
    try:
        return file.stat().st_size
    except OSError:
        return None


def checksum(file: Path) -> dict[str, Any]:
    """Size and SHA-256 of a file.

    Raises
    ------
    RunFolderError
        It can't be read.
    """
    try:
        with file.open("rb") as data:
            digest = hashlib.file_digest(data, "sha256").hexdigest()
            return {"bytes": data.tell(), "sha256": digest}
    except OSError as error:
        raise RunFolderError(f"can't read {file}: {error.strerror}") from error
