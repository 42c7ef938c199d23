"""How long a unit may take, and how a worker that hangs is told from one that works."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Limits", "Watch", "span"]

LOOK_S = 5.0  # between two looks at the workers
TOLD_S = 180.0  # without CPU time, after which it is said; again after twice as long
LIFE_S = 0.05  # of CPU time: a sign of life. Threads that do nothing but wake up now and then use less
TICKS_PER_S = os.sysconf("SC_CLK_TCK")
STATES = {
    "D": "it waits for a disk that does not answer",
    "T": "it is stopped",
    "t": "a debugger holds it",
    "S": "it sleeps",
}


@dataclass(frozen=True)
class Limits:
    """When a worker is ended, which counts as its death.

    Attributes
    ----------
    unit_s : float
        Longest time for a unit, in seconds; 0: no limit.
    idle_s : float
        Longest time in which the worker uses no CPU time, in seconds; 0: no limit.
    """

    unit_s: float = 0.0
    idle_s: float = 600.0

    @property
    def look_s(self) -> float:
        """Seconds between two looks: so few that no limit is missed by much."""
        return min([LOOK_S, *(limit / 4 for limit in (self.unit_s, self.idle_s) if limit)])


class Watch:
    """A unit in a worker's hand: how long it has been there, and how long its worker has done nothing.

    The CPU time is the kernel's, so that a kernel of Dr.Jit that lets no other thread speak is work, and
    a thread that only speaks is none. Time counts while the process that looks runs itself: a machine that
    is suspended, or a command that is stopped as a whole, ends no worker.

    Parameters
    ----------
    limits
    pid
        The worker, a process of this machine. None: one elsewhere, of which only the time is known.
    """

    def __init__(self, limits: Limits, pid: int | None = None) -> None:
        self._limits = limits
        self._pid = pid
        self._looked = time.monotonic()
        self._cpu_s = 0.0 if pid is None else _cpu_of(pid)[0]
        self._state = ""
        self._told_s = TOLD_S
        self.in_hand_s = 0.0
        self.idle_s = 0.0

    def hear(self) -> None:
        """Take note that the worker has said something."""
        self.idle_s = 0.0

    def look(self) -> None:
        """Look at the clock and at the worker; to be called every `look_s` of its limits."""
        now = time.monotonic()
        passed = min(now - self._looked, 2 * self._limits.look_s)
        self._looked = now
        self.in_hand_s += passed
        if self._pid is None:
            return
        cpu_s, self._state = _cpu_of(self._pid)
        # One that is ready to run and gets no CPU does not hang: others keep the machine busy.
        if self._state == "R" or cpu_s - self._cpu_s >= LIFE_S:
            self._cpu_s, self.idle_s, self._told_s = cpu_s, 0.0, TOLD_S
        else:
            self.idle_s += passed

    def news(self) -> str | None:
        """What is to be said of a worker that does nothing, each time that this has taken twice as long."""
        if self.idle_s < self._told_s:
            return None
        self._told_s *= 2
        limit = self._limits.idle_s
        after = f"; it is ended after {span(limit)}" if limit else ""
        return (
            f"its worker, process {self._pid}, has done nothing for {span(self.idle_s)}{self._why()}{after}"
        )

    def verdict(self) -> str | None:
        """Why its worker is to be ended; None as long as it is not."""
        if 0 < self._limits.idle_s <= self.idle_s:
            return f"its worker had done nothing for {span(self.idle_s)}{self._why()} and was ended"
        if 0 < self._limits.unit_s <= self.in_hand_s:
            return f"its worker was ended after {span(self.in_hand_s)}, which is the limit for a unit"
        return None

    def _why(self) -> str:
        return f" ({STATES[self._state]})" if self._state in STATES else ""


def span(seconds: float) -> str:
    """A time as it is read: ``40 s``, ``10 minutes``."""
    return f"{seconds:.3g} s" if seconds < 120 else f"{seconds / 60:.3g} minutes"


def _cpu_of(pid: int) -> tuple[float, str]:
    """CPU seconds of all threads of a process, and what it does, as proc(5) has it; 0 of one that is gone."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0, ""
    return (int(fields[11]) + int(fields[12])) / TICKS_PER_S, fields[0]
