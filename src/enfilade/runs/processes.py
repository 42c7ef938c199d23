"""Worker processes on this machine: one that dies or hangs costs its task and nothing else."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import re
import signal
import socket
import time
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any

from enfilade.files import unwritable
from enfilade.runs.child import WorkerTerms, serve
from enfilade.runs.executor import Ended, Order
from enfilade.runs.failure import Failure, FailureKind
from enfilade.runs.folder import RunFolder
from enfilade.runs.resources import oom_kills

LOGS = "logs"  # in the run folder
LOG_TAIL = 1 << 14  # bytes
GRACE_S = 5.0  # for a killed process to end


@dataclass(eq=False)
class _Child:
    process: SpawnProcess
    pipe: Connection
    log: Path
    busy: bool = False
    begun_s: float | None = None  # when its task began; the scene is loaded before
    oom_kills: int = 0


class Processes:
    """Worker processes, started when they are needed.

    They are spawned, not forked: a device or a kernel of this process is not theirs. When this process dies, the
    kernel ends them.

    Parameters
    ----------
    run
    device
        ``cpu`` or ``gpu``.
    workers
        Number of processes.
    threads
        Of each.
    timeout_s
        After which a process that has not finished its task is killed; 0: never. The time counts from the
        beginning of the task.
    gpus
        Names of the GPUs that the workers share, if there are several.
    """

    def __init__(
        self,
        run: RunFolder,
        *,
        device: str,
        workers: int,
        threads: int,
        timeout_s: float = 0.0,
        gpus: Sequence[str] = (),
    ) -> None:
        self._run = run
        self._device = device
        self._threads = threads
        self._timeout_s = timeout_s
        self._gpus = gpus if len(gpus) > 1 else ()
        self._children: dict[int, _Child] = {}
        self.slots = workers

    @property
    def pids(self) -> list[int]:
        """Process numbers of the workers."""
        return [child.process.pid or 0 for child in self._children.values()]

    def begin(self, slot: int, order: Order) -> None:
        """Send a task to a worker."""
        child = self._children.get(slot) or self._spawned(slot)
        child.busy, child.begun_s, child.oom_kills = True, None, oom_kills()
        with contextlib.suppress(OSError):  # it died: `wait` finds out
            child.pipe.send(order)

    def wait(self, timeout_s: float | None) -> list[Ended]:
        """Receive results, and the ends of processes; kill those that take too long."""
        busy = {slot: child for slot, child in self._children.items() if child.busy}
        limits = [timeout_s, *(self._left_s(child) for child in busy.values())]
        known = [limit for limit in limits if limit is not None]
        sources: dict[Any, int] = {}
        for slot, child in busy.items():
            sources[child.pipe] = sources[child.process.sentinel] = slot
        ready = {sources[source] for source in wait(sources, min(known, default=None))}
        ended = [end for slot in sorted(ready) for end in self._received(slot)]
        late = [slot for slot, child in busy.items() if child.busy and self._left_s(child) == 0.0]
        return ended + [self._killed(slot) for slot in late if slot in self._children]

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

    def _spawned(self, slot: int) -> _Child:
        host = re.sub(r"[^A-Za-z0-9.]+", "-", socket.gethostname())
        log = self._run.folder / LOGS / f"worker-{host}-{os.getpid()}-{slot}.log"
        try:
            log.parent.mkdir(exist_ok=True)
            log.write_bytes(b"")
        except OSError as error:
            raise unwritable(log, error) from error
        gpu = self._gpus[slot % len(self._gpus)] if self._gpus else ""
        terms = WorkerTerms(str(self._run.folder.resolve()), self._device, self._threads, log, gpu)
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=serve, args=(theirs, terms, os.getpid()), daemon=True)
        process.start()
        theirs.close()
        self._children[slot] = _Child(process, ours, log)
        return self._children[slot]

    def _received(self, slot: int) -> list[Ended]:
        child = self._children[slot]
        try:
            kind, value = child.pipe.recv()
        except (EOFError, OSError):
            return [self._died(slot)]
        if kind == "begun":
            child.begun_s = time.monotonic()
            return []
        child.busy = False
        return [Ended(slot, line=value) if kind == "line" else Ended(slot, failure=value)]

    def _died(self, slot: int) -> Ended:
        child = self._children[slot]
        tail, code = _tail(child.log), self._end(slot)
        has_starved = code == -signal.SIGKILL and oom_kills() > child.oom_kills
        kind = FailureKind.MEMORY if has_starved else FailureKind.ERROR
        why = ", by the kernel, for lack of memory" if has_starved else ""
        return Ended(slot, failure=Failure(kind, f"its worker {_cause(code)}{why}", tail))

    def _killed(self, slot: int) -> Ended:
        child = self._children[slot]
        child.process.kill()
        tail = _tail(child.log)
        self._end(slot)
        text = f"its worker was killed: it took more than {self._timeout_s:g} s ([limits] task_timeout_s)"
        return Ended(slot, failure=Failure(FailureKind.ERROR, text, tail))

    def _left_s(self, child: _Child) -> float | None:
        """Seconds that a task may take yet; None: no limit."""
        if not self._timeout_s or child.begun_s is None:
            return None
        return max(child.begun_s + self._timeout_s - time.monotonic(), 0.0)

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


def _cause(code: int) -> str:
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        return f"was killed by {signal.Signals(-code).name}"
    except ValueError:
        return f"was killed by signal {-code}"


def _tail(log: Path) -> str:
    try:
        return log.read_bytes()[-LOG_TAIL:].decode(errors="replace")
    except OSError:
        return ""
