"""The ledgers of commands that share a run: one each, until a command has the folder to itself."""

from __future__ import annotations

from pathlib import Path

from enfilade.store.ledger import Ledger
from enfilade.store.lock import PART_LOCKS

__all__ = ["PARTS", "join_parts", "part_file", "part_files"]

PARTS = "parts"  # folder in the run folder


def part_file(folder: Path, part: str) -> Path:
    """Ledger of a share of a run."""
    return folder / PARTS / f"{part}.jsonl"


def part_files(folder: Path) -> list[Path]:
    """Ledgers of all shares of a run, in order."""
    return sorted((folder / PARTS).glob("*.jsonl"))


def join_parts(folder: Path, ledger: Ledger) -> None:
    """Take over the lines of those who shared a run, with one write and one flush; their files go.

    Parameters
    ----------
    folder
        The run, whose lock this process holds, alone.
    ledger
        Of the run.

    Raises
    ------
    RunFolderError, NoSpaceError
        The lines can't be read or written. No file is gone.
    """
    files, lines = part_files(folder), []
    for file in files:
        part = Ledger(file, writable=False, is_lenient=True)
        ledger.notes.extend(part.notes)
        lines += list(part)
    if lines:
        ledger.extend(lines)
    # Nobody holds the lock of a part, or waits for it: who wants one needs that of the folder before.
    for file in (*files, *folder.glob(PART_LOCKS)):
        file.unlink()
