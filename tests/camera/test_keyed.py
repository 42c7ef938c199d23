import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from enfilade.camera.fields import JsonObject
from enfilade.camera.keyed import interpolate_rotations, read_keyed
from enfilade.errors import CameraPathError

DOCS = Path(__file__).parents[2] / "docs" / "formats.md"


def key(time, eye=(0, 1, 5), **more):
    pose = {} if "rotation" in more else {"target": [0, 1, 0]}
    return {"time": time, "eye": list(eye), "fov": 50, **pose, **more}


def read(keys, *, at=None, **more):
    values = {"format": "enfilade-path", "fps": 10, "keys": keys, **more}
    return read_keyed(JsonObject(values, "walk.json"), (640, 480), fps=at)


def poses(path):
    return np.stack([camera.world_from_camera for camera in path.cameras])


def x_of(path):
    return poses(path)[:, 0, 3]


def test_two_keys_give_uniform_motion_that_includes_both():
    path = read([key(0), key(2, (4, 1, 5))])
    np.testing.assert_allclose(x_of(path), np.linspace(0, 4, 21), atol=1e-12)
    assert (path.numbers, path.cuts, path.fps) == (tuple(range(1, 22)), frozenset(), 10.0)


@pytest.mark.parametrize(("rate", "count"), [(20.0, 40), (5.0, 10), (10.0, 20), (12.5, 25)])
def test_another_frame_rate_samples_the_same_motion(rate, count):
    path = read([key(0), key(2, (4, 2, 5))], frames=20, at=rate)
    assert (len(path), path.fps) == (count, rate)
    np.testing.assert_allclose(x_of(path), 2.0 * np.arange(count) / rate, atol=1e-12)


@pytest.mark.parametrize(
    ("keys", "more", "count"),
    [
        ([key(0), key(1)], {}, 11),
        ([key(4)], {"frames": 7}, 7),
        ([key(4)], {"seconds": 1.5}, 15),
        ([key(4)], {"seconds": 0.01}, 1),
        ([key(4, hold=1)], {}, 11),
        ([key(0), key(1)], {"seconds": 1}, 10),
        ([key(0), key(1)], {"frames": 20}, 20),
        ([key(0), key(1)], {"fps": None, "frames": 7, "at": 24.0}, 7),
    ],
)
def test_lengths(keys, more, count):
    path = read(keys, **more)
    assert len(path) == count
    assert path.distinct_frames == (0,)


@pytest.mark.parametrize("pose", [{}, {"rotation": [0.8, 0.6, 0, 0]}])
def test_holds_and_the_last_pose_are_real_stops(pose):
    path = read([key(0), key(1, (2, 1, 5), hold=1.0, **pose), key(3, (6, 1, 5))], frames=40)
    assert path.distinct_frames == (*range(11), *range(21, 31))
    speed = np.diff(x_of(path))
    assert (speed >= 0).all()
    assert speed[9] < 0.3 * speed[0]  # gentle arrival


def test_targets_stay_in_the_middle_of_the_image():
    for camera in read([key(0), key(1, (3, 2, 1)), key(2, (5, 0, -2))]).cameras:
        aim = np.linalg.inv(camera.world_from_camera) @ (0, 1, 0, 1)
        assert np.abs(aim[:2]).max() < 1e-9
        assert aim[2] < 0


@pytest.mark.parametrize(
    ("times", "hold", "begin"),
    [
        ([0, 1, 2], 0, 20),
        ([0, 1, 1.05], 0, 11),
        ([0, 1, 1], 0, 10),
        ([0, 1, 1.2], 0.2, 12),
        ([0, 0.1, 0.3], 0.2, 3),
        ([0, 1, 1.01, 1.02], 0, 11),
    ],
)
def test_the_camera_rests_until_a_cut(times, hold, begin):
    first, last, *cuts = times
    shots = [key(t, (3 + n, 1, 5), cut=True) for n, t in enumerate(cuts)]
    path = read([key(first), key(last, (1, 1, 5), hold=hold), *shots], seconds=3)
    x, rest = x_of(path), round(10 * last)
    assert path.cuts == {begin}
    assert (x[:rest] < 1).all()
    np.testing.assert_allclose(x[rest:begin], 1, atol=1e-12)
    assert (x[begin:] == shots[-1]["eye"][0]).all()


def test_zoom_and_inherited_field_of_view():
    path = read([key(0, fov=90), key(1, fov=20), {**key(2), "fov": None}])
    fov_deg = np.array([camera.fov_deg for camera in path.cameras])
    assert fov_deg[[0, 10, 20]] == pytest.approx([90, 20, 20])
    assert (np.diff(fov_deg) <= 1e-9).all()


def test_quaternions_are_w_first():
    quarter = [0.5**0.5, 0, 0.5**0.5, 0]  # a quarter turn to the left, about +y
    (camera,) = read([key(0, rotation=quarter)], frames=1).cameras
    np.testing.assert_allclose(camera.world_from_camera[:3, 2], (1, 0, 0), atol=1e-12)  # looks along -x


def test_targets_and_rotations_mix():
    path = read([key(0), key(1, (0, 1, 5), rotation=[1, 0, 0, 0])])
    np.testing.assert_allclose(poses(path)[:, :3, :3], np.tile(np.eye(3), (11, 1, 1)), atol=1e-12)


