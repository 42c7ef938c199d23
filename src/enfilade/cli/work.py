"""``enfilade work``: continue a run that was begun, or do a shard of a pass beside other commands."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import click

from enfilade.cli.group import debug_option, mark_resumable
from enfilade.cli.options import device_option, quiet_option, worker_options
from enfilade.device import Choice, activate
from enfilade.errors import RunFolderError, SettingsError


@click.command("work", short_help="Continue a run, or do a shard of a pass beside other commands.")
@click.argument("run", type=click.Path(path_type=Path))
@click.option(
    "--pass", "pass_name", help="Do this pass alone: other commands may work on the run.  [default: all]"
)
@click.option(
    "--shard",
    default="1/1",
    show_default=True,
    metavar="I/N",
    help="Shard of the pass: the first of four is 1/4.",
)
@click.option(
    "--verify",
    "is_verified",
    is_flag=True,
    help="Compare all finished files with their checksums first; make damaged ones again.",
)
@click.option("--openjd", "is_openjd", is_flag=True, help="Print progress for Open Job Description.")
@worker_options
@device_option
@quiet_option
@debug_option
@click.pass_context
def command(
    ctx: click.Context,
    /,
    *,
    run: Path,
    pass_name: str | None,
    shard: str,
    is_verified: bool,
    is_openjd: bool,
    device: Choice,
    quiet: bool,
    **team: Any,
) -> None:
    """Continue the run in the folder RUN, which `enfilade render` began.

    With --pass, several commands may work on one run, on one or many hosts: each pass after the one before,
    all shards of a pass at the same time.
    """
    match = re.fullmatch(r"([0-9]{1,9})/([0-9]{1,9})", shard)
    if match is None:
        raise SettingsError(f"--shard {shard}: write it like 1/4")
    if pass_name is None and shard != "1/1":
        raise SettingsError("--shard needs --pass")
    if pass_name is not None and is_verified:
        raise SettingsError("--verify is of a whole run: leave out --pass")
    mark_resumable(ctx)
    activate(_device_of(run) if device == "auto" else device)
    from enfilade.cli.progress import OpenJdMonitor, watch
    from enfilade.cli.render import show_run
    from enfilade.runs.executor import Workers
    from enfilade.runs.job import read_job
    from enfilade.runs.render import Shard, render, render_shard

    workers = Workers(team["executor"], team["workers"], team["threads"])
    with watch(quiet=quiet or is_openjd) as silent:
        monitor = OpenJdMonitor(click.echo) if is_openjd else silent
        if pass_name is None:
            summary = render(read_job(run), run, monitor, workers, is_verified=is_verified)
        else:
            render_shard(run, Shard(pass_name, int(match[1]), int(match[2])), monitor, workers)
    if pass_name is None:
        show_run(run, summary)


def _device_of(run: Path) -> Choice:
    """The device that a run was begun on: another would be refused."""
    from enfilade.runs.identity import identity_of

    try:
        variant = str(identity_of(run)["scene"]["variant"])
    except (RunFolderError, LookupError, TypeError):  # the next step names the cause
        return "auto"
    return "gpu" if variant.startswith("cuda") else "cpu"
