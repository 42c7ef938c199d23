"""Held against SciPy, which has the same curve and the same rotations, and takes long to import."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from enfilade.camera.interpolate import interpolate_values, slopes
from enfilade.camera.rotation import from_quaternion, from_vector, to_vector

KEYED = """{"format": "enfilade-path", "fps": 10, "keys": [
    {"time": 0, "eye": [0, 0, 1], "rotation": [1, 0, 0, 0], "fov": 50},
    {"time": 1, "eye": [0, 1, 1], "rotation": [0.8, 0.6, 0, 0]},
    {"time": 3, "eye": [0, 1, 2], "rotation": [0.6, 0.8, 0, 0]}]}"""


@given(st.integers(0, 2**32 - 1), st.integers(2, 9), st.sampled_from([0.0, 0.3, 0.8]))
def test_values_and_slopes_are_scipys(seed, count, share_of_rests):
    random = np.random.default_rng(seed)
    knots = np.cumsum(random.uniform(0.05, 3.0, count))
    steps = random.normal(size=(count, 3)) * (random.random((count, 3)) >= share_of_rests)
    values, times = np.cumsum(steps, axis=0), np.linspace(knots[0], knots[-1], 57)
    theirs = PchipInterpolator(knots, values, axis=0)
    np.testing.assert_allclose(interpolate_values(knots, values, times), theirs(times), atol=1e-12)
    np.testing.assert_allclose(slopes(knots, values), theirs.derivative()(knots), atol=1e-10)


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-9, 0.4, 3.0, np.pi - 1e-9, np.pi])
def test_rotations_there_and_back(angle):
    axes = np.random.default_rng(1).normal(size=(500, 3))
    axes[:3] = np.eye(3)
    vectors = angle * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    matrices = from_vector(vectors)
    np.testing.assert_allclose(matrices, Rotation.from_rotvec(vectors).as_matrix(), atol=1e-14)
    back = to_vector(matrices)
    assert (np.linalg.norm(back, axis=1) <= np.pi + 1e-12).all()
    if angle == np.pi:  # either way round is as long
        back *= np.sign(np.sum(back * vectors, axis=1, keepdims=True))
    np.testing.assert_allclose(back, vectors, atol=1e-7 if angle > 3.1 else 1e-14)


def test_quaternions_of_any_length():
    for quaternion in np.random.default_rng(2).normal(size=(50, 4)):
        theirs = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
        np.testing.assert_allclose(from_quaternion(quaternion), theirs, atol=1e-14)


def test_reading_keys_imports_no_scipy(tmp_path):
    """What is refused is refused before the user looks away."""
    (tmp_path / "walk.json").write_text(KEYED)
    lines = (
        "import sys; from pathlib import Path; from enfilade.camera import load_path;"
        "print(len(load_path(Path('walk.json'), size=(64, 48)).cameras), 'scipy' in sys.modules)"
    )
    command = [sys.executable, "-c", lines]
    said = subprocess.run(command, check=False, cwd=tmp_path, capture_output=True, text=True)  # noqa: S603
    assert said.stdout.split() == ["31", "False"], said.stderr
