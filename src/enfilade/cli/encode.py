"""``enfilade encode``: the frames of a run once more, with another exposure, view, codec or quality."""

from __future__ import annotations

from pathlib import Path

import click

from enfilade.cli.flags import SettingsCommand, settings_of, settings_options, tables_of
from enfilade.cli.group import debug_option
from enfilade.cli.inputs import quiet_option


@click.command("encode", cls=SettingsCommand, short_help="Encode the frames of a run once more.")
@click.argument("run", type=click.Path(path_type=Path))
@click.option(
    "--out",
    "file",
    type=click.Path(path_type=Path, dir_okay=False),
    help="The video, its suffix that of the codec.  [default: encoded.mp4, .mkv or .mov in the run folder]",
)
@click.option("--overwrite", "is_replaced", is_flag=True, help="Replace a file that is there.")
@click.option(
    "--unfinished", "is_partial", is_flag=True, help="Encode the frames that are there if some are missing."
)
@quiet_option
@debug_option
@settings_options("video", "viewing.exposure_ev", default="the run's")
@click.pass_context
def command(
    ctx: click.Context,
    /,
    *,
    run: Path,
    file: Path | None,
    is_replaced: bool,
    is_partial: bool,
    quiet: bool,
) -> None:
    """Encode the frames of the run in the folder RUN with another exposure, view, codec or quality.

    Nothing is rendered, and the run stays what it is, its own video included. What no flag says is as the run
    has it. How much noise the frames keep was judged at the exposure of the run.
    """
    settings_of(ctx)  # what is wrong with them raises here, also in other sections of the file
    tables = tables_of(ctx)
    from enfilade.cli.progress import watch
    from enfilade.pipeline.encode import encode

    with watch(quiet=quiet) as monitor:
        made = encode(
            run,
            {name: tables.get(name, {}) for name in ("video", "viewing")},
            monitor,
            file=file,
            is_partial=is_partial,
            is_replaced=is_replaced,
        )
    click.echo(f"video   {made}")
