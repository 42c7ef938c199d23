"""``python -m studies calibrate``: scene-dependent settings, calibrated by the metric."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from enfilade.cli.group import debug_option, mark_resumable
from enfilade.cli.jobs import job_of
from enfilade.cli.options import (
    check_suffix,
    choose_device,
    output_options,
    path_options,
    settings_options,
)


@click.group("calibrate", short_help="Calibrate scene-dependent settings by the metric.")
@debug_option
def command() -> None:
    """Calibrate settings for a scene by the metric."""


@command.command("threshold", short_help="Velocity below which pixels must be traced.")
@path_options
@click.option(
    "--probes",
    type=click.IntRange(min=1),
    default=4,
    show_default=True,
    help="Number of frames to compare, at even quantiles of the path's velocities.",
)
@click.option(
    "--visible-percent",
    type=click.FloatRange(0.0, 100.0),
    default=1.0,
    show_default=True,
    help="Share of the reused pixels that may differ visibly, percent.",
)
@click.option(
    "--light",
    type=click.Choice(("traced", "plain")),
    default="traced",
    show_default=True,
    help="Path-traced light of the scene, or a noise-free light without shadows.",
)
@click.option(
    "--out",
    "folder",
    type=click.Path(path_type=Path),
    help="Folder of the traced frames, which the same command continues.",
)
@click.option(
    "--plot", type=click.Path(path_type=Path, dir_okay=False), help="Draw the curve into this PNG file."
)
@settings_options("--spp", "--seed", "--max-depth", "--exposure-ev", "--allow")
@output_options
@debug_option
@click.pass_context
def threshold(
    ctx: click.Context,
    /,
    *,
    probes: int,
    visible_percent: float,
    light: str,
    folder: Path | None,
    plot: Path | None,
    as_json: bool,
    quiet: bool,
    **inputs: Any,
) -> None:
    """Find the velocity v_t below which reused pixels of SCENE would be visible, as in §5.2 and Fig. 9.

    A few frames are rendered twice: with every pixel traced, and composited from keyframes. The metric gives
    the velocity up to which pixels must be traced. The result is a value for --set masks.slow_deg_s.
    """
    check_suffix("--plot", plot, ".png")
    if folder is not None:
        mark_resumable(ctx)
    choose_device(inputs.pop("device"))
    job = job_of(ctx, run=None, quiet=quiet, method="paper", **inputs)
    from enfilade.cli.progress import watch
    from studies.cases.threshold import calibrate_job

    with watch(quiet=quiet) as monitor:
        found = calibrate_job(
            job,
            probes=probes,
            tolerated_percent=visible_percent,
            is_noise_free=light == "plain",
            folder=folder,
            monitor=monitor,
        )
    if as_json:
        click.echo(json.dumps(found, indent=2))
    else:
        _show(found)
    if plot is not None:
        from studies.cases.charts import draw_threshold

        draw_threshold({job.scene.file.resolve().parent.name: found}, plot)


def _show(found: dict[str, Any]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(title="Velocity threshold (§5.2, Fig. 9)", title_justify="left", box=box.SIMPLE_HEAD)
    for heading in ("v_t, deg/s", "traced, %", "reused and visible, %", "removed below, deg/s"):
        table.add_column(heading, justify="right")
    for row in found["curve"]:
        table.add_row(*("" if value is None else f"{value:.3g}" for value in row.values()))
    Console().print(table)
    threshold_deg_s, share = (
        found["threshold_deg_s"],
        f"{found['tolerated_percent']:g} % of the reused pixels",
    )
    if threshold_deg_s is None:
        last = found["curve"][-1]["threshold_deg_s"]
        click.echo(f"No threshold up to {last:g} deg/s leaves less than {share} visibly different.")
    else:
        click.echo(
            f"v_t     {threshold_deg_s:g} deg/s: from this threshold on, at most {share} differ visibly"
        )
        click.echo(f"        (enfilade render ... --set masks.slow_deg_s={threshold_deg_s:g})")
