"""Import of a file into a scene folder: written beside, checked, renamed."""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from enfilade.camera import check_size, load_path
from enfilade.errors import CameraPathError, SceneError, SettingsError
from enfilade.files import MARK, read_json, whole_folder, write_json
from enfilade.images.view import files_of_view, white_of
from enfilade.monitor import Monitor
from enfilade.scene.blender.find import Blender, find_blender
from enfilade.scene.blender.imported import (
    CHECK_PAGE,
    PATH_FILE,
    SCENE_FILE,
    SETTINGS_FILE,
    ImportedScene,
    SourceView,
)
from enfilade.scene.blender.notes import Note, NoteKind, grouped
from enfilade.scene.blender.process import RESULT_FILE, cpu_of_children_s, run_job
from enfilade.scene.blender.source import SOURCE_FILE, Choices, FileState, Source, check_source
from enfilade.settings import LimitSettings, VideoSettings

COLORS = "colormanagement"  # folder of the configuration of OpenColorIO, in Blender and in the scene folder
CONFIG = "config.ocio"
FILES = frozenset({SCENE_FILE, PATH_FILE, SETTINGS_FILE, RESULT_FILE, SOURCE_FILE, CHECK_PAGE})
FOLDERS = frozenset({"meshes", "textures", COLORS})  # and files, of a scene folder
SHOWN = 8  # parts that are not carried over, and files, in a message


def import_file(
    source: Path,
    out: Path,
    choices: Choices,
    limits: LimitSettings,
    monitor: Monitor,
    *,
    program: str = "",
    is_strict: bool = False,
    is_replaced: bool = True,
) -> ImportedScene:
    """Import a file of Blender, or of a format that Blender reads, into a scene folder.

    Parameters
    ----------
    source
    out
        The scene folder; new, empty, or an imported scene, which is replaced when the import has succeeded.
    choices
    limits
    monitor
    program
        See :func:`~enfilade.scene.blender.find.find_blender`.
    is_strict
        Whether a part that is not carried over is an error.
    is_replaced
        Whether an imported scene may be replaced.

    Raises
    ------
    SceneError
        There is no Blender; the file is missing, damaged, refused, or too large; a part of it is not
        carried over, and that is an error; or the folder holds something else.
    CameraPathError
        The size of the images is none.
    RunFolderError, NoSpaceError
        The folder can't be written.
    """
    check_source(source)
    if choices.size is not None:
        check_size(*choices.size)
    _check_place(out, is_replaced=is_replaced)
    _check_outside(out, source)
    blender = find_blender(program)
    if blender.note:
        monitor.message(blender.note)
    before, began = Source.of(source, choices), time.monotonic()
    cpu_began = cpu_of_children_s()
    with whole_folder(out) as beside:
        run_job(blender, job_table("export", source, beside, choices, limits), limits, monitor)
        imported = _with_view(ImportedScene.read(beside), blender)
        _check(imported, limits)
        _check_outside(out, *imported.files)
        if is_strict:
            check_strict(imported)
        wall_s, cpu_s = time.monotonic() - began, cpu_of_children_s() - cpu_began
        others = tuple(FileState.of_file(file) for file in imported.files if file.is_file())
        replace(before, others=others, wall_s=round(wall_s, 2), cpu_s=round(cpu_s, 2)).write(beside)
    return replace(imported, folder=out)


def job_table(task: str, source: Path, out: Path, choices: Choices, limits: LimitSettings) -> dict[str, Any]:
    """A job of the importer; the part that its tasks have in common."""
    folders = [folder for folder in limits.allow.split(os.pathsep) if folder]
    named = {name: value or None for name, value in asdict(choices).items()}
    bounds = {"instances": limits.import_instances, "triangles": limits.import_triangles}
    files = {"source": str(source.resolve()), "out": str(out.resolve())}
    return {"task": task, **files, **named, "limits": bounds, "library_folders": folders}


def check_strict(imported: ImportedScene) -> None:
    """Refuse a scene of which a part was not carried over.

    Raises
    ------
    SceneError
    """
    lost = grouped(imported.notes_of(NoteKind.NOT_CARRIED))
    if not lost:
        return
    lines = [f"\n  {group.listed}: {group.what}; {group.effect}" for group in lost[:SHOWN]]
    more = f"\n  and {len(lost) - SHOWN} more" if len(lost) > SHOWN else ""
    raise SceneError(
        f"--strict refuses {imported.source}, of which this is not carried over:{''.join(lines)}{more}"
    )


