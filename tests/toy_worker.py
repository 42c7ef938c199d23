"""A worker of units that only pretend: each leaves a file, and does what its facts ask for before."""

from __future__ import annotations

import errno
import os
import signal
import time
from pathlib import Path

from enfilade.errors import DamagedFileError, DeviceError, NoSpaceError, RunFolderError, SettingsError
from enfilade.executors import Unit


def nothing(*reports):
    return ()


def unit(name, kind="fine", needs=(), **facts):
    return Unit(name, kind, {"name": name, **facts}, needs)


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
        if kind == "suffers" and (folder / "outage.now").exists():
            os.kill(os.getpid(), signal.SIGKILL)
        time.sleep(facts.get("seconds", 0.0))
        if "device" in spec:
            (folder / f"{facts['name']}.gpu").write_text(os.environ.get("CUDA_VISIBLE_DEVICES", ""))
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
        case "stops":
            os.kill(os.getpid(), signal.SIGSTOP)
        case "hangs":
            time.sleep(600)
        case "spins":
            end = time.process_time() + 2.5
            while time.process_time() < end:
                pass
        case "stale":
            raise RunFolderError("can't read it") from OSError(errno.ESTALE, "Stale file handle")
    if kind in ERRORS:
        raise ERRORS[kind]


ERRORS = {
    "raises": ZeroDivisionError("by nought"),
    "starves": MemoryError(),
    "deviceless": DeviceError("no GPU"),
    "damaged": DamagedFileError("it is damaged", "raw/0001.exr"),
    "full": NoSpaceError("no room"),
}
