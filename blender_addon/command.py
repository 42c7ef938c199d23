# SPDX-License-Identifier: GPL-3.0-or-later
"""The command ``enfilade`` as a process: its line, its progress, its end. Nothing here needs Blender."""

from __future__ import annotations

import json
import queue
import re
import subprocess
import textwrap
import threading
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import IO

STEP = re.compile(r"^(.+): (\d+)/(\d+)")  # such as "shading: 3/24, 0:12 passed"
STAGE = re.compile(r"^(.+): (\d+) to do$")
KEPT = 40  # lines of output


@dataclass(frozen=True)
class Order:
    """What is rendered.

    Attributes
    ----------
    command : str
        The program ``enfilade``.
    source, run : Path
        The .blend file, and the run folder.
    quality : float
    scene : str
    blender : str
        This Blender, which imports the file; empty: the one that enfilade finds.
    """

    command: str
    source: Path
    run: Path
    quality: float
    scene: str
    blender: str = ""

    def line(self) -> list[str]:
        """The command line; names are quoted as TOML, which has no escapes of surrogates."""
        chosen = {"blender.scene": self.scene, "blender.program": self.blender}
        settings = [
            part
            for key, value in chosen.items()
            if value
            for part in ("--set", f"{key}={json.dumps(value, ensure_ascii=False)}")
        ]
        files = [str(self.source), "--out", str(self.run)]
        return [self.command, "render", *files, "--quality", f"{self.quality:g}", *settings]


class Process:
    """A command that runs in the background; :meth:`poll` is called now and then.

    Parameters
    ----------
    line

    Attributes
    ----------
    stage : str
        Of the work.
    fraction : float
        Of the stage that is done.
    code : int or None
        Exit code; None while it runs.
    last : list of str
        Last lines of the output.

    Raises
    ------
    OSError
        There is no such program.
    """

    def __init__(self, line: list[str]) -> None:
        self.stage, self.fraction = "starting", 0.0
        self.code: int | None = None
        self.last: list[str] = []
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._process = subprocess.Popen(  # noqa: S603
            line, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            errors="replace", start_new_session=True,
        )  # fmt: skip
        self._reader = threading.Thread(target=self._read, args=(self._process.stdout,), daemon=True)
        self._reader.start()

    def _read(self, stream: IO[str] | None) -> None:
        with stream or nullcontext(()) as lines:
            for line in lines:
                self._lines.put(line.rstrip())

    def poll(self) -> None:
        """Take the output since the last call."""
        code = self._process.poll()
        if code is not None:
            self._reader.join()
        while not self._lines.empty():
            self._take(self._lines.get())
        self.code = code

    def _take(self, line: str) -> None:
        if step := STEP.match(line):
            self.stage, self.fraction = step[1], int(step[2]) / max(int(step[3]), 1)
        elif stage := STAGE.match(line):
            self.stage, self.fraction = stage[1], 0.0
        self.last = [*self.last, line][-KEPT:]

    def end(self) -> None:
        """End it: finished frames stay, and the same order continues."""
        self._process.terminate()

    @property
    def message(self) -> str:
        """The error of a failed command, with its reason and remedy; without one the last line."""
        starts = [number for number, line in enumerate(self.last) if line.startswith("Error: ")]
        lines = self.last[starts[-1] if starts else -1 :] or ["no output"]
        return "\n".join(lines).removeprefix("Error: ")


def wrapped(message: str, width: int) -> list[str]:
    """Lines of a message of at most a number of letters."""
    return [part for line in message.splitlines() for part in textwrap.wrap(line, max(width, 20))]


def next_run(folder: Path) -> Path:
    """A run folder that does not exist: the same, or one of the same name with a number."""
    stem, number, found = re.sub(r" \d+$", "", folder.name), 1, folder
    while found.exists():
        number += 1
        found = folder.with_name(f"{stem} {number}")
    return found
