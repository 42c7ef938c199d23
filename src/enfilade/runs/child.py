"""A worker process. The device is chosen before Dr.Jit's array types are imported, which bind to it."""

from __future__ import annotations

import contextlib
import os
import signal
import traceback
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from enfilade.confined import die_with
from enfilade.device import activate, load


@dataclass(frozen=True)
class WorkerTerms:
    """What a worker process needs to begin.

    Attributes
    ----------
    folder : str
        The run.
    device : str
        ``cpu`` or ``gpu``.
    threads : int
    log : Path
        File for its output.
    gpu : str
        Name of the only GPU that it sees; empty: all.
    """

    folder: str
    device: str
    threads: int
    log: Path
    gpu: str = ""


def serve(pipe: Connection, terms: WorkerTerms, parent: int) -> None:
    """Do the tasks that come through a pipe; the main function of a worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # ^C is for the command, which ends its workers
    die_with(parent)
    log = os.open(terms.log, os.O_WRONLY | os.O_APPEND)
    os.dup2(log, 1)
    os.dup2(log, 2)
    if terms.gpu:
        os.environ["CUDA_VISIBLE_DEVICES"] = terms.gpu
    activate("gpu" if terms.device == "gpu" else "cpu")
    from enfilade.runs.failure import Failure

    worker, reduction = None, 0
    with contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            order = pipe.recv()
            try:
                if worker is None or order.reduction != reduction:
                    worker, reduction = None, order.reduction
                    worker = open_here(terms.folder, terms.device, terms.threads, reduction)
                pipe.send(("begun", None))
                pipe.send(("line", worker.do(order.task)))
            except Exception as error:  # noqa: BLE001  (the scheduler decides)
                worker = None
                pipe.send(("failed", Failure.of(error, traceback.format_exc())))


def open_here(folder: str, device: str, threads: int, reduction: int) -> Any:
    """A worker of this process, with its scene loaded: the time limit of a task does not include loading."""
    activate("gpu" if device == "gpu" else "cpu")
    load().set_thread_count(threads)
    from enfilade.runs.executor import open_worker
    from enfilade.runs.folder import RunFolder
    from enfilade.runs.job import read_job

    worker = open_worker(read_job(Path(folder)), RunFolder.read(Path(folder)), reduction)
    worker.load()
    return worker
