import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from enfilade.camera.fields import Table
from enfilade.camera.interpolate import interpolate_rotations
from enfilade.camera.keyed import read_keyed
from enfilade.camera.pinhole import check_rigid
from enfilade.errors import CameraPathError

DOCS = Path(__file__).parents[2] / "docs" / "camera-paths.md"


def key(time, eye=(0, 1, 5), **more):
    pose = {} if "rotation" in more else {"target": [0, 1, 0]}
    return {"time": time, "eye": list(eye), "fov": 50, **pose, **more}


def read(keys, *, at=None, **more):
    return read_keyed(
        Table({"format": "enfilade-path", "fps": 10, "keys": keys, **more}, "walk.json"), fps=at
    )


def eyes(shots):
    return shots.poses[:, :3, 3]


def test_two_keys_move_uniformly_and_show_both_ends():
    shots = read([key(0), key(2, (4, 1, 5))])
    np.testing.assert_allclose(eyes(shots)[:, 0], np.linspace(0, 4, 21), atol=1e-12)
    assert shots.cuts == frozenset()


def test_frame_rate_of_the_caller_samples_the_same_motion():
    coarse, fine = (
        read([key(0), key(1, (4, 2, 5)), key(3)]),
        read([key(0), key(1, (4, 2, 5)), key(3)], at=20.0),
    )
    np.testing.assert_allclose(fine.poses[::2], coarse.poses, atol=1e-12)
    assert fine.fps == 20.0


@pytest.mark.parametrize(("rate", "count"), [(20.0, 40), (5.0, 10), (10.0, 20), (12.5, 25)])
def test_frames_of_the_file_last_as_long_at_another_rate(rate, count):
    keys = [key(0), key(2, (4, 2, 5))]
    coarse, other = read(keys, frames=20), read(keys, frames=20, at=rate)
    assert len(other.poses) == count
    at = np.arange(count) / rate
    np.testing.assert_allclose(eyes(other)[:, 0], 2.0 * at, atol=1e-12)
    np.testing.assert_allclose(other.poses[0], coarse.poses[0], atol=1e-12)
    with pytest.raises(CameraPathError, match="20000000 frames are too many"):
        read(keys, frames=20, at=1e7)


def test_without_a_rate_in_the_file_its_frames_are_those_of_the_caller():
    assert len(read([key(0), key(1)], fps=None, frames=7, at=24.0).poses) == 7


def test_a_hold_is_a_real_stop():
    shots = read([key(0), key(1, (2, 1, 5), hold=1.0), key(3, (6, 1, 5))])
    x = eyes(shots)[:, 0]
    assert (x[10:21] == 2.0).all()
    assert (shots.poses[10:21] == shots.poses[10]).all()
    speed = np.diff(x)
    assert (speed >= 0).all()
    assert speed[9] < 0.3 * speed[0]  # it arrives gently


def test_targets_are_kept_in_the_middle_of_the_image():
    shots = read([key(0), key(1, (3, 2, 1)), key(2, (5, 0, -2))])
    for pose in shots.poses:
        aim = np.linalg.inv(pose) @ (0, 1, 0, 1)
        assert np.abs(aim[:2]).max() < 1e-9
        assert aim[2] < 0


def test_a_cut_interpolates_nothing_across():
    shots = read([key(0), key(1, (1, 1, 5)), key(2, (100, 1, 5), cut=True), key(3, (101, 1, 5))])
    x = eyes(shots)[:, 0]
    assert shots.cuts == {20}
    assert (x[10:20] == 1.0).all()  # the shot before rests until the cut
    assert x[20] == 100.0


def test_a_cut_between_two_frames_begins_with_the_next():
    shots = read([key(0), key(1.05, (9, 1, 5), cut=True), key(2, (9, 2, 5))])
    assert shots.cuts == {11}
    assert eyes(shots)[10, 0] == 0.0
    assert eyes(shots)[11, 0] == 9.0


@pytest.mark.parametrize("is_held", [True, False])
def test_a_cut_may_come_when_a_rest_ends(is_held):
    first = key(1, (1, 1, 5), hold=0.2 if is_held else 0.0)
    cut = 1.2 if is_held else 1.0
    shots = read([key(0), first, key(cut, (100, 1, 5), cut=True), key(3, (101, 1, 5))])
    x, begin = eyes(shots)[:, 0], round(10 * cut)
    assert shots.cuts == {begin}
    assert (x[10:begin] == 1.0).all()
    assert x[begin] == 100.0


