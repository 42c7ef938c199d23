"""The page of ``enfilade import --check``: Cycles beside the imported scene, object by object."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.comparison.objects import ObjectDifference, compare_objects
from enfilade.images.stills import embedded, to_bytes
from enfilade.images.view import ViewTransform, open_view
from enfilade.records import F32, U8, U32
from enfilade.reports.page import write_page
from enfilade.reports.tables import seconds
from enfilade.runs.fidelity import CheckedFrame, ImportCheck
from enfilade.scene.blender.imported import CHECK_PAGE, ImportedScene
from enfilade.scene.blender.notes import TITLES, grouped
from enfilade.settings import Settings, VideoSettings, ViewingSettings

LISTED = 40  # objects


def differences_of(check: ImportCheck) -> list[ObjectDifference]:
    """Everything first, then objects, that with the largest difference of colour first."""
    cycles, imported = (
        [np.stack(half) for half in zip(*halves, strict=True)]
        for halves in ([of.cycles for of in check.frames], [of.imported for of in check.frames])
    )
    return compare_objects(cycles, imported, np.stack([of.shape_index for of in check.frames]), check.names)


def write_check(imported: ImportedScene, check: ImportCheck, differences: Sequence[ObjectDifference]) -> Path:
    """Write the page into the scene folder.

    Parameters
    ----------
    imported
    check
    differences
        See :func:`differences_of`.

    Returns
    -------
    Path

    Raises
    ------
    SettingsError
        The view of the file is not available.
    RunFolderError, NoSpaceError
        The page can't be written.
    """
    settings = Settings.from_tables(imported.tables_under({}))
    view = open_view(settings[VideoSettings], settings[ViewingSettings].exposure_ev)
    everything, *objects = differences
    listed = objects[:LISTED]
    frames = [_frame(of, view) for of in check.frames]
    boxes = [[_box(of.shape_index, object_.shape_index) for of in check.frames] for object_ in listed]
    height, width = check.frames[0].shape_index.shape
    notes = grouped(imported.notes)
    variables = {
        "imported": imported,
        "view_name": settings[VideoSettings].view or "sRGB",
        "spp": check.spp,
        "size": (width, height),
        "numbers": [of.number for of in check.frames],
        "everything": everything,
        "objects": listed,
        "left_out": len(objects) - len(listed),
        "costs": [
            (name, seconds(of.wall_s), seconds(of.cpu_s))
            for name, of in (("Cycles", check.cycles), ("Mitsuba", check.imported))
        ],
        "notes": [(TITLES[group.kind], group) for group in notes],
        "data": {"frames": frames, "boxes": boxes},
    }
    file = imported.folder / CHECK_PAGE
    write_page(file, "check", variables)
    return file


def _frame(of: CheckedFrame, view: ViewTransform) -> dict[str, Any]:
    """Both pictures, and the map of their difference."""
    pictures = [_displayed(halves, view) for halves in (of.cycles, of.imported)]
    difference = np.abs(pictures[0].astype(np.int16) - pictures[1]).astype(np.uint8)
    named = zip(("cycles", "imported", "difference"), (*pictures, difference), strict=True)
    return {"number": of.number, **{name: embedded(picture) for name, picture in named}}


def _displayed(halves: tuple[F32, F32], view: ViewTransform) -> U8:
    return to_bytes(view.encode((halves[0] + halves[1]) * np.float32(0.5)))


def _box(index: U32, number: int) -> list[float] | None:
    """Left, top, width and height of an object, percent of the picture; None where it is not."""
    rows, columns = np.nonzero(index == number)
    if not len(rows):
        return None
    height, width = index.shape
    left, top = columns.min() / width, rows.min() / height
    sides = (columns.max() + 1) / width - left, (rows.max() + 1) / height - top
    return [round(100.0 * float(side), 2) for side in (left, top, *sides)]
