"""Runner of the case studies: measures each item once for each scene."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from enfilade.monitor import Monitor
from studies.cases import (
    SCENES,
    placement,
    refinement,
    reflections,
    separation,
    statistics,
    supports,
    threshold,
    times,
)
from studies.cases.case import Case, Result, open_folder, read_result
from studies.cases.extent import Extent

Results = Mapping[str, Mapping[str, Result]]  # by item and scene

ITEMS: dict[str, Callable[[Case], Any]] = {  # in the order of the paper's figures and tables
    "placement": placement.measure,
    "statistics": statistics.measure,
    "refinement": refinement.measure,
    "shares": statistics.shares,
    "times": times.measure,
    "threshold": threshold.measure,
    "supports": supports.measure,
    "separation": separation.measure,
    "reflections": reflections.measure,
}


def measure(
    scenes: Sequence[str], items: Sequence[str], extent: Extent, folder: Path, monitor: Monitor
) -> Results:
    """Measure items of scenes that are not measured yet.

    Parameters
    ----------
    scenes
        Of ``room`` and ``atrium``.
    items
        Of :data:`ITEMS`.
    extent
    folder
        Receives a folder for each scene. After an interruption the same call continues: walkthroughs at
        their first missing frame, other items at their beginning, with the frames traced so far.
    monitor

    Returns
    -------
    dict
        All results in the folder, also of earlier calls.

    Raises
    ------
    RunFolderError
        The folder holds results of another extent.
    """
    open_folder(folder, extent)
    for scene in scenes:
        case = Case(scene, extent, folder / scene, monitor)
        for item in items:
            case.result(item, partial(ITEMS[item], case))
    return {
        item: {s: read_result(file) for s in SCENES if (file := folder / s / f"{item}.json").is_file()}
        for item in ITEMS
    }
