"""``enfilade render``: frames and video of a scene along a camera path."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from enfilade.cli.group import debug_option, mark_resumable
from enfilade.cli.jobs import job_of
from enfilade.cli.options import (
    FLAGS,
    choose_device,
    job_options,
    output_options,
    settings_options,
    worker_options,
)
from enfilade.errors import SettingsError

if TYPE_CHECKING:
    from enfilade.runs.job import Job

# Five interiors at 160x90, 256 paths a pixel, on a server's cores: 0.30 to 0.48 million.
PATHS_PER_CPU_S = 0.35e6


@click.command("render", short_help="Render a walkthrough: frames, video, and tables of the cost.")
@job_options
@click.option(
    "--out",
    "folder",
    type=click.Path(path_type=Path),
    required=True,
    help="The run folder; the same command continues a run that was interrupted.",
)
@settings_options(*FLAGS)
@worker_options
@click.option(
    "--verify",
    "is_verified",
    is_flag=True,
    help="First compare every file with its checksum; damaged ones are made again.",
)
@click.option(
    "--prepare",
    "is_prepared",
    is_flag=True,
    help="Begin the run folder and render nothing: for `enfilade farm` and `enfilade work`.",
)
@output_options
@debug_option
@click.pass_context
def command(
    ctx: click.Context,
    /,
    *,
    folder: Path,
    executor: str,
    workers: int | None,
    threads: int,
    is_verified: bool,
    is_prepared: bool,
    as_json: bool,
    quiet: bool,
    **inputs: Any,
) -> None:
    """Render a walkthrough of SCENE into frames and a video; tables show its cost.

    SCENE is Mitsuba 3's XML. A .blend, glTF, USD, FBX or OBJ file is imported by Blender into the run folder
    first, with its camera, exposure and view; `--set blender.camera=NAME` and the like choose from it.
    """
    if is_prepared:
        _check_prepare(ctx)
    mark_resumable(ctx)
    choose_device(inputs.pop("device"))
    from enfilade.runs.executor import Workers

    team = Workers(executor, workers, threads)
    job = job_of(ctx, run=folder, quiet=quiet, **inputs)
    from enfilade.cli.progress import watch
    from enfilade.runs.render import prepare, render

    if is_prepared:
        with watch(quiet=quiet) as monitor:
            prepare(job, folder, monitor, has_preflight=True)
        begun = {"folder": str(folder), "method": job.method, "frames": len(job.path)}
        click.echo(json.dumps(begun, indent=2) if as_json else f"run     {folder}")
        return
    with watch(quiet=quiet) as monitor:
        if job.method == "reference" and not quiet:
            monitor.message(reference_forecast(job))
        summary = render(job, folder, monitor, team, is_verified=is_verified, has_preflight=True)
    show_run(folder, summary, as_json=as_json)


def _check_prepare(ctx: click.Context) -> None:
    """Refuse options of the rendering with --prepare, which renders nothing."""
    for option in ctx.command.params:
        is_given = ctx.get_parameter_source(option.name or "") is ParameterSource.COMMANDLINE
        if is_given and option.name in ("executor", "workers", "threads", "is_verified"):
            raise SettingsError(
                f"{option.opts[0]} has no effect with --prepare, which renders nothing; leave it out"
            )


def reference_forecast(job: Job) -> str:
    """Number of paths of a run of path tracing, and a rough CPU time, without loading the scene."""
    from enfilade.device import active
    from enfilade.reports.tables import seconds
    from enfilade.settings import SamplingSettings

    path, spp = job.path, job.settings[SamplingSettings].spp
    paths = len(path) * path.width * path.height * spp
    text = (
        f"reference: {paths / 1e6:,.0f} million paths ({len(path)} frames of {path.width}x{path.height}, "
        f"{spp} a pixel)"
    )
    if active().backend == "cuda":
        return f"{text}; `enfilade plan` measures their time"
    time = seconds(paths / PATHS_PER_CPU_S)
    return f"{text}, about {time} of CPU time in an interior; `enfilade plan` measures it"


def show_run(folder: Path, summary: dict[str, Any], *, as_json: bool = False) -> None:
    """Print the tables of a finished run, and the places of its files."""
    if as_json:
        click.echo(json.dumps({**summary, "folder": str(folder)}, indent=2))
        return
    from rich.console import Console

    from enfilade.camera import ranges
    from enfilade.reports.tables import run_tables

    console = Console()
    for table in run_tables(summary):
        console.print(table)
    if summary["dropped_samples"]:
        click.echo(f"{summary['dropped_samples']} samples were NaN or infinite and were left out.")
    if black := summary["black_frames"]:
        click.echo(
            f"frames {ranges(black)} are black: the camera sees no surface, is inside of one, or no light "
            "arrives there"
        )
    for name, file in (("video", folder / summary["video"]), ("run", folder)):
        click.echo(f"{name:7} {file}")
