import numpy as np
import pytest

from enfilade.camera import load_path
from enfilade.camera.pinhole import look_at
from enfilade.errors import CameraPathError

POSES = look_at([(0.1 * i, 1, 5) for i in range(5)], (0, 0, 0))


def document(poses=POSES, **keys):
    frames = [{"camera_to_world": pose.tolist(), "fov": 50.0, "aspect": 1.5} for pose in poses]
    values = {
        "camera_type": "perspective",
        "render_width": 600,
        "render_height": 400,
        "fps": 24,
        "crop": None,
    }
    return {**values, "camera_path": frames, **keys}


@pytest.mark.parametrize("shape", [(16,), (4, 4)])
def test_poses_are_read_bit_by_bit(write, shape):
    path = load_path(write(document(POSES.reshape(-1, *shape))))
    assert path.numbers == (1, 2, 3, 4, 5)
    assert (path.width, path.height, path.fps, path.cuts) == (600, 400, 24.0, frozenset())
    for camera, pose in zip(path.cameras, POSES, strict=True):
        np.testing.assert_array_equal(camera.world_from_camera, pose)
        assert camera.fov_deg == 50.0


def test_lens_shift_is_read(write):
    shifted = document()
    shifted["camera_path"][1]["principal_point"] = [0.5, 0.7]
    assert [camera.principal_point for camera in load_path(write(shifted)).cameras[:2]] == [
        (0.5, 0.5),
        (0.5, 0.7),
    ]
    shifted["camera_path"][2]["principal_point"] = [0.5]
    with pytest.raises(CameraPathError, match=r"frame 3: principal_point is \[0.5\]; expected a list of 2"):
        load_path(write(shifted))


def test_another_frame_rate_keeps_the_frames(write):
    assert load_path(write(document(fps=None, seconds=2.5))).fps == 2.0
    path = load_path(write(document(fps=None)), fps=60.0)
    assert (path.fps, len(path)) == (60.0, 5)


def test_cuts_are_detected(write):
    eyes = np.array([(0.1 * i + 40 * (i >= 12), 1, 5) for i in range(20)])
    assert load_path(write(document(look_at(eyes, eyes - (0, 0, 1))))).cuts == {12}
    assert load_path(write(document(POSES[:1]))).cuts == frozenset()


def test_marked_cuts_replace_detection(write):
    eyes = np.array([(0.1 * i + 40 * (i >= 12), 1, 5) for i in range(20)])
    poses = look_at(eyes, eyes - (0, 0, 1))
    assert load_path(write(document(poses, cuts=[3, 9]))).cuts == {2, 8}
    assert load_path(write(document(poses, cuts=[]))).cuts == frozenset()
    for wrong in (3, [1], [21], [2.5], ["2"]):
        with pytest.raises(CameraPathError, match=r"walk.json: cuts is"):
            load_path(write(document(poses, cuts=wrong)))


def test_frames_are_numbered_from_the_first_one(write):
    file = write(document(first_frame=101, cuts=[4]))
    assert load_path(file).numbers == (101, 102, 103, 104, 105)
    chosen = load_path(file, frames=(102, 103, 105))
    assert (chosen.numbers, chosen.cuts) == ((102, 103, 105), {2})
    np.testing.assert_array_equal(chosen.cameras[2].world_from_camera, POSES[4])
    with pytest.raises(CameraPathError, match="frame 1 is not on the path; it has 101-105"):
        load_path(file, frames=(1,))


@pytest.mark.parametrize("value", [0, 0.009, 10_001, True, "24", [24], float("nan"), float("inf"), 10**400])
def test_malformed_numbers(write, value):
    with pytest.raises(CameraPathError, match=r"walk.json: fps is .*; expected a number from 0.01 to 10000"):
        load_path(write(document(fps=value)))


@pytest.mark.parametrize(
    "value",
    [None, [1, 2, 3], [[1, 0], [0, 1], [1], [2]], [*[0] * 15, True], [*[0.5] * 15, 10**400]],
)
def test_malformed_matrices(write, value):
    path = document()
    path["camera_path"][1]["camera_to_world"] = value
    problem = "camera_to_world is .*; expected a list of 16 numbers"
    with pytest.raises(CameraPathError, match=rf"walk.json, frame 2: {problem}"):
        load_path(write(path))


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (document(camera_type="fisheye"), "camera_type is 'fisheye'; only perspective"),
        (document(camera_path=[]), r"camera_path is \[\]; expected a list of at least one frame"),
        (document(camera_path={"a": 1}), "camera_path is {'a': 1}; expected a list"),
        (document(camera_path=[[1]]), "frame 1 is .*; expected an object"),
        (document(camera_path=[{"camera_to_world": np.eye(4).tolist()}]), "frame 1: fov is missing"),
        (document(2.0 * POSES), "frame 1: the last row of a pose"),
        (document(POSES * (2, 1, 1, 1)), "frame 1: the pose is not rigid"),
        (document(camera_path=[{"camera_type": "fisheye"}]), "frame 1: camera_type is 'fisheye'"),
        (document(fps=None, seconds=1e-4), "seconds is 0.0001; expected a number from 0.0005 to 500"),
        (document(fps=None), "fps is missing; expected a number"),
        (document(render_width=100_000), "render_width is 100000; expected a whole number from 1 to 16384"),
        (document(render_width=640.5), "render_width is 640.5"),
        (document(render_height=None), "render_height is missing"),
    ],
)
def test_malformed_files(write, content, problem):
    with pytest.raises(CameraPathError, match=f"walk.json.*{problem}"):
        load_path(write(content))
