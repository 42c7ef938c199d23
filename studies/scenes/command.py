"""``python -m studies scene``: write a generated scene with its camera path."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import click

from enfilade.cli.group import debug_option
from enfilade.cli.options import Size, json_option
from studies.scenes import PRESETS, SCENES


@click.command("scene", short_help="Write a generated scene.")
@click.argument("name", type=click.Choice(SCENES))
@click.option(
    "--out",
    "folder",
    type=click.Path(path_type=Path, file_okay=False),
    required=True,
    help="Folder of the scene; created if absent.",
)
@click.option(
    "--preset",
    type=click.Choice(PRESETS),
    default="full",
    show_default=True,
    help="full: the whole walk at 640x480; small: a short walk at 320x240.",
)
@click.option(
    "--size",
    type=Size(),
    help="Width and height of the frames, pixels; any aspect.  [default: the preset's]",
)
@json_option
@debug_option
def command(*, name: str, folder: Path, preset: str, size: tuple[int, int] | None, as_json: bool) -> None:
    """Write a generated scene and its camera path.

    room: diffuse. atrium: mirrors, glass, gloss. gallery: low sun through blinds, showcases, a mirror.
    kitchen: coated, rough and metallic materials under small lamps. courtyard: arcades around an open
    court under sun and sky.
    """
    from studies.scenes import write_scene

    files = write_scene(name, folder, preset=preset, size=size)
    if as_json:
        click.echo(json.dumps({"scene": str(files.scene), "path": str(files.path)}, indent=2))
        return
    click.echo(f"scene   {files.scene}")
    click.echo(f"path    {files.path}")
    click.echo("\nNext, estimate the cost and render:")
    arguments = shlex.join([str(files.scene), "--path", str(files.path)])
    click.echo(f"  enfilade plan {arguments}")
    click.echo(f"  enfilade render {arguments} --out {shlex.quote(f'runs/{name}')}")
