"""nerfstudio's ``camera_path.json``: a camera for every frame.

Source: ``get_path_from_json`` in nerfstudio/cameras/camera_paths.py, and the export of its viewer. Poses are
row-major 4x4 matrices from camera to world in OpenGL axes, ``fov`` is vertical, in degrees. Three keys are
additions of ours: ``first_frame`` is the number of the first frame, ``cuts`` lists the frames that begin a
shot, counted from 1, and ``principal_point`` of a frame shifts its lens (shares of width and height, from the
top left). Other keys, of radiance fields (``crop``, ``render_time``) and of the viewer
(``keyframes``), are ignored.
"""

from __future__ import annotations

from reprlib import repr as shorten

import numpy as np

from enfilade.camera.cuts import find_cuts
from enfilade.camera.fields import FOV_DEG, FPS, JsonObject
from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import CENTRE, Camera
from enfilade.errors import CameraPathError

PRINCIPAL_POINT = (-4.0, 5.0)
FRAME_NUMBER = (-1_000_000.0, 1_000_000.0)


def read_nerfstudio(document: JsonObject, size: tuple[int, int], fps: float | None = None) -> CameraPath:
    """Cameras of all frames, with the file's cuts or detected ones; `fps` replaces the file's frame rate."""
    frames = document.objects("camera_path", "frame")
    for entry in (document, *frames):
        kind = entry.values.get("camera_type", "perspective")
        if kind != "perspective":
            raise entry.error(f"camera_type is {shorten(kind)}; only perspective cameras are supported")
    if fps is None and "seconds" in document and "fps" not in document:
        fps = len(frames) / document.number("seconds", (len(frames) / FPS[1], len(frames) / FPS[0]))
    cameras = tuple(_camera(frame, size) for frame in frames)
    if "cuts" in document:
        cuts = _marked_cuts(document, len(cameras))
    else:
        cuts = find_cuts(np.stack([camera.world_from_camera for camera in cameras]))
    first = int(document.number("first_frame", FRAME_NUMBER, whole=True, default=1))
    numbers = tuple(range(first, first + len(cameras)))
    return CameraPath(cameras, numbers, fps or document.number("fps", FPS), cuts)


def _marked_cuts(document: JsonObject, count: int) -> frozenset[int]:
    listed = document.values["cuts"]
    if not isinstance(listed, list):
        raise document.error(f"cuts is {shorten(listed)}; expected a list of frames")
    marked = document.array("cuts", (len(listed),), within=(2.0, float(max(count, 2))), whole=True)
    return frozenset(int(number) - 1 for number in marked)


def _camera(frame: JsonObject, size: tuple[int, int]) -> Camera:
    pose = frame.array("camera_to_world", (16,), (4, 4)).reshape(4, 4)
    fov_deg = frame.number("fov", FOV_DEG)
    x, y = frame.array("principal_point", (2,), within=PRINCIPAL_POINT, default=CENTRE)
    try:
        return Camera(pose, fov_deg, *size, principal_point=(float(x), float(y)))
    except CameraPathError as error:
        raise frame.error(str(error)) from error
