# SPDX-License-Identifier: GPL-3.0-or-later
"""Opens a Blender file, or one that Blender imports, without its scripts; selects what is exported."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy

from enfilade_blender.failure import ExportError
from enfilade_blender.job import Job
from enfilade_blender.notes import Notes
from enfilade_blender.records import Selection
from enfilade_blender.usd import import_usd


def _import_fbx(file: str) -> None:
    # From Blender 5 on the importer in Python fails at lamps.
    (bpy.ops.wm.fbx_import if bpy.app.version >= (5, 0, 0) else bpy.ops.import_scene.fbx)(filepath=file)


IMPORTERS: dict[str, Callable[..., Any]] = {
    **dict.fromkeys(
        (".glb", ".gltf"), lambda file: bpy.ops.import_scene.gltf(filepath=file, import_pack_images=False)
    ),
    ".fbx": _import_fbx,
    ".obj": lambda file: bpy.ops.wm.obj_import(filepath=file),
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), import_usd),
}
HAVE_RATE = (".fbx", ".usd", ".usda", ".usdc", ".usdz")  # others have no frame rate
ALPHA_OF_FILES = {  # modes by the endings of files
    ".exr": "PREMUL",
    **dict.fromkeys((".png", ".webp", ".jp2", ".j2c", ".tga", ".bmp", ".jpg", ".jpeg"), "STRAIGHT"),
}
IMAGE_FILES = ("FILE", "SEQUENCE", "MOVIE", "TILED")  # sources of images that are read from the disk


def open_source(job: Job, notes: Notes) -> Selection:
    """Open the source of a job. Images of other folders are detached, with a note.

    Raises
    ------
    ExportError
        It is missing, damaged, of an unknown kind, uses a library of another folder, or lacks the selection.
    """
    if not job.source.is_file():
        raise ExportError("there is no such file", str(job.source), "check the path")
    suffix = job.source.suffix.lower()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.preferences.filepaths.use_scripts_auto_execute = False
    try:
        if suffix == ".blend":
            _check_is_blend(job.source)
            bpy.ops.wm.open_mainfile(filepath=str(job.source), load_ui=False, use_scripts=False)
            _check_libraries(job)
        elif suffix in IMPORTERS:
            IMPORTERS[suffix](str(job.source))
        else:
            raise ExportError("unknown kind of file", str(job.source), f"give .blend, {', '.join(IMPORTERS)}")
    except RuntimeError as error:  # of Blender's operators
        reason = str(error).strip().removeprefix("Error: ").splitlines()[0]
        raise ExportError(
            f"Blender can't open it: {reason}", str(job.source), "open it in Blender, and save it again"
        ) from error
    _note_newer(notes)
    _leave_modes()
    _detach_images(job, notes)
    _settle_alpha()
    _show_in_viewports()
    if suffix != ".blend":
        _take_camera(notes)
        _note_defaults(job, notes)
    return _select(job)


def _leave_modes() -> None:
    """Leave Edit Mode, in which meshes are empty, in all view layers."""
    window = bpy.context.window
    shown = window.scene, window.view_layer
    for scene in bpy.data.scenes:
        for layer in scene.view_layers:
            edited = [obj for obj in layer.objects if obj.mode == "EDIT"]
            if edited:
                window.scene, window.view_layer = scene, layer
                layer.objects.active = edited[0]
                bpy.ops.object.mode_set(mode="OBJECT")
    window.scene, window.view_layer = shown


def files_used(job: Job) -> list[str]:
    """Absolute paths of the libraries, images and other files that the open source uses."""
    files = {Path(name).resolve() for name in bpy.utils.blend_paths(absolute=True)}
    tiled = [image for image in bpy.data.images if image.source == "TILED" and image.filepath]
    files.update(Path(name).resolve() for image in tiled for name in _tiles(image))
    files.discard(job.source.resolve())
    return sorted(str(file) for file in files if file.is_file() and is_allowed(file, job))


def _tiles(image: Any) -> list[str]:
    """Names of the files of an image of tiles, whose name has a place for their numbers."""
    name = bpy.path.abspath(image.filepath, library=image.library)
    numbers = [tile.number - 1001 for tile in image.tiles]
    by_place = {number: f"u{number % 10 + 1}_v{number // 10 + 1}" for number in numbers}
    return [name.replace("<UDIM>", str(n + 1001)).replace("<UVTILE>", by_place[n]) for n in numbers]


def _take_camera(notes: Notes) -> None:
    """Choose the first camera, and the frames of its animation: importers leave the scene without them."""
    scene = bpy.context.scene
    cameras = sorted((one for one in scene.objects if one.type == "CAMERA"), key=lambda one: one.name)
    if scene.camera is None and cameras:
        scene.camera = cameras[0]
        for other in cameras[1:]:
            what = f"the file has several cameras, of which {cameras[0].name} is used"
            notes.add("not-carried", other.name, "", what, "choose this one by blender.camera")
    if scene.camera is not None:
        _take_frames(scene)


def _note_defaults(job: Job, notes: Notes) -> None:
    """Note the size and the rate of frames where they are Blender's."""
    render = bpy.context.scene.render
    if not job.size:
        size = f"{render.resolution_x}x{render.resolution_y} pixels"
        what, effect = "it has no size of frames", f"they have {size} unless --size says otherwise"
        notes.add("approximated", "the file", "Resolution", what, effect)
    if job.source.suffix.lower() not in HAVE_RATE:
        what, effect = "it has no frame rate", f"it is {render.fps} a second unless --fps says otherwise"
        notes.add("approximated", "the file", "Frame Rate", what, effect)


