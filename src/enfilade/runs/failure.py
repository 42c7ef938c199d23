"""Failures of tasks, and their consequences for the run."""

from __future__ import annotations

import errno
from dataclasses import dataclass
from enum import Enum

from enfilade import errors
from enfilade.files import is_passing
from enfilade.resource_limits import is_out_of_memory


class FailureKind(Enum):
    """Classes of failures."""

    ERROR = "error"  # an unexpected exception, an I/O error, a worker that died or took too long: tried again
    MEMORY = "memory"  # too little memory: tried again with fewer paths in flight
    FATAL = (
        "fatal"  # an error of the input, a full disk: ends the run, unless a damaged file can be made again
    )


@dataclass(frozen=True, eq=False)
class Failure:
    """The reason why a task was not finished.

    Attributes
    ----------
    kind : FailureKind
    text : str
        One line.
    log : str
        Traceback, or the last output of the worker.
    error : EnfiladeError or None
        To be raised if it ends the run.
    """

    kind: FailureKind
    text: str
    log: str = ""
    error: errors.EnfiladeError | None = None

    @staticmethod
    def of(error: Exception, log: str = "") -> Failure:
        """Classify an exception."""
        text = f"{type(error).__name__}: {error}"
        if _is_memory(error):
            return Failure(FailureKind.MEMORY, text, log)
        if isinstance(error, errors.EnfiladeError) and not _is_passing(error):
            return Failure(FailureKind.FATAL, text, log, error)
        return Failure(FailureKind.ERROR, text, log)


def _is_memory(error: BaseException | None) -> bool:
    while error is not None:
        if isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno == errno.ENOMEM):
            return True
        if isinstance(error, RuntimeError) and is_out_of_memory(str(error)):
            return True
        error = error.__cause__ or error.__context__
    return False


def _is_passing(error: BaseException | None) -> bool:
    """Whether the cause is a disk or a network that may work the next time."""
    while error is not None:
        if isinstance(error, OSError):
            return is_passing(error)
        error = error.__cause__
    return False
