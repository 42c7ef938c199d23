"""Who writes a file of his own into a run folder, beside who writes the run: it is not swept away."""

from __future__ import annotations

import contextlib
import fcntl
from collections.abc import Iterable, Iterator
from pathlib import Path

from enfilade.files import sweep
from enfilade.store.identity import RUN_FILE

__all__ = ["guest", "sweep_but_guests"]


@contextlib.contextmanager
def guest(folder: Path) -> Iterator[None]:
    """Write a file of one's own into the folder of a run: unfinished, it stays as long as the block lasts.

    A shared lock on ``run.json`` says so, which goes with its holder. On a disk without locks nothing does.

    Parameters
    ----------
    folder
        Of a run; it need not be writable.

    Raises
    ------
    OSError
        It has no ``run.json``.
    """
    with (folder / RUN_FILE).open("rb") as held:
        with contextlib.suppress(OSError):
            fcntl.flock(held, fcntl.LOCK_SH)
        yield


def sweep_but_guests(folder: Path, own: Iterable[str]) -> list[Path]:
    """Remove unfinished files that killed processes left, by the one process that writes the run.

    Parameters
    ----------
    folder
    own
        Folders in it where no guest writes: while there is one, nothing else is swept.

    Returns
    -------
    list of Path
        What was removed.
    """
    with contextlib.ExitStack() as stack:
        try:
            held = stack.enter_context((folder / RUN_FILE).open("r+b"))  # NFS wants to write what it locks
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return [file for name in own for file in sweep(folder / name)]
        except OSError:  # it can't be locked, by guests neither
            pass
        return sweep(folder)
