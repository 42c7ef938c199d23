"""A contestant in a process of its own, so that its CPU time and its memory are its own and nobody else's."""

from __future__ import annotations

import multiprocessing
import pickle
import re
import resource
import signal
import time
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from enfilade.device import Choice, activate
from enfilade.errors import EnfiladeError
from enfilade.files import read_json, write_json
from enfilade.monitor import Monitor

__all__ = ["UNCOUNTED", "Spent", "race"]

START = "start"  # imports, warming up, loading the scene: what a longer walkthrough would not pay again
UNCOUNTED = (START, "video")  # stages that are shown and not charged: rivals encode no video
NOTED_EVERY_S = 1.0  # how often what was spent is noted on disk: so much is lost when the bench is killed


@dataclass(frozen=True)
class Spent:
    """What a contestant has spent.

    Attributes
    ----------
    stages : dict of str to (float, float)
        CPU and wall seconds, by what its progress calls them.
    peak_bytes : int
        Resident memory.
    sessions : int
        Processes that worked on it: more than one where it was interrupted.
    """

    stages: dict[str, tuple[float, float]] = field(default_factory=dict)
    peak_bytes: int = 0
    sessions: int = 0

    @property
    def cpu_s(self) -> float:
        """CPU seconds of all threads and child processes, user and system, of the stages that are charged."""
        return sum(cpu for name, (cpu, _) in self.stages.items() if name not in UNCOUNTED)

    @property
    def wall_s(self) -> float:
        """Wall seconds of the stages that are charged."""
        return sum(wall for name, (_, wall) in self.stages.items() if name not in UNCOUNTED)

    def __add__(self, other: Spent) -> Spent:
        """What two sessions spent together."""
        stages = {
            name: (of[0] + more[0], of[1] + more[1])
            for name in {**self.stages, **other.stages}
            for of, more in [(self.stages.get(name, (0.0, 0.0)), other.stages.get(name, (0.0, 0.0)))]
        }
        peak = max(self.peak_bytes, other.peak_bytes)
        return Spent(stages, peak, self.sessions + other.sessions)

    def to_dict(self) -> dict[str, Any]:
        """As plain values, for JSON."""
        return {
            "cpu_s": self.cpu_s,
            "wall_s": self.wall_s,
            "peak_mib": self.peak_bytes / 2**20,
            "start_cpu_s": self.stages.get(START, (0.0, 0.0))[0],
            "sessions": self.sessions,
            "stages": {n: {"cpu_s": cpu, "wall_s": wall} for n, (cpu, wall) in self.stages.items()},
        }

    @classmethod
    def from_dict(cls, table: dict[str, Any]) -> Spent:
        """Read back from :meth:`to_dict`."""
        stages = {name: (of["cpu_s"], of["wall_s"]) for name, of in table["stages"].items()}
        return cls(stages, round(table["peak_mib"] * 2**20), table["sessions"])


def race(task: Any, folder: Path, notes: Path, monitor: Monitor, *, device: Choice = "cpu") -> Spent:
    """Let a contestant do its task, or go on with it, in a new process.

    Parameters
    ----------
    task : Task
    folder
        Its run folder.
    notes
        Where each session notes what it has spent.
    monitor
        Hears of its progress.
    device
        For its kernels.

    Returns
    -------
    Spent
        In this session and in those before.

    Raises
    ------
    EnfiladeError
        As the task; or the process was killed.
    """
    before = sorted(notes.glob("*.json"))
    note = notes / f"{len(before):04d}.json"
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(
        target=_run, args=(theirs, device, pickle.dumps(task), folder), daemon=True, name=folder.name
    )
    process.start()
    theirs.close()
    try:
        _listen(ours, note, monitor)
        process.join()
    finally:
        process.terminate()
        process.join()
    total = Spent()
    for file in [*before, note]:
        total += Spent.from_dict(read_json(file))
    return total


def _listen(connection: Connection, note: Path, monitor: Monitor) -> None:
    noted = -NOTED_EVERY_S
    while True:
        try:
            kind, arguments, spent = connection.recv()
        except EOFError as error:
            raise EnfiladeError(
                f"the process of {note.parent.name} ended before its work; what it said is above, unless "
                "memory was short and it was killed. The same command goes on where it stopped"
            ) from error
        if kind == "failed":
            raise arguments[0]
        if kind == "done" or time.monotonic() - noted > NOTED_EVERY_S:
            write_json(note, spent.to_dict())
            noted = time.monotonic()
        if kind == "done":
            return
        getattr(monitor, kind)(*arguments)


def _run(connection: Connection, device: Choice, task: bytes, folder: Path) -> None:
    """The life of a contestant's process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the bench hears it, and ends this process
    meter = _Meter(connection)
    try:
        if note := activate(device).note:  # before the task brings the modules that bind Dr.Jit's types
            meter.tell("say", f"rendered on the CPU: {note}")
        work = pickle.loads(task)  # noqa: S301  (our own, from our own process)
        work.warm_up()
        work.run(folder, meter)
    except (EnfiladeError, OSError, MemoryError) as error:
        meter.tell("failed", error)
    else:
        meter.tell("done")
    connection.close()


class _Meter:
    """A monitor that passes on what it hears, with what was spent so far by stage."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._stages: dict[str, tuple[float, float]] = {}
        self._now = START
        self._since = (0.0, time.perf_counter())  # all CPU time of this process is the start's

    def stage(self, name: str, total: int) -> None:
        """Begin to count for a stage."""
        self.tell("stage", name, total)
        self._now = name

    def advance(self, count: int = 1) -> None:
        """Pass it on."""
        self.tell("advance", count)

    def extend(self, count: int) -> None:
        """Pass it on."""
        self.tell("extend", count)

    def say(self, text: str) -> None:
        """Pass it on."""
        self.tell("say", text)

    def tell(self, kind: str, *arguments: Any) -> None:
        """Send one message; the process ends here when nobody listens any more."""
        now = _cpu_s(), time.perf_counter()
        cpu, wall = self._stages.get(self._now, (0.0, 0.0))
        self._stages[self._now] = cpu + now[0] - self._since[0], wall + now[1] - self._since[1]
        self._since = now
        try:
            self._connection.send((kind, arguments, Spent(dict(self._stages), _peak_bytes(), 1)))
        except BrokenPipeError as error:
            raise SystemExit(1) from error  # the bench was killed: this process has nothing to say to anybody


def _cpu_s() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(of.ru_utime + of.ru_stime for of in used)


def _peak_bytes() -> int:
    # Not ru_maxrss: Linux hands a new process the peak of the one that started it.
    status = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
    match = re.search(r"VmHWM:\s+(\d+) kB", status)
    return int(match[1]) * 1024 if match else resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
