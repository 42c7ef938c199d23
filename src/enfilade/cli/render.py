"""``enfilade render``: from scene and camera path to frames and video."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from enfilade.cli.flags import SettingsCommand, settings_options
from enfilade.cli.group import debug_option, mark_resumable
from enfilade.cli.inputs import JOB_SECTIONS, crew_of, crew_options, job_of, job_options, output_options
from enfilade.cli.outcome import draw_plots, ledger_bytes, name_files


@click.command(
    "render", cls=SettingsCommand, short_help="Render a walkthrough: frames, video, report of the cost."
)
@job_options
@click.option(
    "--out",
    "folder",
    type=click.Path(path_type=Path),
    required=True,
    help="The run folder; the same command goes on with what is there.",
)
@crew_options
@click.option(
    "--verify",
    "is_verified",
    is_flag=True,
    help="Compare every file that is there with its checksum first; what is damaged is made again.",
)
@click.option(
    "--prepare",
    "is_prepared",
    is_flag=True,
    help="Begin the run folder and render nothing: for `enfilade farm` and `enfilade work`.",
)
@output_options
@debug_option
@settings_options(*JOB_SECTIONS)
@click.pass_context
def command(
    ctx: click.Context,
    /,
    *,
    folder: Path,
    is_verified: bool,
    is_prepared: bool,
    as_json: bool,
    quiet: bool,
    **inputs: Any,
) -> None:
    """Render a walkthrough of SCENE (Mitsuba 3 XML) into frames, a video and a report of the cost."""
    mark_resumable(ctx)
    who = [inputs.pop(name) for name in ("executor", "workers", "threads")]
    job = job_of(ctx, **inputs)
    crew = crew_of(*who)
    from enfilade.cli.progress import watch
    from enfilade.pipeline.walkthrough import prepare, render

    if is_prepared:
        prepare(job, folder, is_tried=True)
        begun = {"folder": str(folder), "method": job.method, "frames": len(job.path)}
        click.echo(json.dumps(begun, indent=2) if as_json else f"run     {folder}")
        return
    before = ledger_bytes(folder)
    with watch(quiet=quiet) as monitor:
        summary = render(job, folder, monitor, crew, is_verified=is_verified, is_tried=True)
    plots = draw_plots(folder, is_new=is_verified or ledger_bytes(folder) != before)
    if as_json:
        extra = {"folder": str(folder), "plots": [str(plot) for plot in plots]}
        click.echo(json.dumps({**summary, **extra}, indent=2))
        return
    _show(summary)
    name_files(folder, summary, plots)


def _show(summary: dict[str, Any]) -> None:
    from rich.console import Console

    from enfilade.reports.tables import run_tables

    console = Console()
    for table in run_tables(summary):
        console.print(table)
    if summary["dropped_samples"]:
        click.echo(f"{summary['dropped_samples']} samples were NaN or infinite and were left out.")
