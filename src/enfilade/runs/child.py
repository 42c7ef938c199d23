"""The worker of another process: a child of this one, or one of a Ray cluster.

The device is chosen before anything is imported that binds to it: all imports of this module are light, and
orders travel as bytes.
"""

from __future__ import annotations

import contextlib
import faulthandler
import os
import pickle
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enfilade.device import activate, load
from enfilade.resource_limits import die_with
from enfilade.runs.failure import Failure

if TYPE_CHECKING:
    from enfilade.runs.worker import Worker


@dataclass(frozen=True)
class WorkerTerms:
    """Arguments with which a worker process is started.

    Attributes
    ----------
    folder : str
        The run.
    device : str
        ``cpu`` or ``gpu``.
    threads : int
    """

    folder: str
    device: str
    threads: int


class Server:
    """Does the orders of another process; its worker is opened by the first one.

    Parameters
    ----------
    terms
    """

    def __init__(self, terms: WorkerTerms) -> None:
        self._terms = terms
        self._worker: Worker | None = None
        self._reduction = 0

    def do(self, order: bytes, begun: Callable[[], object]) -> dict[str, Any] | Failure:
        """Do a task.

        Parameters
        ----------
        order
            A pickled :class:`~enfilade.runs.executor.Order`.
        begun
            Called when the scene is loaded: the time limit of a task does not include loading.

        Returns
        -------
        dict or Failure
            The line for the ledger, or why there is none.
        """
        try:
            activate("gpu" if self._terms.device == "gpu" else "cpu")
            request = pickle.loads(order)  # noqa: S301  (from the process that started this one)
            if self._worker is None or request.reduction != self._reduction:
                self._worker = None  # first, so that there is never memory for two
                self._worker, self._reduction = self._opened(request.reduction), request.reduction
            self._worker.prepare(request.task)
            begun()
            return self._worker.do(request.task)
        except Exception as error:  # noqa: BLE001  (the scheduler decides)
            self._worker = None
            return Failure.of(error, traceback.format_exc())

    def _opened(self, reduction: int) -> Worker:
        from enfilade.runs.executor import open_worker
        from enfilade.runs.folder import RunFolder
        from enfilade.runs.job import read_job

        load().set_thread_count(self._terms.threads)
        folder = Path(self._terms.folder)
        return open_worker(read_job(folder), RunFolder.read(folder), reduction)


def serve(pipe: Connection, terms: WorkerTerms, parent: int, log: Path, gpu: str) -> None:
    """Do the tasks that come through a pipe; the main function of a child process.

    Parameters
    ----------
    pipe
        Receives orders; sends None when a task begins, and its result.
    terms
    parent
        Its process number.
    log
        File for the output.
    gpu
        Name of the only GPU that is used; empty: all.
    """
    die_with(parent)
    output = os.open(log, os.O_WRONLY | os.O_APPEND)
    os.dup2(output, 1)
    os.dup2(output, 2)
    if gpu:
        os.environ["CUDA_VISIBLE_DEVICES"] = gpu
    server = Server(terms)
    with contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            pipe.send(server.do(pipe.recv_bytes(), lambda: pipe.send(None)))


_SERVERS: dict[WorkerTerms, Server] = {}  # of a Ray worker


def do_remotely(terms: WorkerTerms, order: bytes, task_s: float, load_s: float) -> dict[str, Any] | Failure:
    """Do a task in a Ray worker, which keeps the scene for the next one.

    Parameters
    ----------
    terms
    order
    task_s
        After which a worker that has not finished its task ends itself; 0: never.
    load_s
        The same while it loads the scene.
    """
    if terms not in _SERVERS:
        _SERVERS.clear()  # there is memory for one scene
        _SERVERS[terms] = Server(terms)
    try:
        _end_after(task_s + load_s if task_s else 0.0)
        return _SERVERS[terms].do(order, lambda: _end_after(task_s))
    finally:
        faulthandler.cancel_dump_traceback_later()


def _end_after(seconds: float) -> None:
    """End this process after a time, also if it is in native code; 0: never."""
    if seconds:
        faulthandler.dump_traceback_later(seconds, exit=True)
