"""All case studies: each item measured once a scene."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from enfilade.monitor import Monitor
from studies.cases import placement, reflections, separation, statistics, supports, threshold, times
from studies.cases.case import Case, Result, begin, read_result
from studies.cases.terms import Terms
from studies.scenes import SCENES

Results = Mapping[str, Mapping[str, Result]]  # by item and scene

ITEMS: dict[str, Callable[[Case], Any]] = {  # in the order of the paper's figures and tables
    "placement": placement.measure,
    "statistics": statistics.measure,
    "shares": statistics.shares,
    "times": times.measure,
    "threshold": threshold.measure,
    "supports": supports.measure,
    "separation": separation.measure,
    "reflections": reflections.measure,
}


def measure(
    scenes: Sequence[str], items: Sequence[str], terms: Terms, folder: Path, monitor: Monitor
) -> Results:
    """Measure some items of some scenes, unless they were measured before.

    Parameters
    ----------
    scenes
        Of ``room`` and ``atrium``.
    items
        Of :data:`ITEMS`.
    terms
    folder
        Gets a folder for each scene. Killed anywhere, the same call continues: whole walkthroughs at their
        first missing frame, other items at their beginning, with the frames that they have traced.
    monitor

    Returns
    -------
    dict
        All results in the folder, also of earlier calls.

    Raises
    ------
    RunFolderError
        The folder holds results on other terms.
    """
    begin(folder, terms)
    for scene in scenes:
        case = Case(scene, terms, folder / scene, monitor)
        for item in items:
            case.result(item, partial(ITEMS[item], case))
    return {
        item: {s: read_result(file) for s in SCENES if (file := folder / s / f"{item}.json").is_file()}
        for item in ITEMS
    }
