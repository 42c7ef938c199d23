"""The job of a run, whose scene Blender may import: once, into the run folder."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enfilade.camera import CameraPath, load_path
from enfilade.errors import CameraPathError, RunFolderError, SceneError
from enfilade.files import sweep
from enfilade.monitor import Monitor
from enfilade.runs.identity import RUN_FILE, SCENE_FOLDER, check_place
from enfilade.runs.ledger import LEDGER_FILE
from enfilade.runs.lock import Lock
from enfilade.scene.blender.imported import ImportedScene
from enfilade.scene.blender.importer import check_strict, import_file
from enfilade.scene.blender.notes import NoteKind, grouped
from enfilade.scene.blender.source import SOURCE_FILE, Choices, Source, check_source, is_importable
from enfilade.settings import BlenderSettings, LimitSettings, Settings

if TYPE_CHECKING:
    from enfilade.runs.job import Job
    from enfilade.scene.opener import Scene


def job_of(
    scene: Scene | Path | str,
    path: CameraPath | Path | str | None,
    settings: Settings | Mapping[str, Mapping[str, Any]],
    method: str,
    run: Path | None,
    monitor: Monitor,
    *,
    size: tuple[int, int] | None = None,
    frames: tuple[int, ...] | None = None,
    fps: float | None = None,
) -> Job:
    """The job of a scene; an imported scene has a camera path and settings for what is not given.

    Parameters
    ----------
    scene
        A scene or its file; or a file that Blender imports, or a folder, see :func:`imported_scene`.
    path
        A camera path or its file; None: that of the imported scene.
    settings
        Tables, which win over those of the imported scene; or settings, which replace these.
    method
        A built-in method's name, or ``module:Class``.
    run
        The run folder; None: no file is imported.
    monitor
    size, frames, fps
        Of a path that is read, see :func:`~enfilade.camera.load_path`.

    Raises
    ------
    InputError
        A setting or the path is wrong, there is no path, or the scene can't be imported.
    """
    # Imported here: an import alone needs no Dr.Jit.
    from enfilade.methods.opener import open_method, sections_of
    from enfilade.runs.job import Job
    from enfilade.scene.opener import Scene

    kinds = sections_of(open_method(method))
    chosen = settings if isinstance(settings, Settings) else Settings.from_tables(settings, kinds)
    if isinstance(path, Path | str):
        path = load_path(path, size=size, frames=frames, fps=fps)
    if not isinstance(scene, Scene):
        span = (frames[0], frames[-1]) if frames and path is None else None
        imported = imported_scene(Path(scene), run, chosen, monitor, size=size, frames=span)
        if imported is not None:
            path = path or load_path(imported.checked_path(), size=size, frames=frames, fps=fps)
            if not isinstance(settings, Settings):
                chosen = Settings.from_tables(imported.tables_under(settings), kinds)
        scene = Scene(Path(scene) if imported is None else imported.scene_file)
    if path is None:
        raise CameraPathError(f"{scene.file} needs a camera path: path is None")
    return Job(scene, path, chosen, method)


def choices_of(
    settings: BlenderSettings,
    size: tuple[int, int] | None = None,
    frames: tuple[int, int] | None = None,
) -> Choices:
    """The choices of an import that are settings, with the size of the images and the frames."""
    return Choices(
        settings.scene,
        settings.view_layer,
        settings.camera,
        size,
        frames,
        settings.bake_px,
        settings.bake_samples,
    )


def imported_scene(
    scene: Path,
    run: Path | None,
    settings: Settings,
    monitor: Monitor,
    *,
    size: tuple[int, int] | None = None,
    frames: tuple[int, int] | None = None,
) -> ImportedScene | None:
    """The imported scene that a path names: that of a folder, or of a file, imported into the run folder.

    A file is imported when the run begins, and kept. None for all other paths, which name scenes of the
    renderer; without a run folder no file is imported.

    Parameters
    ----------
    scene
    run
        The run folder; made if it is not there.
    settings
        Of which `[blender]` and `[limits]` are read.
    monitor
    size, frames
        Width and height of the images in pixels, first and last frame; None: the file's own.

    Raises
    ------
    SceneError
        The folder holds no imported scene, or the file can't be imported.
    RunFolderError, NoSpaceError
        The file or the choices are not those of the run; or the folder holds something else, or can't be
        written.
    """
    if scene.is_dir():
        return ImportedScene.read(scene)
    if run is None or not is_importable(scene):
        return None
    blender, limits = settings[BlenderSettings], settings[LimitSettings]
    folder, choices = run / SCENE_FOLDER, choices_of(blender, size, frames)
    if (folder / SOURCE_FILE).is_file() and _is_kept(run, scene, choices):
        imported = ImportedScene.read(folder)
        if blender.strict:
            check_strict(imported)
        return imported
    check_source(scene)
    if _has_begun(run):
        raise RunFolderError(f"{run} holds a run whose scene was not imported; choose another --out")
    check_place(run)
    lock = Lock(run)
    try:
        sweep(run)
        imported = import_file(
            scene, folder, choices, limits, monitor, program=blender.program, is_strict=blender.strict
        )
    finally:
        lock.release()
    monitor.message(imported.summary)
    for group in grouped(imported.notes_of(NoteKind.NOT_CARRIED)):
        monitor.message(f"not carried over: {group.listed}: {group.what}; {group.effect}")
    return imported


def _has_begun(run: Path) -> bool:
    return (run / RUN_FILE).exists() or (run / LEDGER_FILE).exists()


def _is_kept(run: Path, source: Path, choices: Choices) -> bool:
    """Whether the imported scene of a run is that of the file; a run that has begun is bound to it.

    Raises
    ------
    SceneError
        The file is missing.
    RunFolderError
        The run has begun, and the file or the choices are others.
    """
    if not source.is_file():
        kept, folder = shlex.quote(str(run / SCENE_FOLDER)), shlex.quote(str(run))
        again = f"work {folder}" if _has_begun(run) else f"render {kept} --out {folder}"
        raise SceneError(
            f"there is no file {source}; the run has its scene: `enfilade {again}` continues without it"
        )
    changes = Source.read(run / SCENE_FOLDER).differences(source, choices)
    if changes and _has_begun(run):
        listed = "".join(f"\n  {change}" for change in changes)
        raise RunFolderError(
            f"{run} holds a run of another import:{listed}\nChoose another --out, or delete {run} to begin "
            "anew"
        )
    return not changes
