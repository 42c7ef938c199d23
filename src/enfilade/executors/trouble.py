"""Many failures in a row are the machine's, not the units': it is given time, and less is asked of it."""

from __future__ import annotations

import time

from enfilade.executors.executor import FailureKind

__all__ = ["MACHINE", "SMALLER", "Trouble"]

MACHINE = frozenset({FailureKind.DIED, FailureKind.MEMORY, FailureKind.IO, FailureKind.DEVICE})
SCARCE = frozenset({FailureKind.DIED, FailureKind.MEMORY})  # what fewer workers may help against
IN_A_ROW = 4  # failures of two units or more, with no success between
FIRST_PAUSE_S = 5.0  # twice as long each time
LONGEST_PAUSE_S = 300.0
PAUSES = 10  # in a row, 25 minutes in all: then it is given up
BUG_PAUSES = 4  # 75 s; where all failures are errors that nobody foresaw, a pause rarely helps
FEW = 3  # units of which a worker died or had too little memory: half as many are begun at once
STEADY = 20  # successes in a row: twice as many again, and with more memory
SMALLER = 4  # times less memory for a unit after each attempt that had too little


class Trouble:
    """Tells a machine in trouble from units that can't be done.

    After :data:`IN_A_ROW` failures of two units or more, with no success between, nothing is begun for a
    while, then one unit, to try; the first success ends the trouble. Failures meanwhile don't count.

    Parameters
    ----------
    slots
        How many units can be in hand at once.

    Attributes
    ----------
    slots : int
        How many should be now, when there is no trouble.
    share : int
        A unit may use one part in so many of the memory that it would use: what was enough for the last one
        that had had too little. After :data:`STEADY` successes in a row it is :data:`SMALLER` times as much.
    """

    def __init__(self, slots: int) -> None:
        self.slots = slots
        self.share = 1
        self._most = slots
        self._scarce: set[str] = set()
        self._steady = 0
        self._clear()

    @property
    def is_on(self) -> bool:
        """Whether all wait, or one is tried."""
        return self._pauses > 0

    @property
    def is_hopeless(self) -> bool:
        """Whether nothing has succeeded through all the pauses there are."""
        return self._pauses > (PAUSES if MACHINE & {kind for _, kind in self._row} else BUG_PAUSES)

    @property
    def left_s(self) -> float:
        """Seconds left of the pause."""
        return max(self._until - time.monotonic(), 0.0)

    def succeed(self, share: int = 1) -> None:
        """Take note of a success.

        Parameters
        ----------
        share
            What was enough for a unit that had had too little memory; 1: it never had.
        """
        self._clear()
        self._steady += 1
        if share > self.share:
            self.share, self._steady = share, 0
        if self._steady >= STEADY:
            self._steady = 0
            self._scarce.clear()
            self.slots = min(2 * self.slots, self._most)
            self.share = max(self.share // SMALLER, 1)

    def fail(self, name: str, kind: FailureKind, *, is_trial: bool) -> bool:
        """Take note of a failure; returns whether it counts against the unit.

        Parameters
        ----------
        name
        kind
        is_trial
            The unit was begun to learn whether the trouble is over.
        """
        self.ask_less(name, kind)
        if not self._row:
            self._since = time.monotonic()
        self._row.append((name, kind))
        was_on = self.is_on
        if (was_on and is_trial) or (not was_on and len(self._row) >= IN_A_ROW and len(self._names()) > 1):
            self._pauses += 1
            self._until = time.monotonic() + min(FIRST_PAUSE_S * 2.0 ** (self._pauses - 1), LONGEST_PAUSE_S)
        return not self.is_on

    def describe(self) -> str:
        """What has failed since the last success."""
        minutes = (time.monotonic() - self._since) / 60
        return f"{len(self._row)} attempts at {len(self._names())} units failed in {minutes:.1f} minutes"

    def ask_less(self, name: str, kind: FailureKind) -> None:
        """Take note of a failure that has a remedy: where memory is scarce, fewer are begun at once.

        Parameters
        ----------
        name
        kind
        """
        self._steady = 0
        if kind not in SCARCE:
            return
        self._scarce.add(name)
        if len(self._scarce) >= max(FEW, self.slots // 2):
            self._scarce.clear()
            self.slots = max(self.slots // 2, 1)

    def _names(self) -> set[str]:
        return {name for name, _ in self._row}

    def _clear(self) -> None:
        self._row: list[tuple[str, FailureKind]] = []
        self._pauses = 0
        self._until = self._since = 0.0
