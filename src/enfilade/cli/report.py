"""``enfilade report``: a run as one HTML page."""

from __future__ import annotations

from pathlib import Path

import click

from enfilade.cli.group import debug_option
from enfilade.cli.options import quiet_option

PAGE = "report.html"


@click.command("report", short_help="A run as one HTML page: frames, charts, tables.")
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
    help="A run of the same path by --method reference: the visible difference is shown.",
)
@click.option(
    "--frames", metavar="RANGES", help="Frames on the page: 1-250, 1,5,9 or 1-250:2.  [default: all]"
)
@click.option("--max-mb", type=float, default=30.0, show_default=True, help="Largest size of the page, MB.")
@quiet_option
@debug_option
def command(*, run: Path, file: Path | None, reference: Path | None, max_mb: float, quiet: bool) -> None:
    """Write a page about the finished or running run in the folder RUN.

    The page is one file that needs no network.
    """
    from enfilade.cli.progress import watch
    from enfilade.reports.page import write_report

    with watch(quiet=quiet) as monitor:
        page = write_report(run, reference=reference, out=file, max_mb=max_mb, monitor=monitor)
    click.echo(f"report  {page}")