def _take_frames(scene: Any) -> None:
    """Frames of the animation of the camera, its lens and its parents; one without any.

    Constraints, by which USD animates objects, have no frames of their own: its importer sets the scene's.
    """
    moving = [scene.camera]
    while moving[-1].parent is not None:
        moving.append(moving[-1].parent)
    if any(obj.constraints for obj in moving):
        return
    animations = [data.animation_data for data in (*moving, scene.camera.data)]
    ranges = [animation.action.frame_range for animation in animations if animation and animation.action]
    first = round(min((begin for begin, _ in ranges), default=scene.frame_start))
    scene.frame_start = first
    scene.frame_end = max(round(max((end for _, end in ranges), default=first)), first)


def _check_is_blend(file: Path) -> None:
    """Refuse files that Blender would read as an empty scene."""
    with file.open("rb") as stream:
        start = stream.read(7)
    is_blend = start == b"BLENDER" or start[:4] == b"\x28\xb5\x2f\xfd" or start[:2] == b"\x1f\x8b"
    if not is_blend:
        raise ExportError(
            "this is no .blend file", str(file), "check the path; the file may be cut off or damaged"
        )


def is_allowed(file: Path, job: Job) -> bool:
    """Whether a file lies in the source's folder or in an allowed one."""
    folders = [job.source.resolve().parent, *(folder.resolve() for folder in job.library_folders)]
    return any(file.is_relative_to(folder) for folder in folders)


def _detach_images(job: Job, notes: Notes) -> None:
    """Images of files in other folders become missing ones: what is read may be written into the scene."""
    for image in bpy.data.images:
        if image.source not in IMAGE_FILES or image.packed_files or not image.filepath:
            continue
        file = Path(bpy.path.abspath(image.filepath, library=image.library)).resolve()
        is_missing = image.source == "FILE" and not file.is_file()  # which is noted where it is used
        if is_missing or is_allowed(file, job):
            continue
        what = f"its file {file} lies outside the allowed folders"
        notes.add("not-carried", image.name, "", what, f"the image is missing; allow {file.parent}")
        image.filepath = ""
        image.buffers_free()


def _note_newer(notes: Notes) -> None:
    """Note a file of a later Blender, of whose data this one may know a part only."""
    file, own = tuple(bpy.data.version[:2]), tuple(bpy.app.version[:2])
    if bpy.data.filepath and file > own:
        what = "the file is of Blender {}.{}, it was read by {}.{}".format(*file, *own)
        notes.add(
            "not-carried", "the file", "Version", what, "parts may be missing; give a newer blender.program"
        )


def _settle_alpha() -> None:
    """Alpha modes as Cycles has them: the type of an image's file decides whether alpha is straight."""
    for image in bpy.data.images:
        mode = ALPHA_OF_FILES.get(Path(image.filepath).suffix.lower())
        is_file = image.source in ("FILE", "TILED") and not image.packed_files
        if is_file and mode is not None and image.alpha_mode in ALPHA_OF_FILES.values():
            image.alpha_mode = mode


def _show_in_viewports() -> None:
    """Show in viewports what renders show, or may: Blender writes values of animations and drivers on these.

    What neither shows is not evaluated in every frame, and in no ray's way, unless something else needs it.
    """
    for item in (*bpy.data.objects, *bpy.data.collections):
        item.hide_viewport = item.hide_render and getattr(item, "animation_data", None) is None


def _check_libraries(job: Job) -> None:
    """Refuse libraries of other folders, or that are missing, but for such that no data is linked from.

    From Blender 5 on data may be packed into the file, as those of the essential assets are. A file that was
    saved while something was painted or sculpted links Blender's own brushes.
    """
    data = [of for of in bpy.data.user_map() if of.id_type != "BRUSH"]
    linked = {of.library for of in data if not getattr(of, "is_linked_packed", False)}
    for library in (library for library in bpy.data.libraries if library in linked):
        file = Path(bpy.path.abspath(library.filepath)).resolve()
        if not is_allowed(file, job):
            raise ExportError(
                f"it links the library {file}, outside the allowed folders",
                str(job.source),
                f"allow {file.parent}, or make the linked data local in Blender",
            )
        if not file.is_file():
            raise ExportError(
                f"its library {file} is missing", str(job.source), "put the library there, or relink it"
            )


def _select(job: Job) -> Selection:
    scene = _by_name(bpy.data.scenes, job.scene, "scene", job) if job.scene else bpy.context.scene
    bpy.context.window.scene = scene
    layers = [layer for layer in scene.view_layers if layer.use] or list(scene.view_layers)
    layer = _by_name(scene.view_layers, job.view_layer, "view layer", job) if job.view_layer else layers[0]
    bpy.context.window.view_layer = layer
    if job.camera:
        cameras = {obj.name: obj for obj in scene.objects if obj.type == "CAMERA"}
        scene.camera = _by_name(cameras, job.camera, "camera", job)
        for marker in scene.timeline_markers:
            marker.camera = None
    render = scene.render
    share = render.resolution_percentage / 100.0
    size = job.size or tuple(
        max(2, round(n * share) // 2 * 2) for n in (render.resolution_x, render.resolution_y)
    )
    return Selection(scene, layer, job.frames or (scene.frame_start, scene.frame_end), size)


def _by_name(items: Any, name: str, kind: str, job: Job) -> Any:
    if name not in items:
        names = ", ".join(sorted(items.keys()))
        advice = f"choose one of {names}" if names else f"add a {kind} to it"
        raise ExportError(f"it has no {kind} {name!r}", str(job.source), advice)
    return items[name]
