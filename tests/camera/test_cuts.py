import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from enfilade.camera.cuts import find_jumps
from enfilade.camera.pinhole import look_at


def poses(eyes, yaw_deg=None):
    result = np.tile(np.eye(4), (len(eyes), 1, 1))
    result[:, :3, 3] = eyes
    if yaw_deg is not None:
        result[:, :3, :3] = Rotation.from_rotvec(np.radians(np.outer(yaw_deg, (0, 1, 0)))).as_matrix()
    return result


def along_x(x):
    return np.stack([x, np.full_like(x, 1.6), np.zeros_like(x)], axis=1)


def test_a_jump_of_place_and_a_jump_of_direction_are_found():
    x = np.arange(40) * 0.05
    x[17:] += 6.0
    yaw = np.arange(40) * 1.5
    yaw[30:] += 90.0
    assert find_jumps(poses(along_x(x), yaw)) == {17, 30}


def test_a_cut_between_two_shots_at_rest_is_found():
    x = np.zeros(20)
    x[10:] = 3.0
    assert find_jumps(poses(along_x(x))) == {10}


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_frames_have_no_cut(count):
    assert find_jumps(poses(along_x(np.arange(count) * 10.0))) == frozenset()


@pytest.mark.parametrize("sigma", [0.8, 1.5, 4.0])
def test_a_whip_pan_of_some_frames_is_no_cut(sigma):
    # the angle is a smooth step of 170 degrees: its speed a bell of `sigma` frames
    t = np.arange(60) - 30.2
    yaw = 85.0 * np.tanh(t / (1.5 * sigma))
    assert find_jumps(poses(along_x(np.zeros(60)), yaw)) == frozenset()


def test_motion_from_a_stop_is_no_cut():
    x = np.concatenate([np.zeros(15), np.arange(1, 11) * 2.0, np.full(15, 20.0)])
    assert find_jumps(poses(along_x(x))) == frozenset()


def test_rest_with_rounding_is_no_cut():
    rng = np.random.default_rng(1)
    eyes = np.full((50, 3), 2.5).round(3) + rng.normal(0.0, 1e-7, (50, 3))
    assert find_jumps(poses(eyes)) == frozenset()


@given(
    st.floats(0.1, 20.0), st.floats(0.0, 6.0), st.floats(0.2, 3.0), st.integers(8, 200), st.floats(1e-3, 1e3)
)
def test_smooth_orbits_have_no_cuts(radius, phase, turns, count, scale):
    angle = phase + np.linspace(0.0, 1.0, count) ** 2 * 2.0 * np.pi * turns * min(count / 40.0, 1.0)
    eyes = scale * radius * np.stack([np.cos(angle), 0.3 + 0.1 * np.sin(2.0 * angle), np.sin(angle)], axis=1)
    assert find_jumps(np.stack([look_at(eye, (0.0, 0.0, 0.0)) for eye in eyes])) == frozenset()


@given(st.integers(4, 35), st.floats(1e-3, 1e3))
def test_a_cut_anywhere_is_found_at_any_scale(frame, scale):
    x = np.arange(40) * 0.04 * scale
    x[frame:] += 2.0 * scale
    assert find_jumps(poses(along_x(x))) == {frame}
