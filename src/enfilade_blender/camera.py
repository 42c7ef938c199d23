# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera of every frame, as nerfstudio's ``camera_path.json``.

Blender's cameras look along -z with y up, as the file wants; the world stays Blender's, with z up.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from enfilade_blender.motion import Motion
from enfilade_blender.notes import Notes
from enfilade_blender.records import Selection, View

MM = 1000.0
FAR = 1000.0  # scene units from the origin
RAY_OFFSET = 9e-5  # of the distance from the origin, by which Mitsuba moves the origins of rays
SHEAR = 1e-3  # cosine of the angle of a picture's axes
KINDS = {"ORTHO": "an orthographic", "PANO": "a panoramic"}


def read_views(selection: Selection, motion: Motion, notes: Notes) -> list[View]:
    """The views of all frames, and their motion; empty without a perspective camera."""
    views: list[View] = []
    is_usable = True
    for frame in range(selection.frames[0], selection.frames[1] + 1):
        selection.scene.frame_set(frame)
        motion.look(frame)
        camera = selection.scene.camera
        is_usable = is_usable and _is_perspective(camera, notes)
        if is_usable:
            views.append(_view(camera, selection, notes))
    if not is_usable:
        return []
    _note_lenses(views, selection, notes)
    _note_distance(views, notes)
    return views


def camera_path(views: list[View], selection: Selection) -> dict[str, Any]:
    """Content of ``camera_path.json``.

    Beside nerfstudio's keys, a frame may have ``principal_point`` (shares of width and height, from the
    left and the top), ``aperture_radius`` and ``focus_distance`` (scene units); the path has ``cuts``
    (numbers of frames, from 1, that begin a shot) where markers bind cameras, ``shutter`` (share of a frame)
    and ``first_frame``, the number of its first frame in Blender.
    """
    render = selection.scene.render
    cuts = [i for i in range(2, len(views) + 1) if views[i - 1].name != views[i - 2].name]
    is_cut = any(marker.camera is not None for marker in selection.scene.timeline_markers)
    frames = [{"camera_to_world": view.pose.tolist(), "fov": view.fov_deg, **view.lens} for view in views]
    return {
        "camera_type": "perspective",
        "render_width": selection.size[0],
        "render_height": selection.size[1],
        "fps": render.fps / render.fps_base,
        "first_frame": selection.frames[0],
        **({"cuts": cuts} if is_cut else {}),  # else jumps are detected
        **({"shutter": render.motion_blur_shutter} if render.use_motion_blur else {}),
        "camera_path": frames,
    }


def _is_perspective(camera: Any, notes: Notes) -> bool:
    if camera is None or (camera.type == "CAMERA" and camera.data.type == "PERSP"):
        return camera is not None
    kind = camera.data.type if camera.type == "CAMERA" else f"{camera.type.lower()} as a"
    effect = "there is no camera path of the file: give one"
    what = f"{KINDS.get(kind, kind)} camera can't be exported"
    notes.add("not-carried", camera.name, "Camera", what, effect)
    return False


