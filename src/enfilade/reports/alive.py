"""Whether those who signed a run's lock may still be at work: a process of another host can't be asked."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from time import time
from typing import Any

from enfilade.reports.forecast import wall_s
from enfilade.store.identity import LEDGER_FILE
from enfilade.store.parts import part_files

__all__ = ["silence", "silent_since"]

LONG_S = 600.0  # without a sign: shorter silences say nothing
LONG_UNITS = 5.0  # ... nor do those of fewer times the longest unit


def silent_since(
    folder: Path, writers: Sequence[Mapping[str, Any]], lines: Iterable[Mapping[str, Any]]
) -> datetime | None:
    """When a run gave its last sign, where that is so long ago that perhaps nobody is at work any more.

    A sign is a unit that was finished, or a command that began. Whoever works on a unit that takes more than
    five times as long as the longest so far is taken for gone, too.

    Parameters
    ----------
    folder
    writers
        See :func:`~enfilade.store.lock.writers_of`.
    lines
        Of the ledger.

    Returns
    -------
    datetime or None
        None also where nobody is said to be at work.
    """
    last_s = _last_sign_s(folder, writers)
    longest_s = max(map(wall_s, lines), default=0.0)
    if last_s is None or time() - last_s < max(LONG_S, LONG_UNITS * longest_s):
        return None
    return datetime.fromtimestamp(last_s, UTC)


def silence(folder: Path, writers: Sequence[Mapping[str, Any]]) -> int:
    """Tell long silences apart without reading the run: one more from ten minutes on, each time they double.

    Parameters
    ----------
    folder, writers
        As of :func:`silent_since`.
    """
    last_s = _last_sign_s(folder, writers)
    return 0 if last_s is None else max(int((time() - last_s) / LONG_S), 0).bit_length()


def _last_sign_s(folder: Path, writers: Sequence[Mapping[str, Any]]) -> float | None:
    """Seconds since 1970; None where nobody is said to be at work."""
    if not writers:
        return None
    signs = []
    for writer in writers:
        with suppress(ValueError, OverflowError):  # another program wrote the lock
            signs.append(datetime.fromisoformat(writer["started"]).timestamp())
    for ledger in (folder / LEDGER_FILE, *part_files(folder)):
        with suppress(OSError):  # there is none yet, or another command has just taken it over
            signs.append(ledger.stat().st_mtime)
    return max(signs, default=None)