def test_two_rotations_give_a_uniform_turn():
    keys = Rotation.from_euler("xyz", [(10, 20, 30), (60, 140, -10)], degrees=True)
    steps = interpolate_rotations(np.array([1.0, 3.0]), keys, np.linspace(1, 3, 9))
    speeds = (steps[:-1].inv() * steps[1:]).as_rotvec()
    np.testing.assert_allclose(speeds, np.tile((keys[0].inv() * keys[1]).as_rotvec() / 8, (8, 1)), atol=1e-12)


@given(st.integers(0, 1000), st.integers(1, 5), st.floats(0.02, 2.6))
def test_rotations_meet_their_keys_with_continuous_velocity(seed, count, spread):
    turns = Rotation.random(count, rng=seed).as_rotvec()
    turns *= spread / np.linalg.norm(turns, axis=1, keepdims=True)  # radians between keys
    keys = [Rotation.identity()]
    for turn in turns:
        keys.append(keys[-1] * Rotation.from_rotvec(turn))
    knots = np.cumsum(np.random.default_rng(seed).uniform(0.5, 2.0, count + 1))
    h = 1e-5
    around = np.clip(knots[:, None] + h * np.array([-1, 0, 1]), knots[0], knots[-1])
    found = interpolate_rotations(knots, Rotation.concatenate(keys), around.ravel())
    before, at, after = found[::3], found[1::3], found[2::3]
    np.testing.assert_allclose((at.inv() * Rotation.concatenate(keys)).magnitude(), 0, atol=1e-9)
    left, right = (before.inv() * at).as_rotvec() / h, (at.inv() * after).as_rotvec() / h
    # one-sided differences are off by h times the angular acceleration, below 1e3 rad/s2 here
    np.testing.assert_allclose(left[1:-1], right[1:-1], atol=1e-2)


row = st.tuples(*[st.integers(-50, 50)] * 3, st.floats(5, 120), st.floats(0.1, 5.0), st.booleans())


@given(st.lists(row, min_size=2, max_size=8))
def test_values_stay_within_those_of_the_keys(rows):
    *eye, fov, step, cut = zip(*rows, strict=True)
    times, eyes = np.cumsum(step), np.transpose(eye)
    path = read(
        [
            key(t, e, fov=f, cut=c, rotation=[1, 0, 0, 0])
            for t, e, f, c in zip(times, eyes.tolist(), fov, cut, strict=True)
        ]
    )
    found = np.array([(*camera.eye, camera.fov_deg) for camera in path.cameras])
    keys = np.column_stack([eyes, fov])
    assert (found >= keys.min(axis=0) - 1e-6).all()
    assert (found <= keys.max(axis=0) + 1e-6).all()


@pytest.mark.parametrize(
    ("keys", "more", "problem"),
    [
        ([key(0), key(1)], {"fsp": 3}, "unknown key 'fsp'; known are: format, fps"),
        ([key(0, ease=1)], {}, "key 1: unknown key 'ease'; known are: time"),
        ([key(0)], {}, "a single key has no duration"),
        ([key(0)], {"frames": 3, "seconds": 2}, "not both"),
        ([key(0)], {"frames": 0}, r"frames is 0; expected a whole number from 1 to 1e\+06"),
        ([key(0)], {"seconds": -1}, "seconds is -1"),
        ([key(0), key(1e9)], {}, "frames are too many"),
        ([key(0), key(2)], {"frames": 20, "at": 1e7}, "20000000 frames are too many"),
        ([], {}, "at least one key"),
        ([key(0), key(0)], {}, "key 2: time 0 must follow 0"),
        ([key(0, hold=2), key(2)], {}, "key 2: time 2 must follow 2"),
        ([key(0, hold=2), key(1, cut=True)], {}, "key 2: time 1 must follow 2"),
        ([key(0, hold=-1)], {}, "key 1: hold is -1"),
        ([key(0, cut=1)], {}, "key 1: cut is 1; expected true or false"),
        ([key(0, target=[0, 1, 5])], {"frames": 1}, "key 1: .* can't look at"),
        ([key(0, up=[0, 0, 1])], {"frames": 1}, "key 1: .* up"),
        ([key(0, rotation=[1, 0, 0, 0], target=[0, 0, 0])], {}, "key 1: give either"),
        ([{"time": 0, "eye": [0, 0, 0], "fov": 3}], {}, "key 1: give either"),
        ([key(0, rotation=[2, 0, 0, 0])], {}, "key 1: rotation has length 2"),
        ([key(0, fov=None)], {}, "key 1: fov is missing"),
        ([key(0, eye=[0, 1])], {}, "key 1: eye .* list of 3"),
        ([key(0), key(1, (0, 1, -5))], {}, "between two keys .* can't look at"),
    ],
)
def test_malformed_files(keys, more, problem):
    with pytest.raises(CameraPathError, match=f"walk.json.*{problem}"):
        read(keys, **more)


def test_the_example_of_the_docs():
    example = json.loads(re.search(r"```json\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)[1])
    path = read_keyed(JsonObject(example, "docs"), (640, 480))
    assert (len(path), path.cuts) == (301, {240})
    assert {path.static_frame(frame) for frame in range(90, 151)} == {90}
