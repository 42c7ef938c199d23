"""``python -m studies validate``: validation of the metric on observers."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from enfilade.cli.group import FAILURE, debug_option
from enfilade.cli.options import json_option, quiet_option

if TYPE_CHECKING:
    from rich.table import Table

    from studies.observers.validate import Validation

WIDTH = 132  # columns of the tables; a narrower terminal wraps their lines


@click.command("validate", short_help="Validate the metric on published experiments.")
@click.option(
    "--plots",
    "folder",
    type=click.Path(path_type=Path, file_okay=False),
    help="Draw a plot for each data set into this folder, as PNG.",
)
@json_option
@quiet_option
@debug_option
@click.pass_context
def command(ctx: click.Context, /, *, folder: Path | None, as_json: bool, quiet: bool) -> None:
    """Compare the metric with observers: thresholds, masking, gratings, moving textures, flicker.

    Both modes of the metric are applied to the stimuli of published experiments. The exit status is 1 if
    the modern mode misses a target that it is not recorded to miss, or misses one by more than is recorded.
    The fitted constants are cross-validated. This takes about seven minutes of CPU time.
    """
    from enfilade.cli.progress import watch
    from studies.observers.validate import validate

    with watch(quiet=quiet) as monitor:
        validation = validate(monitor)
    if folder is not None:
        from studies.observers.charts import plot_validation

        for file in plot_validation(validation.to_dict(), folder):
            click.echo(f"plot    {file}", err=True)
    if as_json:
        click.echo(json.dumps(validation.to_dict(), indent=2))
    else:
        _show(_figures_table(validation))
        _show(_fits_table(validation))
    known = [figure for figure in validation.missed if figure not in validation.failed]
    for text, figures in (("Targets missed, as recorded", known), ("Targets missed", validation.failed)):
        if figures:
            click.echo(f"{text}: {', '.join(figure.name for figure in figures)}.", err=True)
    if validation.failed:
        ctx.exit(FAILURE)


def _show(table: Table) -> None:
    from rich.console import Console

    console = Console()
    Console(width=max(console.width, WIDTH)).print(table)


def _figures_table(validation: Validation) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(title="Validation on observers", title_justify="left", box=box.SIMPLE_HEAD)
    table.add_column("figure", no_wrap=True)
    for heading in (*(mode.mode for mode in validation.modes), "target", ""):
        table.add_column(heading, justify="right")
    table.add_column("unit")
    table.add_column("fitted to these data")
    for figures in zip(*(mode.figures() for mode in validation.modes), strict=True):
        last = figures[-1]
        target = last.target
        bound = "" if target is None else f"{'≥' if target.is_least else '≤'} {target.bound:.2f}"
        values = (f"{figure.value:.3f}" for figure in figures)
        table.add_row(last.name, *values, bound, last.status, last.unit, last.fitted)
    return table


def _fits_table(validation: Validation) -> Table:
    from rich import box
    from rich.table import Table

    def listed(numbers: Iterable[float]) -> str:
        return ", ".join(f"{number:g}" for number in numbers)

    table = Table(title="Cross-validation of fitted constants", title_justify="left", box=box.SIMPLE_HEAD)
    for heading in ("constant", "data"):
        table.add_column(heading)
    for heading in ("value", "best candidates", "RMS, dB", "CV RMS, dB"):
        table.add_column(heading, justify="right")
    for fit in validation.fits:
        best = listed(fit.least) if fit.least == fit.most else f"{listed(fit.least)} to {listed(fit.most)}"
        errors = f"{fit.rms_db:.3f}", f"{fit.cross_validation_rms_db:.3f}"
        table.add_row(fit.name, fit.data, listed(fit.chosen), best, *errors)
    return table
