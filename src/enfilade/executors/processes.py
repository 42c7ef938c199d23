"""Worker processes on this machine, supervised: one that dies costs the unit in its hand and nothing else."""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import signal
import socket
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from enfilade.codec.whole import unwritable
from enfilade.executors.executor import Event, Failure, FailureKind, Hear, Recipe
from enfilade.executors.unit import Unit

CHILD = "enfilade.executors.child"
RECEIVED = 1 << 16  # bytes taken at once
LOG_TAIL = 1 << 14  # bytes of a dead worker's log that are kept
GRACE_S = 5.0  # in which a killed worker should be gone


@dataclass(eq=False)
class _Child:
    process: subprocess.Popen[bytes]
    line: socket.socket
    log: Path
    received: bytes = b""
    unit: Unit | None = None


class Processes:
    """So many worker processes, begun when they are needed, each with one unit in hand.

    They are fresh interpreters, not forks: threads, kernels and devices of this process are not theirs. One
    whose supervisor dies is killed by the kernel.

    Parameters
    ----------
    recipe
    hear
        Takes the reports, each with its unit.
    workers
    logs
        Folder for what they print.
    """

    def __init__(self, recipe: Recipe, hear: Hear, *, workers: int, logs: Path) -> None:
        self._recipe = recipe
        self._hear = hear
        self._logs = logs
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
        child.unit = unit
        order = {"kind": unit.kind, "facts": dict(unit.facts), "share": share}
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):  # it died: `wait` finds it
            child.line.sendall(json.dumps(order).encode() + b"\n")

    def wait(self, timeout_s: float | None) -> list[Event]:
        """Hear what the workers report, and bury those that died."""
        events: list[Event] = []
        if not any(child.unit for child in self._children.values()):
            return events
        for key, _ in self._selector.select(timeout_s):
            events += self._receive(key.data)
        return events

    def close(self) -> None:
        """Kill the workers: what they have in hand is dropped."""
        for slot in list(self._children):
            self._end(slot)
        self._selector.close()

    def _spawn(self, slot: int) -> _Child:
        file = self._logs / f"worker-{slot}.log"
        try:
            self._logs.mkdir(parents=True, exist_ok=True)
            log = file.open("wb")
        except OSError as error:
            raise unwritable(file, error) from error
        ours, theirs = socket.socketpair()
        command = [sys.executable, "-P", "-m", CHILD, str(theirs.fileno()), str(os.getpid())]
        with theirs, log:
            process = subprocess.Popen(  # noqa: S603
                command, pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL, stdout=log, stderr=log
            )
        child = _Child(process, ours, file)
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            ours.sendall(json.dumps(asdict(self._recipe)).encode() + b"\n")
        self._children[slot] = child
        self._selector.register(ours, selectors.EVENT_READ, slot)
        return child

    def _receive(self, slot: int) -> list[Event]:
        child = self._children[slot]
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
        text = f"its worker {_died_of(code)}"
        return [Event(slot, Failure(FailureKind.DIED, text, _tail(child.log)))]

    def _end(self, slot: int) -> int:
        child = self._children.pop(slot)
        self._selector.unregister(child.line)
        child.line.close()
        if child.process.poll() is None:
            with contextlib.suppress(subprocess.TimeoutExpired):  # it closes its end before it is gone
                child.process.wait(0.2)
        if child.process.poll() is None:
            child.process.kill()
        try:
            return child.process.wait(GRACE_S)
        except subprocess.TimeoutExpired:  # the kernel holds it, for a disk that doesn't answer
            return -signal.SIGKILL


def _died_of(code: int) -> str:
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        return f"was killed by {signal.Signals(-code).name}"
    except ValueError:
        return f"was killed by signal {-code}"


def _tail(log: Path) -> str:
    return log.read_bytes()[-LOG_TAIL:].decode(errors="replace")
