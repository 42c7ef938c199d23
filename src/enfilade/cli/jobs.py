"""The job that `render` and `plan` are given: scene, camera path, method and settings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from enfilade.cli.group import ending_on_sigterm
from enfilade.cli.options import COMMON, assigned, tables_of
from enfilade.errors import SettingsError
from enfilade.settings import SECTIONS, BlenderSettings, Section, Settings

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
    from enfilade.camera import load_path, parse_frames
    from enfilade.cli.progress import watch
    from enfilade.methods.opener import open_method
    from enfilade.runs.job import Job
    from enfilade.runs.source import imported_scene
    from enfilade.scene.opener import Scene

    opened = open_method(method)
    kinds = tuple(dict.fromkeys([*SECTIONS, *opened.settings]))
    tables = tables_of(ctx, kinds)
    settings = Settings.from_tables(tables, kinds)
    _check_effect(ctx, opened, scene)
    selected = None if frames is None else parse_frames(frames)
    path = None if path_file is None else load_path(path_file, size=size, frames=selected, fps=fps)
    span = (selected[0], selected[-1]) if selected and path is None else None
    with ending_on_sigterm(), watch(quiet=quiet) as monitor:
        imported = imported_scene(scene, run, settings, monitor, size=size, frames=span)
    if imported is not None:
        scene, settings = imported.scene_file, Settings.from_tables(imported.tables_under(tables), kinds)
        path = path or load_path(imported.checked_path(), size=size, frames=selected, fps=fps)
    if path is None:
        raise click.UsageError("Missing option '--path'.", ctx)
    return Job(scene=Scene(scene), path=path, settings=settings, method=method)


def _check_effect(ctx: click.Context, method: Method, scene: Path) -> None:
    """Refuse flags and assignments for sections that nothing reads; a file may have them."""
    from enfilade.scene.blender.source import is_importable

    own = BlenderSettings.table
    kinds: tuple[type[Section], ...] = (*COMMON, *method.settings)
    read = {kind.table for kind in kinds}
    for flag, table in assigned(ctx).items():
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
