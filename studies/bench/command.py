"""``enfilade bench``: our methods and their rivals on one tracer, quality over CPU time."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from enfilade.cli.flags import SettingsCommand, settings_of, settings_options
from enfilade.cli.group import debug_option, mark_resumable
from enfilade.cli.inputs import Size, json_option, quiet_option, renderer_option
from enfilade.device import Choice, activate

if TYPE_CHECKING:
    from enfilade.pipeline.job import Job
    from studies.bench.contestants import Contestant

JOB_INPUTS = ("scene", "renderer", "path_file", "size", "frames", "fps")
SECTIONS = ("viewing", "metric", "keyframes", "warp", "masks", "antialias", "light", "limits")
JUDGES = ("aqm", "flip", "psnr", "temporal", "cvvdp")  # `judges.JUDGES`; to ask it would load NumPy


class Counts(click.ParamType[tuple[int, ...]]):
    """Numbers of paths, written ``4,16,64``; ``none`` for no contestant."""

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


@click.command(
    "bench", cls=SettingsCommand, short_help="Our methods and their rivals: quality over CPU time."
)
@click.argument("scene", type=click.Path(path_type=Path))
@renderer_option
@click.option(
    "--path",
    "path_file",
    type=click.Path(path_type=Path),
    required=True,
    help="The camera path: nerfstudio's camera_path.json or keyed poses.",
)
@click.option("--size", type=Size(), help="Width and height of the images, pixels.  [default: the path's]")
@click.option("--frames", metavar="RANGES", help="Frames to take, such as 1-48.  [default: all]")
@click.option("--fps", type=float, help="Frames per second of the video.  [default: the path's]")
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
    help="A TOML file with a table for each of our contestants: method, and what differs from the settings.  "
    "[default: built-in presets]",
)
@click.option(
    "--only",
    metavar="NAME",
    multiple=True,
    help="Take these contestants alone, such as 'decoupled-*'; may be repeated.",
)
@click.option(
    "--redo", metavar="NAME", multiple=True, help="Begin these contestants anew, such as 'decoupled-*'."
)
@click.option(
    "--judge",
    "judges",
    type=click.Choice(JUDGES),
    multiple=True,
    help="Ask these judges alone; may be repeated.",
)
@click.option(
    "--out",
    "folder",
    type=click.Path(path_type=Path),
    required=True,
    help="The bench's folder; the same command goes on with what is there.",
)
@click.option(
    "--reference-device",
    type=click.Choice(("auto", "cpu", "gpu")),
    default="auto",
    show_default=True,
    help="Run the references on the GPU where there is one, or say on what; contestants run on the CPU.",
)
@click.option(
    "--differences", is_flag=True, help="Encode a video of each contestant beside its differences, too."
)
@json_option
@quiet_option
@debug_option
@settings_options(*SECTIONS)
@click.pass_context
def command(
    ctx: click.Context,
    /,
    *,
    folder: Path,
    reference_spp: int,
    judges: tuple[str, ...],
    reference_device: Choice,
    differences: bool,
    as_json: bool,
    quiet: bool,
    **inputs: Any,
) -> None:
    """Race our methods against their rivals on SCENE (Mitsuba 3 XML), all on one tracer.

    Path tracing of every frame, the same denoised by Open Image Denoise, FFmpeg's minterpolate, the paper's
    method and ours, each at several settings, each in a process of its own, each against a reference of the
    same pixel filter, by several judges. Written are bench.json, bench.png (quality over CPU time) and
    crops.png.
    """
    mark_resumable(ctx)
    activate("cpu")
    job = _job(ctx, **{name: inputs.pop(name) for name in JOB_INPUTS})
    takes_part, again = _lineup(job, **inputs)
    from enfilade.cli.progress import watch
    from studies.bench.bench import Terms, bench, forecast_s

    terms = Terms(reference_spp, judges, again, reference_device)
    with watch(quiet=quiet) as monitor:
        minutes = forecast_s(job, takes_part, terms, len(os.sched_getaffinity(0))) / 60.0
        monitor.say(f"{len(takes_part)} contestants; some {minutes:.0f} minutes of tracing when begun anew")
        found = bench(job, takes_part, terms, folder, monitor)
    plots = _drawn(found, folder, differences=differences)
    if as_json:
        click.echo(json.dumps(found, indent=2))
        return
    _show(found)
    for name, file in (("result", folder / "bench.json"), *((_kind(plot), plot) for plot in plots)):
        click.echo(f"{name:7} {file}")


def _job(
    ctx: click.Context,
    *,
    scene: Path,
    renderer: str | None,
    path_file: Path,
    size: tuple[int, int] | None,
    frames: str | None,
    fps: float | None,
) -> Job:
    settings = settings_of(ctx)
    from enfilade.camera import load_path, parse_frames
    from enfilade.pipeline.job import Job

    selected = None if frames is None else parse_frames(frames)
    path = load_path(path_file, size=size, frames=selected, fps=fps)
    return Job(scene=scene, path=path, settings=settings, method="reference", renderer=renderer)


def _lineup(
    job: Job,
    *,
    traced: tuple[int, ...],
    denoised: tuple[int, ...],
    presets_file: Path | None,
    only: tuple[str, ...],
    redo: tuple[str, ...],
) -> tuple[list[Contestant], tuple[str, ...]]:
    """Who takes part, and who of them begins anew."""
    from studies.bench.contestants import PRESETS, chosen, lineup, read_presets

    presets = PRESETS if presets_file is None else read_presets(presets_file)
    everybody = lineup(job, traced=traced, denoised=denoised, presets=presets)
    again = tuple(c.name for c in chosen(everybody, redo)) if redo else ()
    return chosen(everybody, only), again


def _drawn(found: dict[str, Any], folder: Path, *, differences: bool) -> list[Path]:
    from studies.bench.charts import plot_bench
    from studies.bench.pictures import plot_crops, plot_slices, write_differences

    videos = write_differences(found, folder) if differences else []
    chart = plot_bench(found, folder / "bench.png")
    crops = plot_crops(found, folder, folder / "crops.png")
    return [chart, crops, plot_slices(found, folder, folder / "slices.png"), *videos]


def _show(found: dict[str, Any]) -> None:
    from rich.console import Console

    from studies.bench.tables import bench_tables

    console = Console()
    for table in bench_tables(found):
        console.print(table)
    for text in found["left_out"]:
        click.echo(text)


def _kind(file: Path) -> str:
    return "video" if file.suffix == ".mp4" else "plot"
