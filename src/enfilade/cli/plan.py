"""``enfilade plan``: analysis, keyframes and a forecast of the cost, before anything is rendered."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from enfilade.cli.group import debug_option
from enfilade.cli.options import FLAGS, check_png, job_of, job_options, output_options, settings_options


@click.command("plan", short_help="Velocities, keyframes, and a forecast of the cost.")
@job_options
@settings_options(*FLAGS)
@click.option("--plot", type=click.Path(path_type=Path, dir_okay=False), help="Draw the plan (.png).")
@output_options
@debug_option
@click.pass_context
def command(ctx: click.Context, /, *, plot: Path | None, as_json: bool, quiet: bool, **inputs: Any) -> None:
    """Analyze the path through SCENE, and forecast the cost of rendering by a dry run of a small excerpt."""
    check_png("--plot", plot)
    job = job_of(ctx, **inputs)
    from enfilade.cli.progress import watch
    from enfilade.runs.plan import plan

    with watch(quiet=quiet) as monitor:
        made = plan(job, monitor, has_preflight=True).to_dict()
    if as_json:
        click.echo(json.dumps(made, indent=2))
    else:
        from rich.console import Console

        from enfilade.reports.tables import plan_tables

        for table in plan_tables(made):
            Console().print(table)
    if plot is not None:
        from enfilade.reports.plots import plot_plan

        plot_plan(made, plot)
        if not as_json:
            click.echo(f"plot    {plot}")
