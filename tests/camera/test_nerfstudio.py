import copy

import numpy as np
import pytest

from enfilade.camera import load_path
from enfilade.camera.pinhole import look_at
from enfilade.errors import CameraPathError


def a_path(count=5):
    frames = [
        {"camera_to_world": look_at((0.1 * i, 1, 5), (0, 0, 0)).ravel().tolist(), "fov": 50.0, "aspect": 1.5}
        for i in range(count)
    ]
    return {
        "camera_type": "perspective",
        "render_width": 600,
        "render_height": 400,
        "fps": 24,
        "seconds": count / 24,
        "crop": None,
        "camera_path": frames,
    }


def changed(**keys):
    path = a_path()
    for key, value in keys.items():
        if value is None:
            del path[key]
        else:
            path[key] = value
    return path


def frame_changed(index, **keys):
    path = copy.deepcopy(a_path())
    path["camera_path"][index].update(keys)
    return path


def test_reads_poses_row_by_row(write):
    path = load_path(write(a_path()))
    assert len(path) == 5
    assert path.numbers == (1, 2, 3, 4, 5)
    assert (path.width, path.height, path.fps, path.cuts) == (600, 400, 24.0, frozenset())
    assert path.cameras[3].fov_deg == 50.0
    np.testing.assert_array_equal(path.cameras[3].world_from_camera, look_at((0.1 * 3, 1, 5), (0, 0, 0)))


def test_nested_matrices_are_the_same(write):
    nested = a_path()
    for frame in nested["camera_path"]:
        frame["camera_to_world"] = np.reshape(frame["camera_to_world"], (4, 4)).tolist()
    flat = load_path(write(a_path()))
    for a, b in zip(flat.cameras, load_path(write(nested)).cameras, strict=True):
        assert a.is_same_view(b)


def test_frame_rate_from_seconds_and_from_the_caller(write):
    assert load_path(write(changed(fps=None, seconds=2.5))).fps == 2.0
    faster = load_path(write(a_path()), fps=60.0)
    assert (faster.fps, len(faster)) == (60.0, 5)


def test_sudden_cuts_are_found(write):
    path = a_path(20)
    for i, frame in enumerate(path["camera_path"][12:]):
        frame["camera_to_world"] = look_at((40 + 0.1 * i, 1, 5), (60, 0, 0)).ravel().tolist()
    assert load_path(write(path)).cuts == {12}


def test_a_single_frame(write):
    path = load_path(write(a_path(1)))
    assert (len(path), path.cuts) == (1, frozenset())


def rotated_and(**entries):
    matrix = np.eye(4)
    for place, value in entries.items():
        matrix[int(place[1]), int(place[2])] = value
    return matrix.ravel().tolist()


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (changed(camera_type="fisheye"), "camera_type is 'fisheye'"),
        (changed(camera_type="equirectangular"), "only perspective"),
        (frame_changed(2, camera_type="fisheye"), "frame 3: camera_type"),
        (changed(camera_path=[]), "at least one frame"),
        (changed(camera_path={"a": 1}), "must be a list"),
        (changed(camera_path=[[1]]), "frame 1 must be an object"),
        (changed(fps=0), "fps is 0"),
        (changed(fps=-3), "fps is -3"),
        (changed(fps=0.009), "fps is 0.009; it must be from 0.01 to 10000"),
        (changed(fps=10_001), "fps is 10001; it must be from"),
        (changed(fps=None, seconds=1e-4), "5 frames in 0.0001 seconds are 50000 a second"),
        (changed(fps=True), "fps holds True; expected a number"),
        (changed(fps="24"), "fps holds '24'; expected a number"),
        (changed(fps=None, seconds=None), "fps is missing"),
        (changed(render_width=100_000), "render_width is 100000; it must be a whole number from 1 to 16384"),
        (changed(render_width=640.5), "render_width is 640.5"),
        (changed(render_height=None), "render_height is missing"),
        (frame_changed(1, fov=180), "frame 2: fov is 180 degrees"),
        (frame_changed(1, fov=None), "frame 2: fov is missing"),
        (frame_changed(1, camera_to_world=[1, 2, 3]), "frame 2: camera_to_world .* list of 16 numbers"),
        (frame_changed(1, camera_to_world=[[1, 0], [0, 1], [1], [2]]), "frame 2: camera_to_world"),
        (frame_changed(1, camera_to_world=None), "frame 2: camera_to_world"),
        (frame_changed(4, camera_to_world=rotated_and(e03=float("nan"))), "frame 5: .* NaN"),
        (frame_changed(4, camera_to_world=rotated_and(e03=float("inf"))), "frame 5: .* infinite"),
        (frame_changed(4, camera_to_world=[10**400] * 16), "frame 5: .* large"),
        (frame_changed(3, camera_to_world=rotated_and(e00=2.0)), "frame 4: the pose is not rigid"),
        (frame_changed(3, camera_to_world=rotated_and(e00=-1.0)), "frame 4: .* mirror image"),
        (frame_changed(3, camera_to_world=rotated_and(e30=1.0)), "frame 4: the last row"),
        (frame_changed(3, camera_to_world=[True] * 16), "frame 4: .* True"),
    ],
)
def test_wrong_input_is_named(write, content, problem):
    with pytest.raises(CameraPathError, match=f"walk.json.*{problem}"):
        load_path(write(content))
