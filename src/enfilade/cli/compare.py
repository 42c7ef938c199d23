"""``enfilade compare``: the visible difference between two sequences."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from enfilade.cli.group import debug_option, ending_on_sigterm
from enfilade.cli.options import (
    check_effect,
    check_suffix,
    given_in,
    json_option,
    quiet_option,
    settings_of,
    settings_options,
)
from enfilade.errors import SettingsError
from enfilade.settings import SECTIONS, MetricSettings, ViewingSettings

if TYPE_CHECKING:
    from enfilade.comparison import ComparedFrame, CompareOptions, Show
    from enfilade.comparison.compare import Mode
    from enfilade.comparison.motion import FlowChoice
    from enfilade.reports.heatmap import HeatmapPainter
    from enfilade.viewing import Viewing


def _list_displays(ctx: click.Context, _parameter: click.Parameter, value: str | None) -> str | None:
    if value == "list" and not ctx.resilient_parsing:
        from enfilade.viewing import DISPLAYS

        for name, (d, text) in DISPLAYS.items():
            click.echo(
                f"{name:<16}{d.width_px:>5}x{d.height_px:<5}{d.diagonal_m:>6g} m from {d.distance_m:>4g} m,"
                f"{d.pixels_per_degree:>6.1f} px/deg, {d.peak_cd_m2:>3g} and {d.black_cd_m2:g} cd/m2  {text}"
            )
        ctx.exit()
    return value


@click.command("compare", short_help="The visible difference between two sequences.")
@click.argument("test")
@click.argument("reference")
@click.option(
    "--second-reference",
    metavar="OTHER",
    help="REFERENCE rendered with another --seed: TEST is compared with the mean of both, and their "
    "difference from each other is the noise floor.",
)
@click.option(
    "--display",
    "display",
    metavar="DISPLAY",
    callback=_list_displays,
    is_eager=True,
    help="A display on which images stand pixel for pixel: paper, desktop-24-fhd, desktop-27-4k, "
    "laptop-14, phone, tv-55-4k, cinema; list describes them. Numbers of [viewing] win over its own.  "
    "[default: the numbers of [viewing], on a display that the image fills]",
)
@click.option("--fps", type=float, help="Frames per second shown.  [default: the sequences', or 30]")
@click.option(
    "--mode",
    type=click.Choice(("modern", "paper")),
    default="modern",
    show_default=True,
    help="The metric with later models of vision, or as published.",
)
@click.option(
    "--measure",
    "measures",
    multiple=True,
    type=click.Choice(("psnr", "flip", "cvvdp")),
    help="A further measure; as often as wanted.",
)
@click.option(
    "--flow",
    type=click.Choice(("auto", "layers", "estimate", "none")),
    default="auto",
    show_default=True,
    help="Motion vectors: from layers of OpenEXR frames, estimated, or none; auto estimates where there are "
    "no layers.",
)
@click.option(
    "--layer",
    "layers",
    metavar="NAME",
    multiple=True,
    help="Layer or part of OpenEXR frames that is compared: once for both sequences, or twice, for the test "
    "and the reference.  [default: R G B without a name, else rgba, beauty, C or Combined, else the only one "
    "of three channels]",
)
@click.option(
    "--heatmap",
    type=click.Path(path_type=Path),
    help="Write heat maps: a video (.mp4, .mkv, .mov), or a folder of PNGs.",
)
@click.option(
    "--graph", type=click.Path(path_type=Path, dir_okay=False), help="Draw the scores over time (.png)."
)
@settings_options("--exposure-ev", default="the runs', or 0")
@json_option
@quiet_option
@debug_option
@click.pass_context
def command(
    ctx: click.Context,
    /,
    *,
    test: str,
    reference: str,
    second_reference: str | None,
    heatmap: Path | None,
    graph: Path | None,
    as_json: bool,
    quiet: bool,
    **choices: Any,
) -> None:
    """Compare TEST with REFERENCE by the animation quality metric.

    Each is a run folder, a folder of images (OpenEXR, PNG, JPEG, TIFF, TGA, WebP, BMP), a pattern such as
    frames/%04d.exr, or a video.

    The score is in just noticeable differences (JND), pooled over all pixels and frames: 1
    is a difference that three of four observers find when they look for it, everywhere and all the time. A
    small or brief difference has a lower score than its own JND; where it is visible, the largest value is
    printed, too. Noise of the reference counts as a difference, and is mentioned where it is a notable part.
    """
    check_suffix("--graph", graph, ".png")
    show = None if heatmap is None else _painted(heatmap)
    sources = [source for source in (test, reference, second_reference) if source is not None]
    _check_apart(sources, heatmap, graph)
    options = _options(ctx, **choices)
    from enfilade.cli.progress import watch
    from enfilade.comparison import compare

    with ending_on_sigterm(), watch(quiet=quiet) as monitor:
        difference = compare(test, reference, options, monitor, second_reference=second_reference, show=show)
    found = difference.to_dict()
    if as_json:
        click.echo(json.dumps(found, indent=2))
    else:
        _print(found)
    if graph is not None:
        from enfilade.reports.timegraph import plot_comparison

        plot_comparison(found, graph)
    for name, file in (("heat map", heatmap), ("graph", graph)):
        if file is not None and not as_json:
            click.echo(f"{name:<9} {file}")


def _options(
    ctx: click.Context,
    *,
    display: str | None,
    fps: float | None,
    mode: Mode,
    measures: tuple[str, ...],
    flow: FlowChoice,
    layers: tuple[str, ...],
) -> CompareOptions:
    from enfilade.comparison import CompareOptions

    if len(layers) > 2:
        raise SettingsError(f"--layer is given {len(layers)} times; give it once, or for TEST and REFERENCE")
    settings = settings_of(ctx, SECTIONS)
    of_metric = () if mode == "paper" else ("pursuit",)
    of_viewing = {name for name in ViewingSettings().to_table() if name != "white"}
    check_effect(
        ctx, f"a comparison of mode {mode}", {ViewingSettings: of_viewing, MetricSettings: of_metric}
    )
    viewing = settings[ViewingSettings]
    return CompareOptions(
        viewing=viewing,
        metric=settings[MetricSettings],
        display=None if display is None else _display(ctx, display, viewing),
        mode=mode,
        flow=flow,
        fps=fps,
        exposure_ev=viewing.exposure_ev if "exposure_ev" in given_in(ctx, ViewingSettings) else None,
        layers=(layers[0], layers[-1]) if layers else (None, None),
        measures=measures,
    )


def _display(ctx: click.Context, name: str, viewing: ViewingSettings) -> Viewing:
    from enfilade.viewing import display_named

    numbers = given_in(ctx, ViewingSettings) - {"exposure_ev", "white"}
    return replace(display_named(name), **{number: getattr(viewing, number) for number in numbers})


def _painted(target: Path) -> Show:
    from enfilade.reports.heatmap import (
        VIDEO_CODECS,
        HeatmapPainter,
        write_heatmap_images,
        write_heatmap_video,
    )

    is_folder = _is_folder(target)
    if not is_folder and target.suffix.lower() not in VIDEO_CODECS:
        raise SettingsError(f"--heatmap {target}: give a folder, or a file {', '.join(VIDEO_CODECS)}")

    def show(frames: Iterator[ComparedFrame], viewing: Viewing) -> None:
        painter = HeatmapPainter(viewing.width_px, viewing.height_px)
        size = painter.width, painter.height
        if is_folder:
            write_heatmap_images(target, ((_name(f), _picture(painter, f)) for f in frames))
        else:
            pictures = (_picture(painter, f) for f in frames)
            write_heatmap_video(target, pictures, size=size, fps=viewing.fps)

    return show


def _is_folder(target: Path) -> bool:
    return target.is_dir() or not target.suffix


def _check_apart(sources: Sequence[str], heatmap: Path | None, graph: Path | None) -> None:
    """Refuse to write over the compared files."""
    if heatmap is None and graph is None:
        return
    from enfilade.images import files_of
    from enfilade.images.imagefiles import SUFFIXES

    of_test, of_reference, *others = map(files_of, sources)
    read = {_place_on_disk(file) for file in chain(of_test, of_reference, *others)} - {None}
    pictures = [heatmap] if heatmap is not None else []
    if heatmap is not None and _is_folder(heatmap):
        # The frames of a video are counted, and as many as the reference's.
        counted = [f"{number:06d}" for number in range(1, len(of_reference) + 1)]
        names = [file.stem for file in of_test if file.suffix.lower() in SUFFIXES] or counted
        pictures = [heatmap / f"{name}.png" for name in names]
    for flag, files in (("--heatmap", pictures), ("--graph", [graph] if graph is not None else [])):
        for file in files:
            if _place_on_disk(file) in read:
                raise SettingsError(f"{flag} would replace {file}, which is compared; write it elsewhere")


def _place_on_disk(file: Path) -> tuple[int, int] | None:
    """Device and inode of a file, the same under all its names; None where there is no file."""
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino


def _name(frame: ComparedFrame) -> str:
    from enfilade.images.imagefiles import SUFFIXES

    file = Path(frame.difference.name)
    return file.stem if file.suffix.lower() in SUFFIXES else f"{frame.difference.number:06d}"


def _picture(painter: HeatmapPainter, frame: ComparedFrame) -> Any:
    of = frame.difference
    caption = (
        f"frame {of.number}    {of.score:.2f} JND (steady {of.steady.score:.2f}, transient "
        f"{of.transient.score:.2f})    {of.percent_visible:.1f} % above 1 JND"
    )
    return painter.paint(frame.jnd, frame.grey, caption)


def _print(found: dict[str, Any]) -> None:
    from rich.console import Console

    from enfilade.reports.tables import comparison_table, measures_line, result_line

    for line in filter(None, (result_line(found), found["noise_note"], measures_line(found))):
        click.echo(line)
    Console().print(comparison_table(found))
