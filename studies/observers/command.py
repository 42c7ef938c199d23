"""``enfilade validate``: the metric against what people saw."""

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


@click.command("validate", short_help="The metric against what people saw.")
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
    """Judge the metric by what people saw: thresholds, masking, moving textures, flicker.

    Both modes of the metric are shown the stimuli of published experiments. The exit status is 1 where
    a figure of the modern mode misses what is asked of it. What was fitted is fitted again with a part of
    the data left out. About five minutes.
    """
    from enfilade.cli.progress import watch
    from studies.observers.validate import validate

    with watch(quiet=quiet) as monitor:
        found = validate(monitor)
    if folder is not None:
        from studies.observers.charts import plot_people

        for file in plot_people(found.to_dict(), folder):
            click.echo(f"plot    {file}", err=True)
    if as_json:
        click.echo(json.dumps(found.to_dict(), indent=2))
    else:
        _show(_table(found))
        _show(_fits_table(found))
    if found.missed:
        names = ", ".join(figure.name.strip() for figure in found.missed)
        click.echo(f"Missed: {names}.", err=True)
        ctx.exit(FAILURE)


def _show(table: Table) -> None:
    from rich.console import Console

    Console().print(table)


def _table(found: Validation) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(title="The metric against people", title_justify="left", box=box.SIMPLE_HEAD)
    table.add_column("figure", no_wrap=True)
    for heading in (*(mode.mode for mode in found.modes), "asked", ""):
        table.add_column(heading, justify="right")
    table.add_column("unit")
    for figures in zip(*(mode.figures() for mode in found.modes), strict=True):
        last = figures[-1]
        asked = "" if last.asked is None else f"{'≥' if last.asked.is_least else '≤'} {last.asked.bound:.2f}"
        verdict = "" if last.asked is None else ("ok" if last.is_met else "MISSED")
        table.add_row(last.name, *(f"{figure.value:.3f}" for figure in figures), asked, verdict, last.unit)
    return table


def _fits_table(found: Validation) -> Table:
    from rich import box
    from rich.table import Table

    def listed(numbers: Iterable[float]) -> str:
        return ", ".join(f"{number:g}" for number in numbers)

    table = Table(title="What was fitted, by data left out", title_justify="left", box=box.SIMPLE_HEAD)
    for heading in ("number", "data"):
        table.add_column(heading)
    for heading in ("has", "asked for", "dB RMS", "left out"):
        table.add_column(heading, justify="right")
    for fit in found.fits:
        asked = listed(fit.least) if fit.least == fit.most else f"{listed(fit.least)} to {listed(fit.most)}"
        figures = f"{fit.rms_db:.3f}", f"{fit.left_out_rms_db:.3f}"
        table.add_row(fit.name, fit.data, listed(fit.chosen), asked, *figures)
    return table
