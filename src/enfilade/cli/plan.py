"""``enfilade plan``: what can be known of a walkthrough before it is rendered."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from enfilade.cli.flags import SettingsCommand, settings_options
from enfilade.cli.group import debug_option
from enfilade.cli.inputs import JOB_SECTIONS, job_of, job_options, output_options
from enfilade.cli.outcome import check_png


@click.command("plan", cls=SettingsCommand, short_help="What rendering would take, before it begins.")
@job_options
@click.option(
    "--plot",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Draw the plan into this PNG file.",
)
@output_options
@debug_option
@settings_options(*JOB_SECTIONS)
@click.pass_context
def command(ctx: click.Context, /, *, plot: Path | None, as_json: bool, quiet: bool, **inputs: Any) -> None:
    """Say what rendering SCENE would take: image flow, keyframes, expected holes, forecast of cost."""
    check_png("--plot", plot)
    job = job_of(ctx, **inputs)
    from enfilade.cli.progress import watch
    from enfilade.pipeline.plan import plan

    with watch(quiet=quiet) as monitor:
        made = plan(job, monitor, is_tried=True).to_dict()
    if as_json:
        click.echo(json.dumps(made, indent=2))
    else:
        _show(made)
    if plot is not None:
        from enfilade.reports.plots import plot_plan

        plot_plan(made, plot)
        if not as_json:
            click.echo(f"plot    {plot}")


def _show(made: dict[str, Any]) -> None:
    from rich.console import Console

    from enfilade.reports.tables import plan_tables

    console = Console()
    for table in plan_tables(made):
        console.print(table)