def _check_place(out: Path, *, is_replaced: bool) -> None:
    """Refuse to replace anything but an imported scene."""
    if not out.exists():
        return
    if not out.is_dir():
        raise SceneError(f"{out} is there already, and is no folder; choose another --out")
    if Path.cwd().is_relative_to(out.resolve()):
        raise SceneError(f"the working folder is in {out}, which would be replaced; choose another --out")
    names = {entry.name for entry in out.iterdir()}
    if names and RESULT_FILE not in names:
        raise SceneError(f"{out} is there already, and holds no imported scene; choose another --out")
    if names and not is_replaced:
        raise SceneError(f"{out} holds an imported scene; replace it by --overwrite, or choose another --out")
    if others := sorted(name for name in names - FILES - FOLDERS if MARK not in name):
        shown = ", ".join(others[:SHOWN]) + (", ..." if len(others) > SHOWN else "")
        raise SceneError(
            f"{out} is not replaced: the import has not written {shown}; move it, or choose another --out"
        )


def _check_outside(out: Path, *files: Path) -> None:
    """Refuse to replace a folder that holds what is imported."""
    for file in files:
        if file.resolve().is_relative_to(out.resolve()):
            raise SceneError(f"{file} is in {out}, which would be replaced; choose another --out")


def _check(imported: ImportedScene, limits: LimitSettings) -> None:
    """Refuse a result that is no scene of Mitsuba, or has no valid camera path."""
    from enfilade.scene.mitsuba.files import check_scene

    try:
        check_scene(imported.scene_file, limits)
        if imported.path_file is not None:
            load_path(imported.path_file)
    except CameraPathError as error:
        raise SceneError(f"{imported.source}: its camera can't be used: {error}") from error
    except SceneError as error:
        raise SceneError(f"{imported.source} was imported as a scene that can't be used: {error}") from error


def _with_view(imported: ImportedScene, blender: Blender) -> ImportedScene:
    """Write the settings that come from the file, with Blender's view transform if it can be used."""
    video, white, problem = _video(imported.view, blender, imported.folder)
    notes = imported.notes
    if problem:
        view = imported.view
        name = view.view_transform + ("" if view.look == "None" else f", look {view.look}")
        what = f"view transform {name} on {view.display}: {problem}"
        effect = "the video has the standard sRGB view: highlights clip, and contrast and saturation differ"
        notes = (*notes, Note(NoteKind.NOT_CARRIED, imported.scene, "Color Management", what, effect))
        result = imported.folder / RESULT_FILE
        write_json(result, {**read_json(result), "notes": [note.to_json() for note in notes]})
    viewing = {"exposure_ev": imported.exposure_ev, **({"white": white} if video else {})}
    tables: dict[str, dict[str, Any]] = {"viewing": viewing, "video": video}
    (imported.folder / SETTINGS_FILE).write_text(_toml(tables), encoding="utf-8")
    return replace(imported, notes=notes)


def _video(view: SourceView, blender: Blender, folder: Path) -> tuple[dict[str, str], float, str]:
    """Settings of the video for a view, whose files are copied, and its white; or none, and why."""
    if view == SourceView("sRGB", "Standard", "None"):
        return {}, 1.0, ""
    config = blender.color_config()
    if config is None:
        return {}, 1.0, f"{blender.program} has no {CONFIG} where it is expected"
    look = "" if view.look == "None" else view.look
    chosen = VideoSettings(ocio=str(config), display=view.display, view=view.view_transform, look=look)
    try:
        files, white = files_of_view(chosen), white_of(chosen)
    except SettingsError as error:
        return {}, 1.0, str(error)
    for file in files:
        copy = folder / COLORS / file.relative_to(config.parent)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file, copy)
    named = {"display": view.display, "view": view.view_transform, "look": look}
    return {"ocio": f"{COLORS}/{CONFIG}", **named}, white, ""


def _toml(tables: Mapping[str, Mapping[str, Any]]) -> str:
    """Tables of numbers and strings; JSON's strings are TOML's, but for escapes of surrogates."""
    lines = ["# Settings of the imported file, for --settings."]
    for name, table in tables.items():
        lines += [
            f"[{name}]",
            *(f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in table.items()),
        ]
    return "\n".join(lines) + "\n"
