"""The interface between the scheduler and the workers, and the worker that is this process."""

from __future__ import annotations

import gc
import math
import traceback
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import Any, Protocol

from enfilade.arrays import release_memory
from enfilade.errors import EnfiladeError, RunFolderError, SettingsError
from enfilade.methods.base import Task
from enfilade.runs.failure import Failure
from enfilade.runs.folder import RunFolder
from enfilade.runs.identity import digest_of
from enfilade.runs.job import Job
from enfilade.runs.worker import Worker
from enfilade.settings import LimitSettings

EXECUTORS = ("in-process", "processes", "ray", "ray:ADDRESS")
MIN_PATHS_IN_FLIGHT = 1024


@dataclass(frozen=True)
class Workers:
    """The workers that do the tasks of a run. No result depends on their number.

    Attributes
    ----------
    executor : str
        One of :data:`EXECUTORS`.
    count : int or None
        Number of workers; None: one for each GPU, or CPU core.
    threads : int
        Of each worker; 0: its share of the cores.

    Raises
    ------
    SettingsError
        There is no such executor, or it has not as many workers.
    """

    executor: str = "in-process"
    count: int | None = None
    threads: int = 0

    def __post_init__(self) -> None:
        if self.executor not in EXECUTORS[:3] and not self.executor.startswith("ray:"):
            raise SettingsError(
                f"there is no executor {self.executor!r}; choose one of {', '.join(EXECUTORS)}"
            )
        if self.executor == "ray:":
            raise SettingsError(
                "ray: lacks the address of a cluster; ray:HOST:PORT joins one, ray starts one"
            )
        if (self.count is not None and self.count < 1) or self.threads < 0:
            raise SettingsError(
                f"{self.count} workers of {self.threads} threads: give 1 worker or more, 0 threads or more"
            )
        if self.executor == EXECUTORS[0] and (self.count or 1) > 1:
            raise SettingsError(
                f"--workers {self.count}: in-process is one worker; add --executor processes, or leave it out"
            )

    def check(self, limits: LimitSettings) -> None:
        """Refuse what can be known to be wrong before any work.

        Raises
        ------
        SettingsError
            A limit has no effect on these workers.
        EnfiladeError
            Ray is not installed.
        """
        if self.executor == EXECUTORS[0] and limits.task_timeout_s:
            raise SettingsError(
                "[limits] task_timeout_s has no effect on tasks in this process; add --executor processes"
            )
        if self.executor.startswith("ray") and find_spec("ray") is None:
            raise EnfiladeError("--executor ray needs Ray: install it with: pip install ray")


@dataclass(frozen=True)
class Order:
    """A task for a worker.

    Attributes
    ----------
    task : Task
    reduction : int
        Divides the number of paths in flight, after a lack of memory.
    """

    task: Task
    reduction: int = 1


@dataclass(frozen=True)
class Ended:
    """The end of a task.

    Attributes
    ----------
    slot : int
        Of the worker.
    result : dict or Failure
        The line for the ledger, or why there is none.
    """

    slot: int
    result: dict[str, Any] | Failure


class Executor(Protocol):
    """Workers, each of which does one task at a time."""

    @property
    def slots(self) -> int:
        """Number of workers."""
        ...

    def begin(self, slot: int, order: Order) -> None:
        """Give a task to a worker that is free.

        Raises
        ------
        EnfiladeError
            The worker can't be started.
        """
        ...

    def wait(self, timeout_s: float | None) -> list[Ended]:
        """Wait until tasks end, or for so long at most."""
        ...

    def discard(self, slot: int) -> None:
        """End a worker that is free: the next task of its slot goes to a new one."""
        ...

    def close(self) -> None:
        """End all workers; tasks in hand are dropped."""
        ...


class InProcess:
    """The one worker is this process.

    Parameters
    ----------
    job
    run
    """

    slots = 1

    def __init__(self, job: Job, run: RunFolder) -> None:
        self._job = job
        self._run = run
        self._worker: Worker | None = None
        self._reduction = 1
        self._order: Order | None = None

    def begin(self, slot: int, order: Order) -> None:
        """Take a task; it is done in :meth:`wait`."""
        del slot
        self._order = order

    def wait(self, timeout_s: float | None) -> list[Ended]:
        """Do the task."""
        del timeout_s
        order, self._order = self._order, None
        if order is None:
            return []
        try:
            if self._worker is None or order.reduction != self._reduction:
                self.discard(0)
                self._worker = open_worker(self._job, self._run, order.reduction)
                self._reduction = order.reduction
            self._worker.prepare(order.task)  # loading counts in no pass
            return [Ended(0, self._worker.do(order.task))]
        except Exception as error:
            # Dr.Jit makes another error of an interrupt in a loop that it records.
            if isinstance(error.__cause__ or error.__context__, KeyboardInterrupt):
                raise KeyboardInterrupt from error
            return [Ended(0, Failure.of(error, traceback.format_exc()))]

    def discard(self, slot: int) -> None:
        """Free the worker's memory."""
        del slot
        self._worker = None
        gc.collect()  # a scene may be part of reference cycles
        release_memory()

    def close(self) -> None:
        """Free the worker's memory."""
        self.discard(0)


def open_worker(job: Job, run: RunFolder, reduction: int = 1) -> Worker:
    """A worker of this process.

    Raises
    ------
    RunFolderError
        This host would render another result: another scene, version or device.
    """
    if digest_of(run.identity) != digest_of(job.identity()):
        raise RunFolderError(
            f"{run.folder}: the scene, the device, or the version of enfilade, of the renderer or of the "
            "denoiser is not that with which the run began; `enfilade render` lists the differences"
        )
    if reduction > 1:
        paths = job.settings[LimitSettings].paths_in_flight
        least = min(MIN_PATHS_IN_FLIGHT, paths)
        settings = job.settings.replace(
            LimitSettings, paths_in_flight=max(math.ceil(paths / reduction), least)
        )
        job = replace(job, settings=settings)
    return Worker(job, run)
