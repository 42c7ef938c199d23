"""Tasks for processes of their own: importable there."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.errors import SceneError

SPIN_S = 0.3  # CPU seconds
HELD_MIB = 200


def spin(seconds: float) -> None:
    """Use CPU time."""
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


@dataclass(frozen=True)
class Spins:
    """Uses known CPU time in each of its stages, and sleeps in between."""

    def warm_up(self) -> None:
        spin(SPIN_S)

    def run(self, _folder: Path, monitor: Any) -> None:
        monitor.stage("frames", 2)
        for _ in range(2):
            spin(SPIN_S)
            monitor.advance()
        time.sleep(SPIN_S)
        monitor.stage("video", 1)
        spin(2 * SPIN_S)
        monitor.say("done")


@dataclass(frozen=True)
class Holds:
    """Touches memory."""

    def warm_up(self) -> None:
        pass

    def run(self, _folder: Path, monitor: Any) -> None:
        monitor.stage("frames", 1)
        assert np.ones(HELD_MIB << 17).sum() > 0.0


@dataclass(frozen=True)
class Dies:
    """Ends without a word."""

    def warm_up(self) -> None:
        pass

    def run(self, _folder: Path, _monitor: Any) -> None:
        os._exit(9)


@dataclass(frozen=True)
class Fails:
    """Raises what the user should read."""

    def warm_up(self) -> None:
        pass

    def run(self, _folder: Path, _monitor: Any) -> None:
        raise SceneError("no such scene")