def _view(camera: Any, selection: Selection, notes: Notes) -> View:
    graph = bpy.context.evaluated_depsgraph_get()
    evaluated = camera.evaluated_get(graph)
    pose = np.eye(4)
    pose[:3, :3], tilt, is_sheared, is_mirrored = rigid(np.array(evaluated.matrix_world)[:3, :3])
    pose[:3, 3] = evaluated.matrix_world.translation
    if is_mirrored:
        what, effect = "its negative scale is left out", "the picture is not mirrored"
        notes.add("not-carried", camera.name, "Scale", what, effect)
    if is_sheared:
        what, effect = "the shear of its picture is left out", "edges of the picture are out of place"
        notes.add("approximated", camera.name, "Scale", what, effect)
    width, height = selection.size
    render = selection.scene.render
    projection = np.array(
        evaluated.calc_matrix_camera(
            graph, x=width, y=height, scale_x=render.pixel_aspect_x, scale_y=render.pixel_aspect_y
        ),
        np.float64,  # JSON has no place for the float32 that Blender 5.2 hands over
    )
    for axis in (0, 1):
        projection[axis, 2] -= projection[axis, axis] * tilt[axis]
        projection[axis, axis] *= tilt[2]
    lens: dict[str, Any] = {}
    if max(abs(projection[0, 2]), abs(projection[1, 2])) > 1e-6:
        lens["principal_point"] = [0.5 * (1.0 - projection[0, 2]), 0.5 * (1.0 + projection[1, 2])]
    data = evaluated.data
    if data.dof.use_dof:
        lens["aperture_radius"] = 0.5 * data.lens / MM / max(data.dof.aperture_fstop, 1e-3)
        lens["focus_distance"] = _focus(evaluated, graph)
    return View(camera.name, pose, projection, lens)


def rigid(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool, bool]:
    """The rotation nearest to the axes of a picture, as Cycles sees it below a turned parent of uneven scale.

    Cycles normalizes the columns of a camera's matrix, and leaves them oblique.

    Parameters
    ----------
    matrix : (3, 3) float64
        Linear part of the camera's matrix.

    Returns
    -------
    rotation : (3, 3) float64
    tilt : (3,) float64
        Third column in axes of the rotation: its first two move the picture, the last scales it.
    is_sheared : bool
        Whether the axes of the picture, which the rotation makes perpendicular, are not.
    is_mirrored : bool
        Whether the rotation has the opposite of the first column.
    """
    sizes = np.linalg.norm(matrix, axis=0)
    axes = matrix / sizes if sizes.all() else np.eye(3)
    is_mirrored = bool(np.linalg.det(axes) < 0.0)
    axes = axes * (-1.0 if is_mirrored else 1.0, 1.0, 1.0)
    left, _, right = np.linalg.svd(axes[:, :2], full_matrices=False)
    across, down = (left @ right).T
    rotation = np.stack([across, down, np.cross(across, down)], axis=1)
    return rotation, rotation.T @ axes[:, 2], bool(abs(axes[:, 0] @ axes[:, 1]) > SHEAR), is_mirrored


def _focus(camera: Any, graph: Any) -> float:
    """Distance of the focus along the optical axis, scene units."""
    target = camera.data.dof.focus_object
    if target is None:
        return float(camera.data.dof.focus_distance)
    place = target.evaluated_get(graph).matrix_world.translation
    axis = -(camera.matrix_world.to_3x3().col[2]).normalized()
    return float(abs((place - camera.matrix_world.translation).dot(axis)))


def _note_distance(views: list[View], notes: Notes) -> None:
    farthest = max(views, key=lambda view: np.abs(view.pose[:3, 3]).max())
    distance = np.abs(farthest.pose[:3, 3]).max()
    if distance > FAR:
        what = f"it is {distance:,.0f} units from the origin"
        effect = (
            f"shadows are lost within {distance * RAY_OFFSET:.2g} units of contacts: move the scene to the "
            "origin"
        )
        notes.add("approximated", farthest.name, "Location", what, effect)


def _note_lenses(views: list[View], selection: Selection, notes: Notes) -> None:
    for name in dict.fromkeys(view.name for view in views):
        lenses = [view.lens for view in views if view.name == name]
        if any("aperture_radius" in lens for lens in lenses):
            what = "in the camera path; used where the renderer has lenses"
            notes.add("not-carried", name, "Depth of field", what, "else everything is in focus")
    render = selection.scene.render
    if render.use_motion_blur:
        notes.add(
            "not-carried", selection.scene.name, "Motion blur", "in the camera path", "frames are sharp"
        )
    if render.pixel_aspect_x != render.pixel_aspect_y:
        what, effect = "pixels are taken as square", "the picture is stretched"
        notes.add("not-carried", selection.scene.name, "Pixel aspect", what, effect)
