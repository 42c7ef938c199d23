"""``enfilade farm``: a run for a render manager, or for Slurm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from enfilade.cli.group import debug_option
from enfilade.cli.options import check_suffix, value_of
from enfilade.errors import SettingsError


@click.command("farm", short_help="Give a run to a render farm (Open Job Description) or to Slurm.")
@click.argument("run", type=click.Path(path_type=Path))
@click.option("--shards", type=click.IntRange(1), help="Shards of a pass.  [default: one for each 16 frames]")
@click.option(
    "--out",
    "file",
    type=click.Path(path_type=Path, dir_okay=False),
    help="The job template.  [default: farm.template.json in the run folder]",
)
@click.option(
    "--submit",
    "cluster",
    type=click.Choice(("slurm", "local")),
    help="Write no template: submit to Slurm, or, for a trial, to processes of this machine in turn.",
)
@click.option(
    "--slurm",
    "options",
    multiple=True,
    metavar="KEY=VALUE",
    help="A parameter of submitit, such as slurm_partition=cpu, timeout_min=120 (instead of 60) or "
    "cpus_per_task=16 (instead of 8); as often as wanted.",
)
@debug_option
def command(
    *, run: Path, shards: int | None, file: Path | None, cluster: str | None, options: tuple[str, ...]
) -> None:
    """Write a job template for the run in the folder RUN, which `enfilade render --prepare` begins.

    All hosts must see the folder, and the scene, under the same names.
    """
    if options and cluster is None:
        raise SettingsError("--slurm needs --submit slurm")
    if file is not None and cluster is not None:
        raise SettingsError("--out has no effect with --submit, which writes no template")
    check_suffix("--out", file, ".json")
    from enfilade.files import write_json
    from enfilade.runs.farm import TEMPLATE, submit, template

    if cluster is not None:
        submit(run, cluster, shards, dict(_pair(text) for text in options), click.echo)
        return
    out = run / TEMPLATE if file is None else file
    write_json(out, template(run, shards))
    click.echo(f"template {out}")


def _pair(text: str) -> tuple[str, Any]:
    key, _, value = text.partition("=")
    if not key or not value:
        raise click.BadParameter(f"{text!r} is not KEY=VALUE", param_hint="--slurm")
    found = value_of(value)
    return key, found if isinstance(found, (bool, int, float, list, dict)) else value
