"""Camera paths from files: format, image size, selection of frames."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

from enfilade.camera.fields import FPS, SIDE_PX, JsonObject, read_object
from enfilade.camera.nerfstudio import read_nerfstudio
from enfilade.camera.path import CameraPath
from enfilade.errors import CameraPathError

KEYED_FORMAT = "enfilade-path"
ASPECT_TOLERANCE = 0.01  # relative; even sizes of a few hundred pixels deviate by less


def load_path(
    file: Path | str,
    *,
    size: tuple[int, int] | None = None,
    frames: tuple[int, ...] | None = None,
    fps: float | None = None,
) -> CameraPath:
    """Read a camera path: nerfstudio's ``camera_path.json`` or keyed poses (docs/formats.md).

    Parameters
    ----------
    file
    size
        Width and height of the images, pixels; the file's own by default.
    frames
        Numbers of the selected frames, rising; the first camera is frame 1, or what the file says. A
        selection is a path of its own: in ``1,3,5`` the frame after 1 is 3, and motion vectors lead from one
        to the other.
    fps
        Frames per second in place of the file's, from 0.01 to 10000. Keyed poses are sampled at this rate; a
        nerfstudio path keeps its frames and plays faster or slower.

    Raises
    ------
    CameraPathError
        The file is missing or malformed, a pose is not rigid, a frame is not on the path, the size does
        not fit the path's aspect, or the frame rate is out of range.
    """
    if fps is not None and not FPS[0] <= fps <= FPS[1]:
        raise CameraPathError(f"{fps:g} frames per second is out of range; give {FPS[0]:g} to {FPS[1]:g}")
    file = Path(file)
    document = read_object(file)
    if document.values.get("format") == KEYED_FORMAT:
        from enfilade.camera.keyed import read_keyed  # imports parts of SciPy that load slowly

        path = read_keyed(document, _image_size(document, size), fps)
    elif "camera_path" in document.values:
        path = read_nerfstudio(document, _image_size(document, size), fps)
    else:
        raise document.error(
            f'no camera path: expected "format": "{KEYED_FORMAT}", or "camera_path" as exported by nerfstudio'
        )
    return path if frames is None else _select(document, path, frames)


def check_size(width: int, height: int) -> None:
    """Refuse images that are too small or too large, by a CameraPathError."""
    if not all(SIDE_PX[0] <= side <= SIDE_PX[1] for side in (width, height)):
        raise CameraPathError(f"{width}x{height} is no image size; each side must be 1 to {SIDE_PX[1]:g}")


def _image_size(document: JsonObject, size: tuple[int, int] | None) -> tuple[int, int]:
    own: list[int] = []
    if "size" in document:
        own = document.array("size", (2,), within=SIDE_PX, whole=True).astype(int).tolist()
    elif "render_width" in document or "render_height" in document:
        own = [int(document.number(f"render_{side}", SIDE_PX, whole=True)) for side in ("width", "height")]
    if not size and not own:
        raise document.error("the file has no image size; give one by --size WIDTHxHEIGHT")
    width, height = size or own
    check_size(width, height)
    exact = width * own[1] / own[0] if own else height
    # small images may deviate by a pixel: videos have even heights
    if abs(height / exact - 1.0) > ASPECT_TOLERANCE and abs(height - exact) > 1.0:
        raise document.error(
            f"{width}x{height} does not fit the aspect of the path's size, {own[0]}x{own[1]}; "
            f"{width}x{max(2 * round(0.5 * exact), 2)} would"
        )
    return width, height


def _select(document: JsonObject, path: CameraPath, numbers: tuple[int, ...]) -> CameraPath:
    if not numbers or any(b <= a for a, b in pairwise(numbers)):
        raise document.error("select at least one frame, and each once, in rising order")
    first, last = path.numbers[0], path.numbers[-1]
    for number in numbers:
        if not first <= number <= last:
            raise document.error(f"frame {number} is not on the path; it has {first}-{last}")
    return path.select(numbers)
