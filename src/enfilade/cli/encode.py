"""``enfilade encode``: the frames of a run encoded once more."""

from __future__ import annotations

from pathlib import Path

import click

from enfilade.cli.group import debug_option, ending_on_sigterm
from enfilade.cli.options import (
    VIDEO_FLAGS,
    check_effect,
    quiet_option,
    settings_of,
    settings_options,
    tables_of,
)
from enfilade.settings import SECTIONS, VideoSettings, ViewingSettings


@click.command("encode", short_help="Encode the frames of a run once more.")
@click.argument("run", type=click.Path(path_type=Path))
@click.option(
    "--out",
    "file",
    type=click.Path(path_type=Path, dir_okay=False),
    help="The video, with the codec's suffix.  [default: encoded.mp4, .mkv or .mov in the run folder]",
)
@click.option("--overwrite", "is_replaced", is_flag=True, help="Replace a file that is there.")
@click.option(
    "--unfinished", "is_partial", is_flag=True, help="Encode the finished frames if some are missing."
)
@settings_options(*VIDEO_FLAGS, default="the run's")
@quiet_option
@debug_option
@click.pass_context
def command(
    ctx: click.Context, /, *, run: Path, file: Path | None, is_replaced: bool, is_partial: bool, quiet: bool
) -> None:
    """Encode the frames of the run in the folder RUN with another exposure, view, codec or quality.

    Nothing is rendered, and the run stays as it is.
    """
    settings_of(ctx, SECTIONS)  # raises on wrong values
    check_effect(ctx, "a video", {VideoSettings: (), ViewingSettings: ("exposure_ev",)})
    tables = tables_of(ctx, SECTIONS)
    from enfilade.cli.progress import watch
    from enfilade.runs.encode import encode

    with ending_on_sigterm(), watch(quiet=quiet) as monitor:
        changes = {name: tables.get(name, {}) for name in ("video", "viewing")}
        made = encode(run, changes, monitor, file=file, is_partial=is_partial, is_replaced=is_replaced)
    click.echo(f"video   {made}")