def test_a_cut_at_the_end_of_a_rest_is_found_in_decimals():  # in floats 0.1 + 0.2 is beyond 0.3
    shots = read([key(0.1, hold=0.2), key(0.3, (100, 1, 5), cut=True), key(1)])
    assert shots.cuts == {2}


def test_a_shot_too_short_for_a_frame_vanishes():
    shots = read([key(0), key(1.01, cut=True), key(1.02, (7, 1, 5), cut=True), key(2, (8, 1, 5))])
    assert shots.cuts == {11}


@pytest.mark.parametrize(
    ("more", "count"), [({"frames": 7}, 7), ({"seconds": 1.5}, 15), ({"seconds": 0.01}, 1)]
)
def test_one_key_is_a_camera_at_rest(more, count):
    shots = read([key(4)], **more)
    assert len(shots.poses) == count
    assert (shots.poses == shots.poses[0]).all()
    assert len(read([key(4, hold=1)]).poses) == 11


def test_a_length_beyond_the_keys_holds_the_last_pose():
    shots = read([key(0), key(1, (1, 1, 5))], frames=20)
    assert (eyes(shots)[10:, 0] == 1.0).all()
    assert len(read([key(0), key(1)], seconds=1).poses) == 10


def test_zoom_and_inherited_field_of_view():
    shots = read([key(0, fov=90), key(1, fov=20), {**key(2), "fov": None}])
    assert shots.fov_deg[[0, 10, 20]] == pytest.approx([90, 20, 20])
    assert (np.diff(shots.fov_deg) <= 1e-9).all()


def test_quaternions_are_w_first():
    quarter = [0.5**0.5, 0, 0.5**0.5, 0]  # a quarter turn to the left, about +y
    shots = read([key(0, rotation=quarter)], frames=1)
    np.testing.assert_allclose(shots.poses[0, :3, 2], (1, 0, 0), atol=1e-12)  # looks along -x


def test_targets_and_rotations_mix():
    shots = read([key(0), key(1, (0, 1, 5), rotation=[1, 0, 0, 0])])
    np.testing.assert_allclose(shots.poses[:, :3, :3], np.tile(np.eye(3), (11, 1, 1)), atol=1e-12)


def rotations(seed, count, spread_deg):
    turns = Rotation.random(count, rng=seed).as_rotvec()
    turns *= np.radians(spread_deg) / np.linalg.norm(turns, axis=1, keepdims=True)
    result = [Rotation.identity()]
    for turn in turns:
        result.append(result[-1] * Rotation.from_rotvec(turn))
    return Rotation.concatenate(result).as_matrix()


@given(st.integers(0, 1000), st.integers(1, 5), st.floats(1.0, 150.0))
def test_rotations_meet_their_keys_with_continuous_rate(seed, count, spread_deg):
    keys = rotations(seed, count, spread_deg)
    knots = np.cumsum(np.random.default_rng(seed).uniform(0.5, 2.0, count + 1))
    np.testing.assert_allclose(interpolate_rotations(knots, keys, knots), keys, atol=1e-9)
    for knot in knots[1:-1]:
        h = 1e-5
        before, at, after = Rotation.from_matrix(
            interpolate_rotations(knots, keys, knot + h * np.array([-1, 0, 1]))
        )
        left, right = (before.inv() * at).as_rotvec() / h, (at.inv() * after).as_rotvec() / h
        # one-sided differences are off by h times the angular acceleration, below 1e3 rad/s2 here
        np.testing.assert_allclose(left, right, atol=1e-2)


def test_equal_rotations_stay_equal():
    keys = rotations(3, 1, 80.0)[[0, 1, 1, 0]]
    between = interpolate_rotations(np.arange(4.0), keys, np.linspace(1, 2, 9))
    np.testing.assert_allclose(between, np.tile(keys[1], (9, 1, 1)), atol=1e-12)


