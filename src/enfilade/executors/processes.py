"""Worker processes on this machine, supervised: one that dies costs the unit in its hand and nothing else."""

from __future__ import annotations

import contextlib
import json
import os
import re
import selectors
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from enfilade.executors.executor import Event, Failure, FailureKind, Hear, Recipe
from enfilade.executors.resources import oom_kills
from enfilade.executors.unit import Unit
from enfilade.executors.watch import Limits, Watch
from enfilade.files import unwritable

CHILD = "enfilade.executors.child"
RECEIVED = 1 << 16  # bytes taken at once
LOG_TAIL = 1 << 14  # bytes of a dead worker's log that are kept
MOST_LOGS = 500  # in the folder; the oldest go first
GRACE_S = 5.0  # in which a killed worker should be gone


@dataclass(eq=False)
class _Child:
    process: subprocess.Popen[bytes]
    line: socket.socket
    log: Path
    received: bytes = b""
    unit: Unit | None = None
    watch: Watch | None = None  # of the unit
    oom_kills: int = 0  # when it was begun


class Processes:
    """So many worker processes, begun when they are needed, each with one unit in hand.

    They are fresh interpreters, not forks: threads, kernels and devices of this process are not theirs. One
    whose supervisor dies is killed by the kernel.

    Parameters
    ----------
    recipe
    hear
        Takes the reports, each with its unit.
        What is to be said of a worker that hangs, as well: ``say`` with a list of one text.
    workers
    logs
        Folder for what they print, which others may use, too.
    limits
        When one that hangs is ended.
    gpus
        Names of those that the workers share, if there are several: each sees one of them.
    """

    def __init__(
        self,
        recipe: Recipe,
        hear: Hear,
        *,
        workers: int,
        logs: Path,
        limits: Limits | None = None,
        gpus: Sequence[str] = (),
    ) -> None:
        self._recipe = recipe
        self._hear = hear
        self._logs = logs
        self._limits = limits or Limits()
        self._gpus = gpus if len(gpus) > 1 else ()
        self._looked = 0.0
        self._children: dict[int, _Child] = {}
        self._selector = selectors.DefaultSelector()
        self.slots = workers

    @property
    def pids(self) -> list[int]:
        """Numbers of the worker processes."""
        return [child.process.pid for child in self._children.values()]

    def begin(self, slot: int, unit: Unit, *, share: int) -> None:
        """Send a unit to a worker.

        Raises
        ------
        RunFolderError, NoSpaceError
            A new one's log can't be written.
        """
        child = self._children.get(slot) or self._spawn(slot)
        child.unit, child.watch = unit, Watch(self._limits, child.process.pid)
        child.oom_kills = oom_kills()
        order = {"kind": unit.kind, "facts": dict(unit.facts), "share": share}
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):  # it died: `wait` finds it
            child.line.sendall(json.dumps(order).encode() + b"\n")

    def wait(self, timeout_s: float | None) -> list[Event]:
        """Hear what the workers report, bury those that died, and end those that hang."""
        events: list[Event] = []
        if not any(child.unit for child in self._children.values()):
            return events
        look_s = self._limits.look_s
        for key, _ in self._selector.select(look_s if timeout_s is None else min(timeout_s, look_s)):
            events += self._receive(key.data)
        return events + self._look()

    def retire(self, slot: int) -> None:
        """End a worker that has nothing in hand."""
        if slot in self._children and self._children[slot].unit is None:
            self._end(slot)

    def close(self) -> None:
        """Kill the workers, all at once: what they have in hand is dropped."""
        for child in self._children.values():
            child.process.kill()
        until = time.monotonic() + GRACE_S
        for slot in list(self._children):
            self._end(slot, max(until - time.monotonic(), 0.0))
        self._selector.close()

    def _spawn(self, slot: int) -> _Child:
        # Others may write beside it: commands that share the run, on this host or on another.
        host = re.sub(r"[^A-Za-z0-9.]+", "-", socket.gethostname())
        file = self._logs / f"worker-{host}-{os.getpid()}-{slot}.log"
        try:
            self._logs.mkdir(parents=True, exist_ok=True)
            _remove_oldest(self._logs, but=file)
            log = file.open("wb")
        except OSError as error:
            raise unwritable(file, error) from error
        ours, theirs = socket.socketpair()
        command = [sys.executable, "-P", "-m", CHILD, str(theirs.fileno()), str(os.getpid())]
        with theirs, log:
            process = subprocess.Popen(  # noqa: S603
                command,
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env=self._environment(slot),
            )
        child = _Child(process, ours, file)
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            ours.sendall(json.dumps(asdict(self._recipe)).encode() + b"\n")
        self._children[slot] = child
        self._selector.register(ours, selectors.EVENT_READ, slot)
        return child

    def _environment(self, slot: int) -> dict[str, str] | None:
        if not self._gpus:
            return None
        return {**os.environ, "CUDA_VISIBLE_DEVICES": self._gpus[slot % len(self._gpus)]}

    def _look(self) -> list[Event]:
        """Look at the workers, from time to time; returns the ends of units whose workers hang."""
        events: list[Event] = []
        if time.monotonic() - self._looked < self._limits.look_s:
            return events
        for slot, child in list(self._children.items()):
            if child.unit is None or child.watch is None:
                continue
            child.watch.look()
            if (news := child.watch.news()) is not None:
                self._hear(child.unit, "say", [f"{child.unit.name}: {news}"])
            if (reason := child.watch.verdict()) is not None:
                child.process.kill()  # also one that is stopped
                self._end(slot)
                events.append(Event(slot, Failure(FailureKind.DIED, reason, _tail(child.log))))
        self._looked = time.monotonic()
        return events

    def _receive(self, slot: int) -> list[Event]:
        child = self._children[slot]
        if child.watch is not None:
            child.watch.hear()
        try:
            data = child.line.recv(RECEIVED)
        except ConnectionResetError:
            data = b""
        if not data:
            return self._bury(slot)
        *lines, child.received = (child.received + data).split(b"\n")
        return [event for text in lines for event in self._said(slot, child, json.loads(text))]

    def _said(self, slot: int, child: _Child, message: list[Any]) -> list[Event]:
        what, value = message
        if what not in ("done", "failed"):
            if child.unit is not None:
                self._hear(child.unit, what, value)
            return []
        child.unit = None
        return [Event(slot, None if what == "done" else Failure.from_json(value))]

    def _bury(self, slot: int) -> list[Event]:
        child = self._children[slot]
        unit = child.unit
        code = self._end(slot)
        if unit is None:  # it had nothing in hand: the next unit gets a new worker
            return []
        kind, text = FailureKind.DIED, f"its worker {_died_of(code)}"
        if code == -signal.SIGKILL and oom_kills() > child.oom_kills:
            kind, text = FailureKind.MEMORY, f"{text}, by the kernel, which lacks memory"
        return [Event(slot, Failure(kind, text, _tail(child.log)))]

    def _end(self, slot: int, grace_s: float | None = None) -> int:
        """Let a worker go; `grace_s`: it was killed, and should be gone after so long."""
        child = self._children.pop(slot)
        self._selector.unregister(child.line)
        child.line.close()
        if grace_s is None:
            grace_s = GRACE_S
            with contextlib.suppress(subprocess.TimeoutExpired):  # it closes its end before it is gone
                child.process.wait(0.2)
            child.process.kill()
        try:
            return child.process.wait(grace_s)
        except subprocess.TimeoutExpired:  # the kernel holds it, for a disk that doesn't answer
            return -signal.SIGKILL
        finally:
            with contextlib.suppress(OSError):
                if not child.log.stat().st_size:
                    child.log.unlink()


def _died_of(code: int) -> str:
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        return f"was killed by {signal.Signals(-code).name}"
    except ValueError:
        return f"was killed by signal {-code}"


def _tail(log: Path) -> str:
    try:
        return log.read_bytes()[-LOG_TAIL:].decode(errors="replace")
    except OSError:  # it was empty, and is gone; or its disk doesn't answer
        return ""


def _remove_oldest(logs: Path, *, but: Path) -> None:
    """Leave room for one log beside the others."""

    def age(log: Path) -> float:
        with contextlib.suppress(OSError):  # another command removes them, too
            return log.stat().st_mtime
        return 0.0

    found = [log for log in logs.glob("worker-*.log") if log != but]
    if len(found) < MOST_LOGS:
        return
    for log in sorted(found, key=age)[: len(found) - MOST_LOGS + 1]:
        with contextlib.suppress(OSError):
            log.unlink()
