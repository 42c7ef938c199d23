"""nerfstudio's ``camera_path.json``: a camera for every frame.

Source: ``get_path_from_json`` in nerfstudio/cameras/camera_paths.py, and what its viewer exports. Poses are
row-major 4x4 matrices from camera to world in OpenGL axes, ``fov`` is vertical, in degrees. What concerns
radiance fields alone (``crop``, ``keyframes``, ``render_time``) is passed over.
"""

from __future__ import annotations

import reprlib

import numpy as np

from enfilade.camera.cuts import find_jumps
from enfilade.camera.fields import LARGEST_SIZE, LEAST_FPS, MOST_FPS, Table
from enfilade.camera.pinhole import Matrix, check_rigid
from enfilade.camera.shots import Shots
from enfilade.errors import CameraPathError


def read_nerfstudio(table: Table, *, fps: float | None = None) -> Shots:
    """Read every frame's pose.

    Parameters
    ----------
    table
        The whole file.
    fps
        Replaces the file's frame rate; the frames stay as they are.

    Raises
    ------
    CameraPathError
        Something is missing or malformed, or the camera is not a perspective one.
    """
    kind = table.values.get("camera_type", "perspective")
    if kind != "perspective":
        raise table.fail(f"camera_type is {reprlib.repr(kind)}; only perspective cameras can be rendered")
    frames = table.tables("camera_path", "frame")
    for frame in frames:
        own = frame.values.get("camera_type", "perspective")
        if own != "perspective":
            raise frame.fail(f"camera_type is {reprlib.repr(own)}; only perspective cameras can be rendered")
    poses = np.stack([_pose(frame) for frame in frames])
    size = _size(table)
    return Shots(
        poses=poses,
        fov_deg=np.array([frame.fov() for frame in frames]),
        fps=fps or _fps(table, len(frames)),
        size=size,
        aspect=_aspect(frames, size),
        cuts=find_jumps(poses),
    )


def _pose(frame: Table) -> Matrix:
    value = frame.values.get("camera_to_world")
    if isinstance(value, list) and len(value) == 4 and all(isinstance(row, list) for row in value):
        value = [entry for row in value for entry in row]
    flat = Table({"camera_to_world": value}, frame.where)
    matrix = flat.vector("camera_to_world", 16).reshape(4, 4)
    try:
        check_rigid(matrix)
    except CameraPathError as error:
        raise frame.fail(str(error)) from error
    return matrix


def _size(table: Table) -> tuple[int, int] | None:
    if "render_width" not in table and "render_height" not in table:
        return None
    return (
        table.integer("render_width", least=1, most=LARGEST_SIZE),
        table.integer("render_height", least=1, most=LARGEST_SIZE),
    )


def _aspect(frames: list[Table], size: tuple[int, int] | None) -> float | None:
    if size is not None:
        return size[0] / size[1]
    return frames[0].positive("aspect") if "aspect" in frames[0] else None


def _fps(table: Table, count: int) -> float:
    if "fps" in table or "seconds" not in table:
        return table.fps()
    seconds = table.positive("seconds")
    rate = count / seconds
    if not LEAST_FPS <= rate <= MOST_FPS:
        raise table.fail(
            f"{count} frames in {seconds:g} seconds are {rate:g} a second; "
            f"they must be from {LEAST_FPS:g} to {MOST_FPS:g}"
        )
    return rate
