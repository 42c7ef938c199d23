import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from enfilade.camera.cuts import find_cuts
from enfilade.camera.pinhole import look_at


def along_x(x, yaw_deg=None):
    """Poses at (x, 1.6, 0), turned about y."""
    poses = np.tile(np.eye(4), (len(x), 1, 1))
    poses[:, 0, 3], poses[:, 1, 3] = x, 1.6
    if yaw_deg is not None:
        poses[:, :3, :3] = Rotation.from_rotvec(np.radians(np.outer(yaw_deg, (0, 1, 0)))).as_matrix()
    return poses


def test_jumps_of_position_and_of_direction_are_cuts():
    x, yaw = np.arange(40) * 0.05, np.arange(40) * 1.5
    x[17:] += 6.0
    yaw[30:] += 90.0
    assert find_cuts(along_x(x, yaw)) == {17, 30}


@given(st.integers(4, 35), st.floats(1e-3, 1e3), st.sampled_from([0.0, 0.04]))
def test_a_cut_is_found_at_any_frame_and_scale(frame, scale, speed):
    x = np.arange(40) * speed * scale
    x[frame:] += 2.0 * scale
    assert find_cuts(along_x(x)) == {frame}


def test_few_frames_rests_and_stops_are_no_cuts():
    steps = np.concatenate([np.zeros(15), np.arange(1, 11) * 2.0, np.full(15, 20.0)])
    rounding_errors = 2.5 + np.random.default_rng(1).normal(0.0, 1e-7, 50)
    for x in (np.zeros(1), np.arange(2) * 10.0, np.arange(3) * 10.0, steps, rounding_errors):
        assert find_cuts(along_x(x)) == frozenset()


@pytest.mark.parametrize("sigma", [0.8, 1.5, 4.0])
def test_a_whip_pan_of_a_few_frames_is_not_a_cut(sigma):
    yaw = 85.0 * np.tanh((np.arange(60) - 30.2) / (1.5 * sigma))  # the speed is a bell of `sigma` frames
    assert find_cuts(along_x(np.zeros(60), yaw)) == frozenset()


@given(st.floats(0.0, 6.0), st.floats(0.2, 3.0), st.integers(8, 200), st.floats(1e-3, 1e3))
def test_smooth_orbits_have_no_cuts(phase, turns, count, radius):
    angle = phase + np.linspace(0.0, 1.0, count) ** 2 * 2.0 * np.pi * turns * min(count / 40.0, 1.0)
    eyes = radius * np.stack([np.cos(angle), 0.3 + 0.1 * np.sin(2.0 * angle), np.sin(angle)], axis=1)
    assert find_cuts(look_at(eyes, (0.0, 0.0, 0.0))) == frozenset()
