"""``enfilade import``: a file of Blender, glTF, USD, FBX or OBJ as a scene folder."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from enfilade.cli.group import debug_option, ending_on_sigterm
from enfilade.cli.options import (
    IMPORT_FLAGS,
    Size,
    check_effect,
    json_option,
    quiet_option,
    settings_of,
    settings_options,
)
from enfilade.errors import EnfiladeError, SettingsError
from enfilade.settings import SECTIONS, BlenderSettings, LimitSettings

if TYPE_CHECKING:
    from enfilade.scene.blender.imported import ImportedScene
    from enfilade.scene.blender.notes import Note
    from enfilade.scene.blender.source import Choices, Source
    from enfilade.settings import Settings

LISTED = 5  # objects that differ most


@click.command("import", short_help="Import a file of Blender, glTF, USD, FBX or OBJ as a scene.")
@click.argument("source", type=click.Path(path_type=Path))
@click.option(
    "--out",
    "folder",
    type=click.Path(path_type=Path),
    required=True,
    help="The scene folder: scene.xml, camera_path.json, settings.toml and the files that they use.",
)
@click.option("--overwrite", "is_replaced", is_flag=True, help="Replace an imported scene that is there.")
@click.option("--size", type=Size(), help="Width and height of the images, pixels.  [default: the file's]")
@click.option("--frames", metavar="FIRST-LAST", help="Frames, both ends included.  [default: the file's]")
@click.option(
    "--check",
    "is_checked",
    is_flag=True,
    help="Then render frames by Cycles and by Mitsuba, and write check.html, which compares their objects.",
)
@click.option("--check-frames", metavar="RANGES", help="Frames of the check.  [default: three]")
@click.option(
    "--check-spp",
    type=click.IntRange(2),
    default=64,
    show_default=True,
    help="Paths a pixel of the check, of each renderer.",
)
@settings_options(*IMPORT_FLAGS, "--allow")
@json_option
@quiet_option
@debug_option
@click.pass_context
def command(
    ctx: click.Context,
    /,
    *,
    source: Path,
    folder: Path,
    is_replaced: bool,
    size: tuple[int, int] | None,
    frames: str | None,
    check_frames: str | None,
    as_json: bool,
    quiet: bool,
    **checking: Any,
) -> None:
    """Import the file SOURCE, by Blender in a process of its own, as a scene folder for `enfilade render`.

    SOURCE is a .blend, glTF, USD, FBX or OBJ file. What is baked, approximated and not carried over is
    listed, with what it means in the picture. Scripts in the file are not run.
    """
    settings = settings_of(ctx, SECTIONS)
    check_effect(ctx, "an import", {BlenderSettings: (), LimitSettings: ()})
    for name in ("check_frames", "check_spp"):
        is_given = ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE
        if is_given and not checking["is_checked"]:
            raise SettingsError(f"--{name.replace('_', '-')} needs --check")
    blender = settings[BlenderSettings]
    from enfilade.camera import parse_frames
    from enfilade.cli.progress import watch
    from enfilade.runs.source import choices_of
    from enfilade.scene.blender.importer import import_file
    from enfilade.scene.blender.source import Source

    choices = choices_of(blender, size, None if frames is None else _span(frames))
    numbers = None if check_frames is None else parse_frames(check_frames)
    with ending_on_sigterm(), watch(quiet=quiet) as monitor:
        imported = import_file(
            source, folder, choices, settings[LimitSettings], monitor,
            program=blender.program, is_strict=blender.strict, is_replaced=is_replaced,
        )  # fmt: skip
    try:
        checked = _checked(imported, source, settings, choices, numbers, quiet=quiet, **checking)
    except EnfiladeError:
        click.echo(f"The imported scene is kept in {folder}; its check failed.", err=True)
        raise
    spent = Source.read(folder)
    if as_json:
        found = _table(imported, spent) | ({"check": checked} if checked else {})
        click.echo(json.dumps(found, indent=2, default=str))
        return
    for line in (*_notes(imported.notes), *_ending(imported, spent), *_check_lines(checked)):
        click.echo(line)


def _checked(
    imported: ImportedScene,
    source: Path,
    settings: Settings,
    choices: Choices,
    numbers: tuple[int, ...] | None,
    *,
    quiet: bool,
    is_checked: bool,
    check_spp: int,
) -> dict[str, Any]:
    """Render and compare frames, and write the page; returns its place and the differences, or nothing."""
    if not is_checked:
        return {}
    from enfilade.cli.progress import watch
    from enfilade.device import activate
    from enfilade.reports.fidelity import differences_of, write_check
    from enfilade.runs.fidelity import check_import
    from enfilade.scene.blender.find import find_blender

    activate("auto")
    blender, limits = find_blender(settings[BlenderSettings].program), settings[LimitSettings]
    with ending_on_sigterm(), watch(quiet=quiet) as monitor:
        made = check_import(
            imported, source, blender, choices, limits, monitor, numbers=numbers, spp=check_spp
        )
    differences = differences_of(made)
    page = write_check(imported, made, differences)
    return {"page": str(page), "spp": made.spp, "differences": [asdict(of) for of in differences]}


def _check_lines(checked: dict[str, Any]) -> Iterator[str]:
    """The largest differences, and the page."""
    if not checked:
        return
    for of in checked["differences"][: LISTED + 1]:
        color, noise = of["color_percent"], of["noise_percent"]
        more = f"contrast {of['contrast_percent']:+.1f} %, highlights {of['highlight_percent']:+.1f} %"
        yield f"check   {of['name'][:32]:32} colour {color:5.1f} % (noise {noise:.1f}), {more}"
    yield f"page    {checked['page']}"


def _span(frames: str) -> tuple[int, int]:
    from enfilade.camera import parse_frames

    numbers = parse_frames(frames)
    if len(numbers) != numbers[-1] - numbers[0] + 1:
        raise SettingsError(f"--frames {frames}: an import takes one range, such as 1-250")
    return numbers[0], numbers[-1]


def _table(imported: ImportedScene, spent: Source) -> dict[str, object]:
    """The import as values for JSON, and paths."""
    times = {"wall_s": spent.wall_s, "cpu_s": spent.cpu_s}
    return {**asdict(imported), "notes": [note.to_json() for note in imported.notes], **times}


def _notes(notes: Iterable[Note]) -> Iterator[str]:
    """Notes by kind."""
    from itertools import groupby

    from enfilade.scene.blender.notes import TITLES, grouped

    for kind, groups in groupby(grouped(notes), key=lambda group: group.kind):
        yield f"{TITLES[kind]}:"
        for group in groups:
            yield f"  {group.listed}: {group.what}"
            yield f"      {group.effect}"


def _ending(imported: ImportedScene, spent: Source) -> Iterator[str]:
    from enfilade.reports.tables import seconds

    yield imported.summary
    yield f"time    {seconds(spent.wall_s)}, CPU {seconds(spent.cpu_s)}"
    path = " --path PATH" if imported.path_file is None else ""
    yield f"render  enfilade render {shlex.quote(str(imported.folder))}{path} --out RUN"
