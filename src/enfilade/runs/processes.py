"""Worker processes on this machine: one that dies or hangs costs its task and nothing else."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import re
import signal
import socket
import time
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any

from enfilade.errors import EnfiladeError
from enfilade.files import unwritable
from enfilade.resource_limits import cause_of_end
from enfilade.runs.child import WorkerTerms, serve
from enfilade.runs.executor import Ended, Order
from enfilade.runs.failure import Failure, FailureKind
from enfilade.runs.folder import RunFolder
from enfilade.runs.resources import oom_kills
from enfilade.settings import LimitSettings

LOGS = "logs"  # in the run folder
LOG_TAIL = 1 << 14  # bytes
GRACE_S = 5.0  # for a process to end by itself


@dataclass(eq=False)
class _Child:
    process: SpawnProcess
    pipe: Connection
    log: Path
    is_busy: bool = False
    has_begun: bool = False  # its task: the scene is loaded
    until_s: float | None = None  # when it is killed
    oom_kills: int = 0


class Processes:
    """Worker processes, started when they are needed.

    They are spawned, not forked: a device or a kernel of this process is not theirs. When this process dies,
    the kernel ends them.

    Parameters
    ----------
    run
    limits
        ``task_timeout_s``: a process that has not finished its task after this time, counted from the
        beginning of the task, is killed; loading the scene may take ``preflight_s`` more. 0: never.
    device
        ``cpu`` or ``gpu``.
    workers
        Number of processes.
    threads
        Of each.
    gpus
        Names of the GPUs that the workers share, if there are several.
    """

    def __init__(
        self,
        run: RunFolder,
        limits: LimitSettings,
        *,
        device: str,
        workers: int,
        threads: int,
        gpus: Sequence[str] = (),
    ) -> None:
        self._folder = run.folder
        self._limits = limits
        self._terms = WorkerTerms(str(run.folder.resolve()), device, threads)
        self._gpus = gpus if len(gpus) > 1 else ()
        self._children: dict[int, _Child] = {}
        self.slots = workers

    def begin(self, slot: int, order: Order) -> None:
        """Send a task to a worker."""
        child = self._children.get(slot)
        if child is not None and not child.process.is_alive():  # it died while it was free
            self._end(slot)
            child = None
        child = child or self._started(slot)
        child.is_busy, child.has_begun, child.oom_kills = True, False, oom_kills()
        child.until_s = self._deadline(self._limits.preflight_s)
        with contextlib.suppress(OSError):  # it died: `wait` finds out
            child.pipe.send_bytes(pickle.dumps(order))

    def wait(self, timeout_s: float | None) -> list[Ended]:
        """Receive results, and the ends of processes; kill those that take too long."""
        busy = {slot: child for slot, child in self._children.items() if child.is_busy}
        now = time.monotonic()
        limits = [child.until_s - now for child in busy.values() if child.until_s is not None]
        limits += [] if timeout_s is None else [timeout_s]
        sources: dict[Any, int] = {}
        for slot, child in busy.items():
            sources[child.pipe] = sources[child.process.sentinel] = slot
        ready = {sources[source] for source in wait(sources, max(min(limits), 0.0) if limits else None)}
        now = time.monotonic()
        late = {slot for slot, child in busy.items() if child.until_s is not None and child.until_s <= now}
        ended = [self._received(slot) for slot in sorted(ready)]
        ended += [self._killed(slot) for slot in sorted(late - ready)]
        return [end for end in ended if end is not None]

    def discard(self, slot: int) -> None:
        """End a worker that is free."""
        if slot in self._children:
            self._end(slot)

    def close(self) -> None:
        """Kill all workers."""
        for child in self._children.values():
            child.process.kill()
        for slot in list(self._children):
            self._end(slot)

    def _started(self, slot: int) -> _Child:
        host = re.sub(r"[^A-Za-z0-9.]+", "-", socket.gethostname())
        log = self._folder / LOGS / f"worker-{host}-{os.getpid()}-{slot}.log"
        try:
            log.parent.mkdir(exist_ok=True)
            log.write_bytes(b"")
        except OSError as error:
            raise unwritable(log, error) from error
        gpu = self._gpus[slot % len(self._gpus)] if self._gpus else ""
        context = multiprocessing.get_context("spawn")
        parent_end, child_end = context.Pipe()
        arguments = child_end, self._terms, os.getpid(), log.resolve(), gpu
        process = context.Process(target=serve, args=arguments, daemon=True)
        # ^C is for this process, which ends its workers: they inherit the mask.
        resource_tracker.ensure_running()  # Python 3.11 unblocks the signal there
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            process.start()
        except OSError as error:
            raise EnfiladeError(
                f"can't start a worker process: {error.strerror}; try fewer workers"
            ) from error
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            child_end.close()
        self._children[slot] = _Child(process, parent_end, log)
        return self._children[slot]

    def _received(self, slot: int) -> Ended | None:
        child = self._children[slot]
        try:
            result = child.pipe.recv()
        except (EOFError, OSError):
            return self._died(slot)
        if result is None:
            child.has_begun, child.until_s = True, self._deadline()
            return None
        child.is_busy, child.until_s = False, None
        return Ended(slot, result)

    def _died(self, slot: int) -> Ended:
        child, code = self._children[slot], self._end(slot)
        has_starved = code == -signal.SIGKILL and oom_kills() > child.oom_kills
        kind = FailureKind.MEMORY if has_starved else FailureKind.ERROR
        why = ", by the kernel, for lack of memory" if has_starved else ""
        return Ended(slot, Failure(kind, f"its worker {cause_of_end(code)}{why}", _tail(child.log)))

    def _killed(self, slot: int) -> Ended:
        child = self._children[slot]
        child.process.kill()
        self._end(slot)
        limit_s, settings = self._limits.task_timeout_s, "task_timeout_s"
        if not child.has_begun:
            limit_s, settings = limit_s + self._limits.preflight_s, "task_timeout_s and preflight_s"
        text = f"its worker was killed: it took more than {limit_s:g} s ([limits] {settings})"
        return Ended(slot, Failure(FailureKind.ERROR, text, _tail(child.log)))

    def _deadline(self, more_s: float = 0.0) -> float | None:
        limit_s = self._limits.task_timeout_s
        return time.monotonic() + limit_s + more_s if limit_s else None

    def _end(self, slot: int) -> int:
        """End a worker; returns its exit code."""
        child = self._children.pop(slot)
        child.pipe.close()  # it ends by itself when it reads again
        child.process.join(GRACE_S)
        if child.process.exitcode is None:
            child.process.kill()
            child.process.join(GRACE_S)
        with contextlib.suppress(OSError):
            if not child.log.stat().st_size:
                child.log.unlink()
        return -signal.SIGKILL if child.process.exitcode is None else child.process.exitcode


def _tail(log: Path) -> str:
    try:
        return log.read_bytes()[-LOG_TAIL:].decode(errors="replace")
    except OSError:
        return ""
