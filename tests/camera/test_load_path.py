import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enfilade.camera import load_path
from enfilade.camera.load import _fits
from enfilade.errors import CameraPathError


def a_path(**more):
    keys = [
        {"time": 0, "eye": [0, 1, 5], "target": [0, 0, 0], "fov": 40},
        {"time": 1, "eye": [1, 1, 5], "target": [0, 0, 0]},
        {"time": 1.2, "eye": [9, 1, 5], "target": [0, 0, 0], "cut": True},
        {"time": 2.9, "eye": [10, 1, 5], "target": [0, 0, 0]},
    ]
    return {"format": "enfilade-path", "fps": 10, "size": [640, 480], "keys": keys, **more}


def test_all_frames_by_default(write):
    path = load_path(write(a_path()))
    assert path.numbers == tuple(range(1, 31))
    assert (path.width, path.height, path.fps, path.cuts) == (640, 480, 10.0, {12})


def test_a_selection_is_a_walkthrough_of_its_own(write):
    file = write(a_path())
    whole, some = load_path(file), load_path(file, frames=(3, 5, 20, 25))
    assert some.numbers == (3, 5, 20, 25)
    assert some.cuts == {2}
    assert all(c.is_same_view(whole.cameras[n - 1]) for c, n in zip(some.cameras, some.numbers, strict=True))
    assert [len(shot) for shot in some.shots()] == [2, 2]


def test_no_cut_where_only_one_shot_is_selected(write):
    file = write(a_path())
    assert load_path(file, frames=(13, 14)).cuts == frozenset()
    assert load_path(file, frames=(1, 12)).cuts == frozenset()
    assert load_path(file, frames=(12, 13)).cuts == {1}


def test_another_size_of_the_same_aspect(write):
    path = load_path(write(a_path()), size=(320, 240))
    assert (path.width, path.height) == (320, 240)
    assert load_path(write(a_path(size=[1920, 1080])), size=(854, 480)).width == 854


@given(st.integers(1, 16384), st.floats(0.2, 5.0))
def test_the_size_that_is_proposed_fits(width, aspect):
    assert _fits(width, max(2 * round(0.5 * width / aspect), 2), aspect) or width / aspect < 1


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ({"size": (640, 360)}, "640x360 does not fit the aspect of .*walk.json .640x480.; 640x480 would"),
        ({"size": (0, 0)}, "0x0"),
        ({"size": (20000, 15000)}, "20000x15000 .* 16384"),
        ({"frames": (1, 31)}, "frame 31 is not on the path .*walk.json; it has 1-30"),
        ({"frames": (0,)}, "frame 0 is not"),
        ({"frames": (-1, 3)}, "frame -1 is not"),
        ({"frames": ()}, "no frames"),
        ({"frames": (3, 2)}, "must rise"),
        ({"fps": 0.0}, "0 frames per second"),
        ({"fps": 0.009}, "0.009 frames per second .* give 0.01 to 10000"),
        ({"fps": 10_001.0}, "10001 frames per second"),
        ({"fps": float("nan")}, "nan frames per second"),
    ],
)
def test_wrong_arguments_are_named(write, arguments, problem):
    with pytest.raises(CameraPathError, match=problem):
        load_path(write(a_path()), **arguments)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("", "not valid JSON"),
        ("{", "not valid JSON"),
        ("[" * 100_000, "not valid JSON"),
        ('{"a": ' + "9" * 5000 + "}", "not valid JSON"),
        ("[1, 2]", "must hold a JSON object"),
        ("{}", "no camera path"),
        ('{"format": "enfilade-path"}', "fps is missing"),
        ('{"format": "enfilade-path", "fps": 10}', "keys must be a list"),
    ],
)
def test_wrong_files_are_named(write, content, problem):
    with pytest.raises(CameraPathError, match=rf"walk\.json.*{problem}"):
        load_path(write(content))


def test_files_that_cannot_be_read_are_named(tmp_path):
    with pytest.raises(CameraPathError, match="No such file"):
        load_path(tmp_path / "none.json")
    with pytest.raises(CameraPathError, match="directory"):
        load_path(tmp_path)
    binary = tmp_path / "walk.json"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(CameraPathError, match="not valid JSON"):
        load_path(binary)


def test_a_path_without_size_needs_one(write):
    content = a_path()
    del content["size"]
    with pytest.raises(CameraPathError, match="give a size"):
        load_path(write(content))
    path = load_path(write(content), size=(100, 50))
    assert np.isclose(path.cameras[0].fov_deg, 40)
