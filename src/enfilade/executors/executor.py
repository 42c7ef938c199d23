"""The seam between who hands out units and who does them. Only JSON crosses it."""

from __future__ import annotations

import errno
import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Protocol

from enfilade import errors
from enfilade.executors.unit import Unit
from enfilade.files import is_passing

Tell = Callable[[str, Any], None]
Hear = Callable[[Unit, str, Any], None]
Worker = Callable[[str, Mapping[str, Any]], None]

# Dr.Jit's words for too little memory; the second where it could have made room, but was recording.
SCARCE = ("out of memory", "tried to free the allocation cache")


class Maker(Protocol):
    """What makes a worker."""

    def make(self, tell: Tell, *, share: int = 1) -> Worker:
        """Make it; see :meth:`Recipe.make`."""
        ...


@dataclass(frozen=True)
class Recipe:
    """How a worker is made, anywhere.

    Attributes
    ----------
    target : str
        ``package.module:function``. Called with `spec` and with what takes its reports, it returns a function
        that does a unit, given its kind and facts.
    spec : mapping
        Fit for JSON. Who chooses where it works looks at ``threads`` and ``device``, if they are there.
    """

    target: str
    spec: Mapping[str, Any] = field(default_factory=dict)

    @property
    def threads(self) -> int:
        """Threads of the worker; 0: its share of the cores."""
        return int(self.spec.get("threads", 0))

    @property
    def needs_gpu(self) -> bool:
        """Whether the worker needs a GPU."""
        return bool(self.spec.get("device") == "cuda")

    def make(self, tell: Tell, *, share: int = 1) -> Worker:
        """Make the worker.

        Parameters
        ----------
        tell
            Takes reports: what it is, and a value fit for JSON.
        share
            The worker shall use one part in so many of the memory that it would use.
        """
        module, _, function = self.target.partition(":")
        made: Worker = getattr(importlib.import_module(module), function)({**self.spec, "share": share}, tell)
        return made


class FailureKind(Enum):
    """What became of a unit that was not finished."""

    DIED = "died"  # its worker did
    MEMORY = "memory"  # there was too little
    ERROR = "error"  # it raised something that nobody foresaw
    IO = "io"  # a disk or a network did not answer as it should
    DEVICE = "device"  # its worker found no device
    REFUSED = "refused"  # an error of ours: it would be the same again
    DAMAGED = "damaged"  # a file that it needs isn't what was written
    SPACE = "space"  # the disk is full


@dataclass(frozen=True, eq=False)
class Failure:
    """Why a unit was not finished.

    Attributes
    ----------
    kind : FailureKind
    text : str
        One line.
    log : str
        What else its worker said.
    error : Exception or None
        To be raised where the command may end with it. Not of what is tried again: its traceback would keep
        all that its worker had in memory.
    file : str
        The damaged one.
    """

    kind: FailureKind
    text: str
    log: str = ""
    error: Exception | None = None
    file: str = ""

    @staticmethod
    def of(error: Exception, log: str = "") -> Failure:
        """What an exception means."""
        text = f"{type(error).__name__}: {error}"
        match error:
            case errors.DamagedFileError():
                return Failure(FailureKind.DAMAGED, text, log, error, file=error.file)
            case errors.NoSpaceError():
                return Failure(FailureKind.SPACE, text, log, error)
            case errors.EnfiladeError() | OSError() if (cause := _passing_cause(error)) is not None:
                kind = FailureKind.MEMORY if cause.errno == errno.ENOMEM else FailureKind.IO
                return Failure(kind, text, log)
            case errors.DeviceError():
                return Failure(FailureKind.DEVICE, text, log, errors.DeviceError(str(error)))
            case errors.EnfiladeError():
                return Failure(FailureKind.REFUSED, text, log, error)
            case MemoryError():
                return Failure(FailureKind.MEMORY, text, log)
            case RuntimeError() if _is_memory(error):
                return Failure(FailureKind.MEMORY, text, log)
            case _:
                return Failure(FailureKind.ERROR, text, log)

    def to_json(self) -> dict[str, str]:
        """Fit to be sent; read back by :meth:`from_json`."""
        error = self.error
        return {
            "kind": self.kind.value,
            "text": self.text,
            "log": self.log,
            "file": self.file,
            "type": type(error).__name__ if isinstance(error, errors.EnfiladeError) else "",
            "message": str(error),
        }

    @staticmethod
    def from_json(table: Mapping[str, str]) -> Failure:
        """Read back from :meth:`to_json`; an error of ours is that error again."""
        kind = FailureKind(table["kind"])
        cls = getattr(errors, table["type"], None) if table["type"] else None
        error: Exception | None = None
        if cls is errors.DamagedFileError:
            error = errors.DamagedFileError(table["message"], table["file"])
        elif cls is not None:
            error = cls(table["message"])
        return Failure(kind, table["text"], table["log"], error, file=table["file"])


@dataclass(frozen=True)
class Event:
    """A unit's end.

    Attributes
    ----------
    slot : int
        The worker.
    failure : Failure or None
        None: it says that it is finished.
    """

    slot: int
    failure: Failure | None = None


def _passing_cause(error: BaseException | None) -> OSError | None:
    """What the operating system said, where that may be otherwise next time."""
    while error is not None and not isinstance(error, OSError):
        error = error.__cause__
    return error if error is not None and is_passing(error) else None


def _is_memory(error: BaseException | None) -> bool:
    """Whether Dr.Jit had too little memory: while it records a kernel, only the cause says so."""
    while error is not None:
        if any(words in str(error).lower() for words in SCARCE):
            return True
        error = error.__cause__ or error.__context__
    return False


class Executor(Protocol):
    """Workers that take a unit each."""

    @property
    def slots(self) -> int:
        """How many units can be in hand at once."""
        ...

    def begin(self, slot: int, unit: Unit, *, share: int) -> None:
        """Give a unit to a worker that has none; see :meth:`Recipe.make`."""
        ...

    def wait(self, timeout_s: float | None) -> list[Event]:
        """Wait until units end, or for so long at most. Reports are told meanwhile."""
        ...

    def retire(self, slot: int) -> None:
        """Let a worker go that has nothing in hand: the next unit of its slot gets a new one."""
        ...

    def close(self) -> None:
        """Drop what is in hand and let the workers go. A second call does nothing."""
        ...
