"""``python -m studies bench``: quality over CPU time of enfilade's methods and of baselines."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from enfilade.cli.group import debug_option, mark_resumable
from enfilade.cli.options import json_option, path_options, quiet_option, settings_of, settings_options
from enfilade.device import activate
from enfilade.errors import InputError

if TYPE_CHECKING:
    from enfilade.runs.job import Job


@click.command("bench", short_help="Quality over CPU time of enfilade and baselines.")
@path_options
@click.option(
    "--reference-spp",
    type=click.IntRange(1, 1 << 20),
    default=2048,
    show_default=True,
    help="Paths a pixel of the references, in two halves.",
)
@click.option(
    "--walkthrough",
    metavar="FRAMES",
    help="Frames of the walkthrough, such as 1-40: enfilade renders them all, and costs are theirs; those of "
    "--frames are measured, and rendered by baselines.  [default: those of --frames]",
)
@click.option(
    "--seeds",
    type=click.IntRange(1, 100),
    default=1,
    show_default=True,
    help="How often enfilade's configurations are rendered, each time with another seed.",
)
@click.option(
    "--references",
    "store",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("runs/references"),
    show_default=True,
    help="Folder of references, shared by benches; those of more paths are used as they are.",
)
@click.option(
    "--only",
    metavar="NAME",
    multiple=True,
    help="This configuration, such as denoised-16 or decoupled-10, in place of the usual ones; repeatable.",
)
@click.option("--measure", "measures", metavar="NAME", multiple=True, help="Only this measure; repeatable.")
@click.option(
    "--out",
    "folder",
    type=click.Path(path_type=Path),
    required=True,
    help="Folder of the bench; the same command continues.",
)
@click.option(
    "--reference-device",
    type=click.Choice(("auto", "cpu", "gpu")),
    default="auto",
    show_default=True,
    help="Device of the references; configurations run on the CPU.",
)
@json_option
@quiet_option
@debug_option
@settings_options("--seed", "--max-depth", "--exposure-ev", "--allow")
@click.pass_context
def command(
    ctx: click.Context,
    /,
    *,
    scene: Path,
    only: tuple[str, ...],
    folder: Path,
    store: Path,
    walkthrough: str | None,
    as_json: bool,
    **inputs: Any,
) -> None:
    """Compare enfilade's methods with baselines on SCENE (Mitsuba 3 XML), all on one path tracer.

    The usual configurations are path tracing denoised by Open Image Denoise, with several numbers of paths,
    and the method decoupled at two qualities. Each renders whole frames in its own process, and is measured
    in a few windows against a reference of the same pixel filter.
    The command writes bench.json, bench.png (quality over CPU time) and crops.png.
    """
    mark_resumable(ctx)
    activate("cpu")
    from enfilade.camera import ranges
    from studies.bench.bench import Place, bench, forecast_s
    from studies.bench.charts import plot_bench
    from studies.bench.configurations import configuration, default_names
    from studies.bench.pictures import plot_crops
    from studies.bench.references import References
    from studies.bench.windows import windows_of

    path = {name: inputs.pop(name) for name in ("path_file", "size", "frames", "fps")}
    job = _job(ctx, scene, **path)
    whole = job.path if walkthrough is None else _job(ctx, scene, **path | {"frames": walkthrough}).path
    if missing := sorted(set(job.path.numbers) - set(whole.numbers)):
        raise InputError(f"measured frames {ranges(missing)} are not among --walkthrough {walkthrough}")
    names = dict.fromkeys(only or default_names(whole.width * whole.height))
    configurations = [configuration(name, job, whole) for name in names]
    if not inputs["quiet"]:
        minutes = forecast_s(job, configurations, inputs["seeds"], len(os.sched_getaffinity(0))) / 60.0
        count = f"{len(configurations)} configurations"
        click.echo(f"{count}, about {minutes:.0f} minutes once the references are there", err=True)
    found = bench(job, configurations, Place(folder, store), frames=len(whole), **inputs)
    references = References(store, job, windows_of(found["windows"]))
    plots = [
        plot_bench(found, folder / "bench.png"),
        plot_crops(found, references, folder, folder / "crops.png"),
    ]
    if as_json:
        click.echo(json.dumps(found, indent=2))
    else:
        _show(found)
        for file in (folder / "bench.json", *plots):
            click.echo(file)


def _job(ctx: click.Context, scene: Path, *, path_file: Path, size: Any, frames: str | None, fps: Any) -> Job:
    """Scene, path, and settings of all sections; each configuration reads some of them."""
    from enfilade.camera import load_path, parse_frames
    from enfilade.runs.job import Job
    from enfilade.scene.opener import Scene
    from enfilade.settings import SECTIONS

    settings = settings_of(ctx, SECTIONS)
    path = load_path(path_file, size=size, frames=None if frames is None else parse_frames(frames), fps=fps)
    return Job(Scene(scene), path, settings, "reference")


def _show(found: dict[str, Any]) -> None:
    from studies.bench.tables import bench_tables, print_table

    for table in bench_tables(found):
        print_table(table)
    for text in found["left_out"]:
        click.echo(text)
