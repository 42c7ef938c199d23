"""How a worker begins in a process of its own: it chooses the device before anything binds to one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from enfilade.device import activate, load
from enfilade.executors.executor import Tell
from enfilade.executors.resources import cores


def open_worker(spec: Mapping[str, Any], tell: Tell) -> Any:
    """Open a worker in a process of its own, or in a Ray worker.

    Parameters
    ----------
    spec
        ``folder`` of the run; ``part``: the share of it that is worked on, None for all; ``device``: Dr.Jit's
        name of it; ``threads``, 0 for one a core; ``share``: see :meth:`~enfilade.executors.Recipe.make`.
    tell
        Takes reports: ``line`` with a line of the ledger, or a call of a monitor by its name.

    Returns
    -------
    callable
        Takes kind and facts of a unit, and does it.

    Raises
    ------
    RunFolderError
        Also where this host would render otherwise.
    DeviceError
    """
    activate("gpu" if spec["device"] == "cuda" else "cpu")
    load().set_thread_count(spec["threads"] or cores())
    from enfilade.pipeline.job import check_identity, read_job
    from enfilade.pipeline.worker import Worker, smaller
    from enfilade.store import Run

    folder = Path(spec["folder"])
    job = read_job(folder)
    run = Run.joining(folder, lambda line: tell("line", line), part=spec["part"])
    check_identity(job, run)
    return Worker(smaller(job, spec["share"]), run, Distant(tell)).do


class Distant:
    """A monitor elsewhere: what it is called with becomes reports."""

    def __init__(self, tell: Tell) -> None:
        self._tell = tell

    def stage(self, name: str, total: int) -> None:
        """Report it."""
        self._tell("stage", [name, total])

    def advance(self, count: int = 1) -> None:
        """Report it."""
        self._tell("advance", [count])

    def extend(self, count: int) -> None:
        """Report it."""
        self._tell("extend", [count])

    def say(self, text: str) -> None:
        """Report it."""
        self._tell("say", [text])
