"""The report of a run: one HTML page that needs nothing else, neither files nor a network.

The owner of Jinja2 and of Plotly.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from enfilade import __version__
from enfilade.errors import SettingsError
from enfilade.files import whole_file
from enfilade.images.view import View, open_view
from enfilade.monitor import Monitor
from enfilade.reports.against import Against
from enfilade.reports.contents import contents
from enfilade.reports.film import Film, encode_film
from enfilade.reports.layers import LAYERS
from enfilade.reports.seen import SeenRun
from enfilade.reports.tables import percent, seconds

__all__ = ["LEAST_MB", "Wishes", "write_page"]

MB = 1_000_000
LEAST_MB = 8.0  # plotly.js alone is 5
TEMPLATES = "templates"


@dataclass(frozen=True)
class Wishes:
    """What a page shall hold.

    Attributes
    ----------
    reference : Path or None
        Run folder of a reference.
    numbers : tuple of int or None
        Of the frames that may be on the page; None: all that are there.
    max_mb : float
        Megabytes that the page should not exceed; 8 or more.
    has_metric : bool
        Whether the metric judges the frames beside the reference.
    """

    reference: Path | None = None
    numbers: tuple[int, ...] | None = None
    max_mb: float = 30.0
    has_metric: bool = True


def write_page(folder: Path, file: Path, wishes: Wishes, monitor: Monitor) -> list[str]:
    """Write the report of a finished or a running run.

    The run is only read: its ledger when this is called, and the frames that are finished then. It is
    not locked, and nothing is rendered.

    Parameters
    ----------
    folder
        The run.
    file
        The page; one that stands there is replaced.
    wishes
    monitor

    Returns
    -------
    list of str
        The notes on the page: what is odd, damaged or left out.

    Raises
    ------
    RunFolderError
        It is no run folder, is damaged, or of a version that kept other facts; the reference does not
        fit; the page can't be written.
    SettingsError
        The wishes: fewer megabytes than a page needs, or frames that the run doesn't have.
    """
    if not wishes.max_mb >= LEAST_MB:
        raise SettingsError(f"a page of {wishes.max_mb:g} MB: give {LEAST_MB:g} or more")
    seen = SeenRun(folder)
    wanted = _wanted(seen, wishes.numbers)
    reference = None if wishes.reference is None else SeenRun(wishes.reference)
    against = None if reference is None else Against(seen, reference, has_metric=wishes.has_metric)
    view, view_notes = _view(seen)
    parts = {name: _part(name) for name in ("report.css", "report.js")} | {"plotly": _plotly()}
    used = sum(len(part) for part in parts.values()) + 2000 * len(seen.numbers)
    film = encode_film(seen, wanted, against, view, monitor, room_bytes=max(wishes.max_mb * MB - used, MB))
    notes = [
        *seen.notes,
        *view_notes,
        *(against.notes if against else []),
        *film.notes,
        *_missing(film),
    ]
    if dropped := seen.figures["dropped_samples"]:
        notes.append(f"{dropped} samples were NaN or infinite and were left out")
    template = _environment().get_template("report.html.j2")
    said = {**contents(seen, reference, film), "parts": parts, "version": __version__}
    text = template.render(said, notes=notes)
    if (size := len(text.encode())) > wishes.max_mb * MB:
        notes.append(
            f"the page has {size / MB:.1f} MB, more than the {wishes.max_mb:g} that --max-mb asks for: "
            "charts and tables show all frames, and one frame stays in the player"
        )
        text = template.render(said, notes=notes)
    with whole_file(file) as beside:
        beside.write_text(text, encoding="utf-8")
    return notes


def _wanted(seen: SeenRun, numbers: tuple[int, ...] | None) -> list[int]:
    if numbers is None:
        return list(seen.there)
    if unknown := sorted(set(numbers) - set(seen.numbers)):
        raise SettingsError(
            f"{seen.run.folder} has no frame {unknown[0]}; it has {seen.numbers[0]} to {seen.numbers[-1]}"
        )
    return [i for i in seen.there if seen.numbers[i] in numbers]


def _view(seen: SeenRun) -> tuple[View, list[str]]:
    try:
        return open_view(seen.video, seen.exposure_ev), []
    except SettingsError as error:
        plain = open_view(type(seen.video)(), seen.exposure_ev)
        return plain, [f"shown with the sRGB view, not that of the run: {error}"]


def _missing(film: Film) -> list[str]:
    if not film.frames:
        return []
    notes = []
    if "visible" not in film.layers:
        notes.append(
            "no map of probability: a run keeps what the metric said of each segment, not its maps; "
            "with --reference it judges the finished frames"
        )
    incomplete = [
        layer.title for layer in LAYERS if layer.name in film.layers and not film.has_all(layer.name)
    ]
    if incomplete:
        notes.append(f"not every frame has the layers: {', '.join(incomplete)}")
    return notes


def _environment() -> Environment:
    made = Environment(
        loader=PackageLoader("enfilade.reports", TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters["breakable"] = _breakable
    made.filters["percent"] = percent
    made.filters["seconds"] = seconds
    return made


def _breakable(name: str) -> Markup:
    """Let a long name be broken after what separates its words."""
    return Markup("<wbr>").join(re.split(r"(?<=[_.-])", name))


def _part(name: str) -> str:
    return (files("enfilade.reports") / TEMPLATES / name).read_text(encoding="utf-8")


def _plotly() -> str:
    from plotly.offline import get_plotlyjs

    text: str = get_plotlyjs()
    return text
