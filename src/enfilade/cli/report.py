"""``enfilade report``: a run as one HTML page."""

from __future__ import annotations

from pathlib import Path

import click

from enfilade.cli.group import debug_option, ending_on_sigterm
from enfilade.cli.options import check_suffix, quiet_option


@click.command("report", short_help="A run as one HTML page: frames, layers, charts, tables.")
@click.argument("run", type=click.Path(path_type=Path))
@click.option(
    "--out",
    "file",
    type=click.Path(path_type=Path, dir_okay=False),
    help="The page.  [default: report.html in the run folder]",
)
@click.option(
    "--reference",
    type=click.Path(path_type=Path),
    help="A run or a sequence of the same frames: adds the visible difference.",
)
@click.option(
    "--second-reference",
    type=click.Path(path_type=Path),
    help="The reference rendered with another --seed: shows how much of the difference is their noise.",
)
@click.option(
    "--max-mb",
    type=float,
    default=30.0,
    show_default=True,
    help="Size of the pictures, about: larger ones are scaled, then frames are left out. At least 1.",
)
@quiet_option
@debug_option
def command(
    *,
    run: Path,
    file: Path | None,
    reference: Path | None,
    second_reference: Path | None,
    max_mb: float,
    quiet: bool,
) -> None:
    """Write the finished or running run in the folder RUN as one HTML page.

    The page needs neither other files nor a network. A running run is shown as far as it is finished.
    """
    check_suffix("--out", file, ".html")
    from enfilade.cli.progress import watch
    from enfilade.device import activate
    from enfilade.reports.page import write_report

    activate("auto")
    with ending_on_sigterm(), watch(quiet=quiet) as monitor:
        page = write_report(
            run,
            reference=reference,
            second_reference=second_reference,
            out=file,
            max_mb=max_mb,
            monitor=monitor,
        )
    click.echo(f"report  {page}")
