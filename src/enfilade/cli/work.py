"""``enfilade work``: go on with a run that was begun, or do a share of it beside others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from enfilade.cli.group import debug_option, mark_resumable
from enfilade.cli.inputs import crew_of, crew_options, device_option, quiet_option
from enfilade.cli.outcome import draw_plots, ledger_bytes, name_files
from enfilade.device import Choice, activate
from enfilade.errors import RunFolderError, SettingsError


@click.command("work", short_help="Go on with a run, or do a share of it beside other commands.")
@click.argument("run", type=click.Path(path_type=Path))
@click.option("--step", help="Do this step alone: other commands may work on the run.  [default: all]")
@click.option(
    "--chunk", type=click.IntRange(1), default=1, show_default=True, help="Which share of the step, from 1."
)
@click.option(
    "--of", "count", type=click.IntRange(1), default=1, show_default=True, help="How many shares there are."
)
@click.option("--openjd", "is_openjd", is_flag=True, help="Print progress as Open Job Description wants it.")
@crew_options
@device_option
@quiet_option
@debug_option
@click.pass_context
def command(
    ctx: click.Context,
    /,
    *,
    run: Path,
    step: str | None,
    chunk: int,
    count: int,
    is_openjd: bool,
    device: Choice,
    quiet: bool,
    **who: Any,
) -> None:
    """Go on with the run in the folder RUN, which `enfilade render` or another of these began.

    Without --step, all that is left is done. With it, several commands can work on one run, on one or on
    many hosts: each step after the one before, all chunks of a step at the same time. On a run that was
    shared before, what others hold, or have not done yet, is waited for up to two minutes.
    """
    if step is None and (chunk, count) != (1, 1):
        raise SettingsError("--chunk and --of share a step out: say which with --step, or leave them out")
    mark_resumable(ctx)
    activate(_device_of(run) if device == "auto" else device)
    crew = crew_of(**who)
    from enfilade.cli.progress import OpenJdMonitor, watch
    from enfilade.pipeline.share import Share, do_share, go_on

    with watch(quiet=quiet or is_openjd) as silent:
        monitor = OpenJdMonitor(click.echo) if is_openjd else silent
        if step is None:
            before = ledger_bytes(run)
            summary = go_on(run, monitor, crew)
            plots = draw_plots(run, is_new=ledger_bytes(run) != before)
            name_files(run, summary, plots)
        else:
            do_share(run, Share(step, chunk, count), monitor, crew)


def _device_of(run: Path) -> Choice:
    """The device that a run was begun for: another would be refused."""
    from enfilade.store import Run

    try:
        variant = str(Run.existing(run, is_lenient=True).identity["versions"]["variant"])
    except (RunFolderError, LookupError):  # who goes on with the run says what is wrong with it
        return "auto"
    return "gpu" if variant.startswith("cuda") else "cpu"
