"""The job that `render` and `plan` are given: scene, camera path, method and settings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from enfilade.cli.group import ending_on_sigterm
from enfilade.cli.options import COMMON, assigned, tables_of
from enfilade.errors import SettingsError
from enfilade.settings import BlenderSettings, Section, Settings

if TYPE_CHECKING:
    from enfilade.methods.base import Method
    from enfilade.runs.job import Job


def job_of(
    ctx: click.Context,
    *,
    run: Path | None,
    quiet: bool,
    scene: Path,
    path_file: Path | None,
    method: str,
    size: tuple[int, int] | None,
    frames: str | None,
    fps: float | None,
) -> Job:
    """The job that a command describes; a file of Blender is imported, the folder of an imported one is read.

    Parameters
    ----------
    ctx
    run
        The run folder, for the imported scene; None: nothing is imported.
    quiet
        Whether no progress of the import is shown.
    scene, path_file, method, size, frames, fps
        As typed.

    Raises
    ------
    InputError
        A setting, the path or the selection of frames is wrong; a flag has no effect; the scene can't be
        imported.
    """
    from enfilade.camera import parse_frames
    from enfilade.cli.progress import watch
    from enfilade.methods.opener import open_method, sections_of
    from enfilade.runs import source
    from enfilade.scene.blender.source import is_importable

    opened = open_method(method)
    kinds = sections_of(opened)
    tables = tables_of(ctx, kinds)
    Settings.from_tables(tables, kinds)  # unknown settings are refused as such, not as without effect
    _check_effect(ctx, opened, scene)
    selected = None if frames is None else parse_frames(frames)
    if path_file is None and not (scene.is_dir() or is_importable(scene)):
        raise click.UsageError("Missing option '--path'.", ctx)
    with ending_on_sigterm(), watch(quiet=quiet) as monitor:
        return source.job_of(
            scene, path_file, tables, method, run, monitor, size=size, frames=selected, fps=fps
        )


def _check_effect(ctx: click.Context, method: Method, scene: Path) -> None:
    """Refuse flags and assignments for sections that nothing reads; a file may have them."""
    from enfilade.scene.blender.source import is_importable

    own = BlenderSettings.table
    kinds: tuple[type[Section], ...] = (*COMMON, *method.settings)
    read = {kind.table for kind in kinds}
    for flag, (table, _) in assigned(ctx).items():
        if table == own and (scene.is_dir() or not is_importable(scene)):
            why = "which Blender does not import; leave it out"
            if scene.is_dir():
                why = "which is imported already; import the file again, with this flag"
            raise SettingsError(f"{flag} has no effect on {scene}, {why}")
        if table not in read | {own}:
            raise SettingsError(
                f"{flag} has no effect with --method {method.name}, which does not read [{table}]; leave it "
                "out, or choose another method"
            )
