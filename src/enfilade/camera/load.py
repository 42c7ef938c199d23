"""Camera paths from files: the format is recognized, frames are selected, the image size is checked."""

from __future__ import annotations

from bisect import bisect_left
from itertools import pairwise
from pathlib import Path

from enfilade.camera.fields import LARGEST_SIZE, LEAST_FPS, MOST_FPS, read_table
from enfilade.camera.keyed import FORMAT, read_keyed
from enfilade.camera.nerfstudio import read_nerfstudio
from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera
from enfilade.camera.shots import Shots
from enfilade.errors import CameraPathError

ASPECT_TOLERANCE = 0.01  # relative; even sizes of a few hundred pixels miss an aspect by less


def load_path(
    file: Path,
    *,
    size: tuple[int, int] | None = None,
    frames: tuple[int, ...] | None = None,
    fps: float | None = None,
) -> CameraPath:
    """Read a camera path: nerfstudio's ``camera_path.json`` or keyed poses (docs/camera-paths.md).

    Parameters
    ----------
    file
    size
        Width and height of the images, pixels; the file's own by default.
    frames
        Numbers of the frames to take, rising; the first camera of the file is frame 1. What is left is a
        walkthrough of its own: the frame after 1 of ``1,3,5`` is 3, and flow goes from one to the other.
    fps
        Frames per second in place of the file's, from 0.01 to 10000. Keyed poses are sampled at this rate; a
        nerfstudio path keeps its frames and plays faster or slower.

    Raises
    ------
    CameraPathError
        The file is missing or malformed, a pose is not rigid, a frame is not on the path, the size does
        not fit the path's aspect, or the frame rate is out of range.
    """
    if fps is not None and not LEAST_FPS <= fps <= MOST_FPS:
        raise CameraPathError(
            f"{fps:g} frames per second can't be rendered; give {LEAST_FPS:g} to {MOST_FPS:g}"
        )
    table = read_table(file)
    if table.values.get("format") == FORMAT:
        shots = read_keyed(table, fps=fps)
    elif "camera_path" in table.values:
        shots = read_nerfstudio(table, fps=fps)
    else:
        raise table.fail(
            f'no camera path: expected "format": "{FORMAT}", or a "camera_path" as nerfstudio exports it'
        )
    return _select(shots, _image_size(shots, size, file), frames, file)


def _image_size(shots: Shots, size: tuple[int, int] | None, file: Path) -> tuple[int, int]:
    if size is None:
        if shots.size is None:
            raise CameraPathError(f"{file} does not say how large the images are; give a size")
        return shots.size
    width, height = size
    if not (1 <= width <= LARGEST_SIZE and 1 <= height <= LARGEST_SIZE):
        raise CameraPathError(
            f"images of {width}x{height} pixels can't be rendered; each side must be 1 to {LARGEST_SIZE}"
        )
    if shots.aspect is not None and not _fits(width, height, shots.aspect):
        fitting = max(2 * round(0.5 * width / shots.aspect), 2)
        asked = f"{shots.size[0]}x{shots.size[1]}" if shots.size else f"aspect {shots.aspect:.4g}"
        raise CameraPathError(
            f"{width}x{height} does not fit the aspect of {file} ({asked}); {width}x{fitting} would"
        )
    return size


def _fits(width: int, height: int, aspect: float) -> bool:
    exact = width / aspect  # small images may miss it by a pixel: heights are whole, and even for video
    return abs(height / exact - 1.0) <= ASPECT_TOLERANCE or abs(height - exact) <= 1.0


def _select(shots: Shots, size: tuple[int, int], frames: tuple[int, ...] | None, file: Path) -> CameraPath:
    count = len(shots.poses)
    numbers = tuple(range(1, count + 1)) if frames is None else frames
    if not numbers:
        raise CameraPathError(f"no frames of {file} are selected; it has 1-{count}")
    for number in numbers:
        if not 1 <= number <= count:
            raise CameraPathError(f"frame {number} is not on the path {file}; it has 1-{count}")
    if any(b <= a for a, b in pairwise(numbers)):
        raise CameraPathError("the selected frames must rise, each named once")
    cameras = tuple(Camera(shots.poses[n - 1], float(shots.fov_deg[n - 1]), *size) for n in numbers)
    # a cut belongs to the first selected frame at or after it; index n is frame number n + 1
    cuts = {bisect_left(numbers, cut + 1) for cut in shots.cuts} - {0, len(numbers)}
    return CameraPath(cameras, numbers, shots.fps, frozenset(cuts))
