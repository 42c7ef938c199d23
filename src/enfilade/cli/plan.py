"""``enfilade plan``: analysis, keyframes and a forecast of the cost, before anything is rendered."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from enfilade.cli.group import debug_option, ending_on_sigterm
from enfilade.cli.jobs import job_of
from enfilade.cli.options import (
    FLAGS,
    check_suffix,
    choose_device,
    job_options,
    output_options,
    settings_options,
)
from enfilade.files import scratch_folder
from enfilade.settings import MaskSettings

if TYPE_CHECKING:
    from enfilade.runs.job import Job

LISTED = 12  # keyframes


@click.command("plan", short_help="Velocities, keyframes, and a forecast of the cost.")
@job_options
@settings_options(*FLAGS)
@click.option("--plot", type=click.Path(path_type=Path, dir_okay=False), help="Draw the plan (.png).")
@output_options
@debug_option
@click.pass_context
def command(
    ctx: click.Context,
    /,
    *,
    plot: Path | None,
    as_json: bool,
    quiet: bool,
    **inputs: Any,
) -> None:
    """Analyze the path through SCENE, and forecast the cost of rendering by dry runs of a small excerpt.

    A .blend, glTF, USD, FBX or OBJ file is imported by Blender for this; `enfilade import` keeps the scene.
    """
    check_suffix("--plot", plot, ".png")
    choose_device(inputs.pop("device"))
    from enfilade.cli.progress import watch
    from enfilade.runs.plan import plan

    with scratch_folder("enfilade-plan") as run:
        job = job_of(ctx, run=run, quiet=quiet, **inputs)
        with ending_on_sigterm(), watch(quiet=quiet) as monitor:
            made = plan(job, monitor, has_preflight=True).to_dict()
    if as_json:
        click.echo(json.dumps(made, indent=2))
    else:
        for line in _lines(made, job):
            click.echo(line)
    if plot is not None:
        from enfilade.reports.plots import plot_plan

        plot_plan(made, plot)
        if not as_json:
            click.echo(f"plot    {plot}")


def _lines(plan: Mapping[str, Any], job: Job) -> Iterator[str]:
    """The plan, ``Plan.to_dict()``, as far as its method uses it."""
    from enfilade.reports.tables import percent, seconds, spoken

    def row(name: str, text: str) -> str:
        return f"{name:16} {text}"

    path, keyframes = job.path, plan["keyframes"]
    size = path.width, path.height
    yield row("method", f"{plan['method']}, {len(path)} frames at {size[0]}x{size[1]}")
    if keyframes:
        shown = ", ".join(str(number) for number in keyframes[:LISTED])
        more = f", ... {keyframes[-1]}" if len(keyframes) > LISTED else ""
        yield row("keyframes", f"{len(keyframes)}: {shown}{more}")
        yield row("image velocity", f"{_spread(plan['mean_speed_deg_s'], '.2f')} deg/s")
        if MaskSettings in job.opened_method().settings:
            yield row("slow pixels", f"{_spread(plan['slow_percent'], '.1f')} %")
        if any(plan["specular_percent"]):
            yield row("specular pixels", f"{_spread(plan['specular_percent'], '.1f')} %")
        if tuple(plan["analyzed_size"]) != size:
            yield row("", "estimates from frames at {}x{}".format(*plan["analyzed_size"]))
    if rays := {spoken(kind): count for kind, count in plan["rays"].items() if count}:
        parts = ", ".join(f"{kind} {count:.1f}" for kind, count in rays.items())
        yield row("rays per pixel", f"{sum(rays.values()):.1f} a frame: {parts}")
    elif keyframes:
        yield row("pixels traced", f"{percent(plan['traced_percent']['total'])} %")
    yield row("time", f"{seconds(plan['seconds'])}, CPU {seconds(plan['cpu_seconds'])}, in one process")
    dry = "{} frames at up to {}x{}".format(plan["excerpt_frames"], *plan["excerpt_size"])
    yield row("", f"from dry runs of {dry}; loading and compilation are not included")


def _spread(values: Sequence[float], form: str) -> str:
    mean = sum(values) / len(values)
    return f"{mean:{form}} ({min(values):{form}} to {max(values):{form}})"
