"""``enfilade report``: a run as one HTML page."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import click

from enfilade.cli.group import debug_option
from enfilade.cli.inputs import quiet_option
from enfilade.errors import SettingsError

PAGE = "report.html"


@click.command("report", short_help="A run as one HTML page: frames, layers, charts, tables.")
@click.argument("run", type=click.Path(path_type=Path))
@click.option(
    "--out",
    "file",
    type=click.Path(path_type=Path, dir_okay=False),
    help=f"The page.  [default: {PAGE} in the run folder]",
)
@click.option(
    "--reference",
    type=click.Path(path_type=Path),
    help="A run of the same path, traced whole: its differences are shown, and judged by the metric.",
)
@click.option(
    "--metric/--no-metric",
    "has_metric",
    default=True,
    show_default=True,
    help="Whether the metric judges each frame beside the reference, which doubles the time.",
)
@click.option(
    "--frames",
    metavar="RANGES",
    help="Frames to put on the page: 1-250, 1,5,9 or 1-250:2.  [default: all that are there]",
)
@click.option(
    "--max-mb",
    type=float,
    default=30.0,
    show_default=True,
    help="Size that the page keeps to where it can: pictures are scaled, then frames left out. At least 8.",
)
@click.option(
    "--serve",
    "is_served",
    is_flag=True,
    help="Show it to browsers of this machine and follow the run, until interrupted; nothing is written.",
)
@click.option(
    "--port", type=click.IntRange(0, 65535), default=0, help="Port of --serve.  [default: any that is free]"
)
@quiet_option
@debug_option
def command(
    *,
    run: Path,
    file: Path | None,
    reference: Path | None,
    has_metric: bool,
    frames: str | None,
    max_mb: float,
    is_served: bool,
    port: int,
    quiet: bool,
) -> None:
    """Write a page about the finished or running run in the folder RUN.

    The page is one file that needs no network. A running run is shown as far as it has come; it is not
    disturbed, and nothing is rendered.
    """
    if is_served and file is not None:
        raise SettingsError("--out says nothing to --serve, which writes no page; leave one of them out")
    if port and not is_served:
        raise SettingsError("--port says nothing without --serve; add that, or leave it out")
    from enfilade.camera import parse_frames
    from enfilade.cli.progress import watch
    from enfilade.reports.page import Wishes, write_page

    numbers = None if frames is None else parse_frames(frames)
    page = run / PAGE if file is None else file
    wishes = Wishes(reference, numbers, max_mb, has_metric)
    if is_served:
        _serve(run, wishes, port, quiet=quiet)
        return
    with watch(quiet=quiet) as monitor:
        notes = write_page(run, page, wishes, monitor)
    for note in notes:
        click.echo(f"note    {note}", err=True)
    click.echo(f"report  {page}")


def _serve(run: Path, wishes: Any, port: int, *, quiet: bool) -> None:
    from enfilade.cli.progress import watch
    from enfilade.reports.live import Live

    with watch(quiet=quiet) as monitor:
        live = Live(run, wishes, port, monitor=monitor)
    with live:
        click.echo(f"report  {live.address}")
        with contextlib.suppress(KeyboardInterrupt):
            live.wait()
