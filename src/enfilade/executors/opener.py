"""An executor by its name."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from enfilade.errors import SettingsError
from enfilade.executors.executor import Executor, Hear, Recipe
from enfilade.executors.resources import cores, gpus
from enfilade.executors.watch import Limits

EXECUTORS = ("in-process", "processes", "ray", "ray:ADDRESS")
TERMS = ("idle", "unit")  # what may follow a name


def check_executor(name: str) -> None:
    """Refuse a name that no executor has.

    Raises
    ------
    SettingsError
    """
    _parsed(name)


def open_executor(name: str, recipe: Recipe, hear: Hear, *, workers: int | None, logs: Path) -> Executor:
    """Open an executor.

    Parameters
    ----------
    name
        One of :data:`EXECUTORS`. But for the first, limits may follow: ``processes,idle=30,unit=90`` ends a
        worker that uses no CPU time for 30 minutes (10, unless it is said), or takes more than 90 for a
        unit (no limit, unless it is said). 0: no limit.
    recipe
        How its workers are made.
    hear
        Takes their reports, each with its unit.
    workers
        How many; None: one for each GPU where they need one, else one for each CPU core that this process may
        use. On a cluster: for each that it has. One in process, whatever is asked.
    logs
        Folder for what worker processes print.

    Raises
    ------
    SettingsError
        An unknown name.
    EnfiladeError
        Ray is not there.
    """
    who, limits = _parsed(name)
    match who.partition(":"):
        case ("in-process", _, _):
            from enfilade.executors.inprocess import InProcess

            return InProcess(recipe, hear)
        case ("processes", _, _):
            from enfilade.executors.processes import Processes

            shared = gpus() if recipe.needs_gpu else []
            count = workers or (max(len(shared), 1) if recipe.needs_gpu else cores())
            threads = recipe.threads or max(cores() // count, 1)
            recipe = replace(recipe, spec={**recipe.spec, "threads": threads})
            return Processes(recipe, hear, workers=count, logs=logs, limits=limits, gpus=shared)
        case (_, _, address):
            from enfilade.executors.cluster import Cluster

            return Cluster(recipe, hear, workers=workers, address=address, logs=logs, limits=limits)


def _parsed(name: str) -> tuple[str, Limits]:
    who, *terms = name.split(",")
    if who not in EXECUTORS[:3] and not who.startswith("ray:"):
        raise SettingsError(f"there is no executor {who!r}; choose one of {', '.join(EXECUTORS)}")
    if who == "ray:":
        raise SettingsError(f"{who} lacks the address of a cluster; ray:HOST:PORT joins one, ray starts one")
    if terms and who == EXECUTORS[0]:
        raise SettingsError(f"{name!r}: in-process has no worker to end; choose another executor for limits")
    limits: dict[str, float] = {}
    for term in terms:
        key, _, value = term.partition("=")
        if key not in TERMS or (minutes := _minutes(value)) is None:
            raise SettingsError(f"{term!r} after {who} is no limit; write idle=MINUTES or unit=MINUTES")
        limits[f"{key}_s"] = 60.0 * minutes
    return who, Limits(**limits)


def _minutes(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if 0 <= value < math.inf else None