@given(
    st.lists(
        st.tuples(*[st.floats(-50, 50)] * 3, st.floats(0.1, 5.0), st.floats(5, 120), st.booleans()),
        min_size=2,
        max_size=8,
    )
)
def test_any_keys_give_rigid_poses_within_their_hull(rows):
    time, keys = 0.0, []
    for x, y, z, pause, fov, is_cut in rows:
        time += pause
        keys.append(key(time, (x, y, z), fov=fov, rotation=[1, 0, 0, 0], cut=is_cut))
    shots = read(keys)
    for pose in shots.poses:
        check_rigid(pose)
    place = np.array([row[:3] for row in rows])
    assert (eyes(shots) >= place.min(axis=0) - 1e-9).all()
    assert (eyes(shots) <= place.max(axis=0) + 1e-9).all()
    assert shots.fov_deg.min() >= min(row[4] for row in rows) - 1e-6
    assert shots.fov_deg.max() <= max(row[4] for row in rows) + 1e-6


@pytest.mark.parametrize(
    ("keys", "more", "problem"),
    [
        ([key(0), key(1)], {"fsp": 3}, "unknown key 'fsp'; known are: format, fps"),
        ([key(0, ease=1)], {}, "key 1: unknown key 'ease'; known are: time"),
        ([key(0)], {}, "one key is a camera at rest"),
        ([key(0)], {"frames": 3, "seconds": 2}, "not both"),
        ([key(0)], {"frames": 0}, "frames is 0"),
        ([key(0)], {"frames": 2.5}, "frames is 2.5"),
        ([key(0)], {"seconds": -1}, "seconds is -1"),
        ([key(0), key(1e9)], {}, "too many"),
        ([], {}, "at least one key"),
        ([key(0), key(0)], {}, "key 2: time 0 does not follow 0"),
        ([key(0, hold=2), key(1)], {}, "key 2: time 1 does not follow 2"),
        ([key(0, hold=2), key(2)], {}, "key 2: time 2 does not follow 2"),
        ([key(0, hold=2), key(1, cut=True)], {}, "key 2: time 1 does not follow 2"),
        ([key(0, hold=-1)], {}, "key 1: hold is -1"),
        ([key(0, cut=1)], {}, "key 1: cut is 1; it must be true or false"),
        ([key(0, target=[0, 1, 5])], {"frames": 1}, "key 1: .* can't look at"),
        ([key(0, up=[0, 0, 1])], {"frames": 1}, "key 1: .* up"),
        ([key(0, rotation=[1, 0, 0, 0], target=[0, 0, 0])], {}, "key 1: give either"),
        ([{"time": 0, "eye": [0, 0, 0], "fov": 3}], {}, "key 1: give either"),
        ([key(0, rotation=[2, 0, 0, 0])], {}, "key 1: .* length 2"),
        ([key(0, fov=None)], {}, "key 1: fov is missing"),
        ([key(0, fov=0)], {}, "key 1: fov is 0"),
        ([key(0, eye=[0, float("nan"), 0])], {}, "key 1: eye holds a NaN"),
        ([key(0, eye=[0, 1])], {}, "key 1: eye .* list of 3"),
        ([key("0")], {}, "key 1: time holds '0'"),
        ([key(0), key(1)], {"size": [640]}, "list of 2"),
        ([key(0), key(1)], {"size": [640, 20000]}, "size is 640x20000"),
        ([key(0), key(1)], {"fps": 0}, "fps is 0"),
        ([key(0), key(1)], {"fps": 0.009}, "fps is 0.009; it must be from 0.01 to 10000"),
        ([key(0), key(1)], {"fps": 10001}, "fps is 10001; it must be from"),
        ([key(0), key(1, (0, 1, -5))], {}, "between two keys .* can't look at"),
    ],
)
def test_wrong_input_is_named(keys, more, problem):
    with pytest.raises(CameraPathError, match=f"walk.json.*{problem}"):
        read(keys, **more)


def test_the_example_of_the_docs_is_read():
    example = json.loads(re.search(r"```json\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)[1])
    shots = read_keyed(Table(example, "docs"))
    assert (len(shots.poses), shots.size, shots.cuts) == (301, (640, 480), {240})
    assert (shots.poses[90:151] == shots.poses[90]).all()
