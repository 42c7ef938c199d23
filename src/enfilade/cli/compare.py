"""``enfilade compare``: what a viewer sees of the difference between two sequences."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from enfilade.cli.flags import SettingsCommand, settings_of, settings_options
from enfilade.cli.group import debug_option
from enfilade.cli.inputs import json_option, quiet_option

if TYPE_CHECKING:
    from enfilade.pipeline.compare import KeepMap


@click.command(
    "compare", cls=SettingsCommand, short_help="What a viewer sees of the difference of two sequences."
)
@click.argument("test")
@click.argument("reference")
@click.option("--fps", type=float, help="Frames per second that are shown.  [default: the sequences', or 30]")
@click.option(
    "--heatmap",
    "folder",
    type=click.Path(path_type=Path, file_okay=False),
    help="Write each frame's map of detection probability into this folder, as PNG.",
)
@json_option
@quiet_option
@debug_option
@settings_options("viewing", "metric")
@click.pass_context
def command(
    ctx: click.Context,
    /,
    *,
    test: str,
    reference: str,
    fps: float | None,
    folder: Path | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Judge TEST against REFERENCE with the animation quality metric.

    Each is a run folder, a folder of images (OpenEXR, PNG, JPEG), a pattern such as frames/%04d.exr, or a
    video.
    """
    settings = settings_of(ctx)
    from enfilade.cli.progress import watch
    from enfilade.pipeline.compare import compare

    with watch(quiet=quiet) as monitor:
        found = compare(
            test,
            reference,
            monitor,
            viewing=settings.viewing,
            metric=settings.metric,
            fps=fps,
            keep_map=None if folder is None else _writer(folder),
        ).to_dict()
    if as_json:
        click.echo(json.dumps(found, indent=2))
        return
    _show(found)
    if folder is not None:
        click.echo(f"maps    {folder}")


def _writer(folder: Path) -> KeepMap:
    from enfilade.report.charts import save_map

    return lambda name, values: save_map(values, folder / f"{Path(name).stem}.png")


def _show(found: dict[str, Any]) -> None:
    from rich.console import Console

    from enfilade.report.tables import comparison_table

    Console().print(comparison_table(found))
