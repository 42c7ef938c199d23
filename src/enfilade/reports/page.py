"""The report of a run: one HTML page that needs neither other files nor a network."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from enfilade import __version__
from enfilade.errors import SettingsError
from enfilade.files import whole_file
from enfilade.images.view import open_view
from enfilade.monitor import SILENCE, Monitor
from enfilade.reports.contents import contents
from enfilade.reports.film import Film
from enfilade.reports.run import ReportedRun
from enfilade.runs.folder import RunFolder
from enfilade.runs.identity import RUN_FILE
from enfilade.runs.statistics import statistics

PAGE = "report.html"  # in a run folder
MB = 1_000_000
LEAST_MB = 1.0
TEMPLATES = "templates"


def write_report(
    run: Path,
    *,
    reference: Path | str | None = None,
    second_reference: Path | str | None = None,
    out: Path | str | None = None,
    max_mb: float = 30.0,
    monitor: Monitor = SILENCE,
) -> Path:
    """Write a finished or running run as one HTML page.

    The run is only read, and nothing is rendered. A running run is shown as far as it is finished.

    Parameters
    ----------
    run
        The run folder.
    reference
        Another run, or a sequence, of the same frames: adds the visible difference, that of
        :func:`enfilade.compare` with the viewing conditions of the run, once all frames are finished.
    second_reference
        As of :func:`enfilade.compare`; it needs a reference.
    out
        The page; by default ``report.html`` in the run folder. An older one is replaced.
    max_mb
        Megabytes of pictures: larger ones are scaled, then frames are left out. At least 1.
    monitor
        Receives progress, and the notes of the page: damage, omissions, and remarks on the comparison.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    RunFolderError
        It is no run folder, or is damaged; or the page can't be written.
    ImageError
        The run and the reference can't be compared.
    SettingsError
        `max_mb` is out of range, a second reference is given alone, or the OpenColorIO view of the video is
        not available.
    """
    if not max_mb >= LEAST_MB:
        raise SettingsError(f"a page of {max_mb:g} MB is too small; give {LEAST_MB:g} or more")
    if second_reference is not None and reference is None:
        raise SettingsError("--second-reference is given alone; give the first one as --reference")
    source = None if reference is None else Path(reference)
    second = None if second_reference is None else Path(second_reference)
    references = tuple(of for of in (source, second) if of is not None)
    shown = ReportedRun(run)
    view = open_view(shown.video, shown.viewing_settings.exposure_ev)
    film = Film(shown, view, references, max_mb * MB, monitor)
    notes = [*shown.notes, *film.notes]
    if dropped := shown.summary["dropped_samples"]:
        notes.append(f"{dropped} samples were NaN or infinite and were left out")
    for note in notes:
        monitor.message(note)
    variables = contents(shown, film, None if source is None else _summary(source))
    compared = () if film.difference is None else references
    variables |= {"notes": notes, "references": [str(of.resolve()) for of in compared]}
    file = run / PAGE if out is None else Path(out)
    write_page(file, "report", variables)
    return file


def write_page(file: Path, name: str, variables: Mapping[str, Any]) -> None:
    """Write a page from a template, ``NAME.html.j2``, with ``report.css`` and ``NAME.js`` inside.

    Parameters
    ----------
    file
    name
    variables
        Of the template; ``parts`` and ``version`` are added. ``data`` becomes JSON for the script.

    Raises
    ------
    RunFolderError, NoSpaceError
        The file can't be written.
    """
    folder = files("enfilade.reports") / TEMPLATES
    parts = {part: (folder / part).read_text() for part in ("report.css", f"{name}.js")}
    template = _environment().get_template(f"{name}.html.j2")
    data = json.dumps(variables["data"]).replace("<", "\\u003c")
    text = template.render({**variables, "data": data}, parts=parts, version=__version__)
    with whole_file(file) as beside:
        beside.write_text(text, encoding="utf-8")


def _summary(reference: Path) -> dict[str, Any] | None:
    return statistics(RunFolder.read(reference)) if (reference / RUN_FILE).is_file() else None


def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("enfilade.reports", TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
