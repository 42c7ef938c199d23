"""A worker of units that only pretend: each leaves a file, and does what its facts ask for before."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

from enfilade.errors import DamagedFileError, NoSpaceError, SettingsError


def open_toy(spec, tell):
    folder = Path(spec["folder"])
    if spec.get("refuses"):
        raise SettingsError("no such scene")

    def attempt(name):
        with (folder / f"{name}.tries").open("a") as tries:
            tries.write(f"{spec['share']} {os.getpid()}\n")
        return len((folder / f"{name}.tries").read_text().splitlines())

    def do(kind, facts):
        count = attempt(facts["name"])
        if count <= facts.get("times", 99):
            if kind == "lies":
                return
            fail(kind)
        time.sleep(facts.get("seconds", 0.0))
        (folder / facts["name"]).write_text("x")
        tell("line", {"unit": facts["name"]})

    return do


def fail(kind):
    match kind:
        case "killed":
            os.write(1, b"last words\n")
            os.kill(os.getpid(), signal.SIGKILL)
        case "exits":
            os._exit(7)
        case "raises":
            raise ZeroDivisionError("by nought")
        case "starves":
            raise MemoryError
        case "damaged":
            raise DamagedFileError("it is damaged", "raw/0001.exr")
        case "full":
            raise NoSpaceError("no room")
        case "hangs":
            time.sleep(600)
