"""``python -m studies bench``: our methods and their rivals on one path tracer, quality over CPU time."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import click

from enfilade.cli.group import debug_option, mark_resumable
from enfilade.cli.options import json_option, path_options, quiet_option, settings_of, settings_options
from enfilade.device import activate


class Counts(click.ParamType[tuple[int, ...]]):
    """Numbers of paths, written ``4,16,64``; ``none`` for no configuration."""

    name = "N,N,..."

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, ...]:
        """Read the numbers."""
        if isinstance(value, tuple):
            return value
        text = str(value).strip()
        if text == "none":
            return ()
        parts = [part.strip() for part in text.split(",")]
        if not all(part.isascii() and part.isdigit() and 0 < int(part) < 2**20 for part in parts):
            self.fail(f"{value!r} is no list of numbers of paths; write it like 4,16,64", param, ctx)
        return tuple(int(part) for part in parts)


@click.command("bench", short_help="Our methods and their rivals: quality over CPU time.")
@path_options
@click.option(
    "--spp",
    "traced",
    type=Counts(),
    default="4,16,64,256",
    show_default=True,
    help="Paths a pixel of path tracing every frame; none leaves it out.",
)
@click.option(
    "--denoised-spp",
    "denoised",
    type=Counts(),
    default="1,2,4,8,16,32",
    show_default=True,
    help="Paths a pixel of path tracing and denoising every frame; none leaves it out.",
)
@click.option(
    "--reference-spp",
    type=click.IntRange(1, 1 << 20),
    default=2048,
    show_default=True,
    help="Paths a pixel of the references.",
)
@click.option(
    "--presets",
    "presets_file",
    type=click.Path(path_type=Path),
    help="A TOML file with a table for each configuration of ours: method, and settings that differ.  "
    "[default: built-in presets]",
)
@click.option(
    "--only",
    metavar="NAME",
    multiple=True,
    help="Only these configurations, such as 'decoupled-*'; repeatable.",
)
@click.option("--measure", "measures", metavar="NAME", multiple=True, help="Only these measures; repeatable.")
@click.option(
    "--out",
    "folder",
    type=click.Path(path_type=Path),
    required=True,
    help="The bench's folder; the same command continues.",
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
    path_file: Path,
    size: tuple[int, int] | None,
    frames: str | None,
    fps: float | None,
    folder: Path,
    as_json: bool,
    quiet: bool,
    **inputs: Any,
) -> None:
    """Compare our methods with their rivals on SCENE (Mitsuba 3 XML), all on one path tracer.

    Path tracing of every frame, the same denoised by Open Image Denoise, FFmpeg's minterpolate, the paper's
    method and ours, each at several settings, each in a process of its own, each against a reference of the
    same pixel filter, by several measures. Written are bench.json, bench.png (quality over CPU time),
    crops.png and slices.png.
    """
    mark_resumable(ctx)
    activate("cpu")
    from enfilade.camera import load_path, parse_frames
    from enfilade.runs.job import Job
    from enfilade.scene.opener import Scene
    from enfilade.settings import SECTIONS
    from studies.bench.bench import Terms, bench, forecast_s

    path = load_path(path_file, size=size, frames=None if frames is None else parse_frames(frames), fps=fps)
    job = Job(Scene(scene), path, settings_of(ctx, SECTIONS), "reference")
    configurations = _configurations(job, **{name: inputs.pop(name) for name in LINEUP})
    terms = Terms(**inputs)
    if not quiet:
        minutes = forecast_s(job, configurations, terms, len(os.sched_getaffinity(0))) / 60.0
        many = f"{len(configurations)} configurations"
        click.echo(f"{many}; some {minutes:.0f} minutes of path tracing from the beginning", err=True)
    found = bench(job, configurations, terms, folder, quiet=quiet)
    plots = _draw(found, folder)
    if as_json:
        click.echo(json.dumps(found, indent=2))
        return
    _show(found)
    for file in (folder / "bench.json", *plots):
        click.echo(file)


LINEUP = ("traced", "denoised", "presets_file", "only")


def _configurations(
    job: Any,
    *,
    traced: tuple[int, ...],
    denoised: tuple[int, ...],
    presets_file: Path | None,
    only: tuple[str, ...],
) -> list[Any]:
    from studies.bench.configurations import PRESETS, chosen, lineup, read_presets

    presets = PRESETS if presets_file is None else read_presets(presets_file)
    return list(chosen(lineup(job, traced=traced, denoised=denoised, presets=presets), only))


def _draw(found: dict[str, Any], folder: Path) -> list[Path]:
    from studies.bench.charts import plot_bench
    from studies.bench.pictures import plot_crops, plot_slices

    return [
        plot_bench(found, folder / "bench.png"),
        plot_crops(found, folder, folder / "crops.png"),
        plot_slices(found, folder, folder / "slices.png"),
    ]


def _show(found: dict[str, Any]) -> None:
    from rich.console import Console

    from studies.bench.tables import bench_tables

    for table in bench_tables(found):
        Console().print(table)
    for text in found["left_out"]:
        click.echo(text)
