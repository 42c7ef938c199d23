import subprocess
import sys

import pytest

from enfilade.camera import load_path
from enfilade.errors import CameraPathError


def a_path(**more):
    keys = [
        {"time": 0, "eye": [0, 1, 5], "target": [0, 0, 0], "fov": 40},
        {"time": 1, "eye": [1, 1, 5], "target": [0, 0, 0]},
        {"time": 1.2, "eye": [9, 1, 5], "target": [0, 0, 0], "cut": True},
        {"time": 2.9, "eye": [10, 1, 5], "target": [0, 0, 0]},
    ]
    return {"format": "enfilade-path", "fps": 10, "size": [640, 480], "keys": keys, **more}


def test_a_selection_is_a_path_of_its_own(write):
    file = write(a_path())
    whole, some = load_path(file), load_path(file, frames=(3, 5, 20, 25))
    assert (whole.width, whole.height, whole.fps) == (640, 480, 10.0)
    assert (whole.numbers, whole.cuts) == (tuple(range(1, 31)), {12})
    assert (some.numbers, some.cuts) == ((3, 5, 20, 25), {2})
    assert all(c.is_same_view(whole.cameras[n - 1]) for c, n in zip(some.cameras, some.numbers, strict=True))


@pytest.mark.parametrize(("frames", "cuts"), [((13, 14), set()), ((1, 12), set()), ((12, 13), {1})])
def test_cuts_between_selected_frames_only(write, frames, cuts):
    assert load_path(write(a_path()), frames=frames).cuts == cuts


def test_sizes(write):
    assert load_path(write(a_path()), size=(320, 240)).height == 240
    assert load_path(write(a_path(size=[1920, 1080])), size=(854, 480)).width == 854  # within a pixel
    assert load_path(write(a_path(size=None)), size=(100, 50)).width == 100
    with pytest.raises(CameraPathError, match=r"walk.json: the file has no image size; give one by --size"):
        load_path(write(a_path(size=None)))


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ({"size": (640, 360)}, "640x360 does not fit the aspect of the path's size, 640x480; 640x480 would"),
        ({"size": (0, 0)}, "0x0 is no image size"),
        ({"size": (20000, 15000)}, "20000x15000 .* 16384"),
        ({"frames": (1, 31)}, "walk.json: frame 31 is not on the path; it has 1-30"),
        ({"frames": (0,)}, "frame 0 is not"),
        ({"frames": ()}, "at least one frame"),
        ({"frames": (3, 2)}, "in rising order"),
        ({"fps": 0.0}, "0 frames per second is out of range; give 0.01 to 10000"),
        ({"fps": 10_001.0}, "10001 frames per second"),
        ({"fps": float("nan")}, "nan frames per second"),
    ],
)
def test_wrong_arguments(write, arguments, problem):
    with pytest.raises(CameraPathError, match=problem):
        load_path(write(a_path()), **arguments)


@pytest.mark.parametrize(
    "content", [b"", b"{", b"[" * 100_000, b'{"a": ' + b"9" * 5000 + b"}", b"\xff\xfe\x00"]
)
def test_files_that_are_not_json(tmp_path, content):
    (tmp_path / "walk.json").write_bytes(content)
    with pytest.raises(CameraPathError, match=r"walk\.json is not valid JSON"):
        load_path(tmp_path / "walk.json")


def test_files_without_a_path(write, tmp_path):
    for content, problem in (("[1]", "must hold a JSON object"), ("{}", "no camera path: expected")):
        with pytest.raises(CameraPathError, match=rf"walk\.json.*{problem}"):
            load_path(write(content))
    for file, problem in ((tmp_path / "none.json", "No such file"), (tmp_path, "directory")):
        with pytest.raises(CameraPathError, match=f"can't read the camera path {file}.*{problem}"):
            load_path(file)


def test_the_import_is_light():
    code = "import sys, enfilade.camera; print('scipy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)  # noqa: S603
    assert done.stdout.strip() == "False"
