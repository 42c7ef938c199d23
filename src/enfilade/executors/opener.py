"""An executor by its name."""

from __future__ import annotations

import os
from pathlib import Path

from enfilade.errors import SettingsError
from enfilade.executors.executor import Executor, Hear, Recipe

EXECUTORS = ("in-process", "processes", "ray", "ray:ADDRESS")


def check_executor(name: str) -> None:
    """Refuse a name that no executor has.

    Raises
    ------
    SettingsError
    """
    if name not in EXECUTORS[:3] and not name.startswith("ray:"):
        raise SettingsError(f"there is no executor {name!r}; choose one of {', '.join(EXECUTORS)}")


def open_executor(name: str, recipe: Recipe, hear: Hear, *, workers: int | None, logs: Path) -> Executor:
    """Open an executor.

    Parameters
    ----------
    name
        One of :data:`EXECUTORS`.
    recipe
        How its workers are made.
    hear
        Takes their reports, each with its unit.
    workers
        How many; None: one for each CPU core. One in process, whatever is asked.
    logs
        Folder for what worker processes print.

    Raises
    ------
    SettingsError
        An unknown name.
    EnfiladeError
        Ray is not there.
    """
    check_executor(name)
    match name.partition(":"):
        case ("in-process", _, _):
            from enfilade.executors.inprocess import InProcess

            return InProcess(recipe, hear)
        case ("processes", _, _):
            from enfilade.executors.processes import Processes

            count = workers or len(os.sched_getaffinity(0))
            return Processes(recipe, hear, workers=count, logs=logs)
        case (_, _, address):
            from enfilade.executors.cluster import Cluster

            return Cluster(recipe, hear, workers=workers, address=address)
