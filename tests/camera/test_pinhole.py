import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from enfilade.camera.pinhole import Camera, look_at
from enfilade.errors import CameraPathError

coordinates = st.tuples(*[st.floats(-100, 100)] * 3)


def a_camera(width=640, height=480, fov_deg=50.0, pose=None, **shift):
    return Camera(look_at((1, 2, 3), (0, 1, 0)) if pose is None else pose, fov_deg, width, height, **shift)


def test_axes_and_vertical_field_of_view():
    camera = a_camera(fov_deg=90, pose=np.eye(4))
    assert camera.focal_px == pytest.approx(240)
    pixels = [(320, 240, 1), (640, 240, 1), (320, 480, 1)]  # centre, right edge, bottom edge
    rays = np.array(pixels) @ camera.direction_from_pixel.T
    np.testing.assert_allclose(rays, [(0, 0, -1), (4 / 3, 0, -1), (0, -1, -1)], atol=1e-12)


def test_a_shifted_lens_shows_another_part_of_the_image_plane():
    whole = a_camera(640, 480)
    fov_deg = math.degrees(2 * math.atan(0.5 * 240 / whole.focal_px))
    part = a_camera(320, 240, fov_deg, principal_point=(0.5 * 640 / 320, (0.5 * 480 - 200) / 240))
    corner = np.array([0, 200, 0])  # of the part in the whole
    pixels = np.array([(0, 0, 1), (320, 240, 1), (31.5, 7.5, 1)])
    expected = (pixels + corner) @ whole.direction_from_pixel.T
    np.testing.assert_allclose(pixels @ part.direction_from_pixel.T, expected, atol=1e-12)
    assert not part.is_same_view(a_camera(320, 240, fov_deg))


@given(coordinates, coordinates, st.floats(1, 170), st.floats(0, 1), st.floats(0, 1), st.floats(0.01, 1000))
def test_pixel_to_point_and_back(eye, target, fov_deg, across, down, depth):
    away = np.subtract(target, eye)
    assume(np.linalg.norm(np.cross(away, (0, 1, 0))) > 1e-3 * max(np.linalg.norm(away), 1e-3))
    camera = a_camera(fov_deg=fov_deg, pose=look_at(eye, target))
    pixel = np.array([640 * across, 480 * down, 1.0])
    direction = camera.direction_from_pixel @ pixel
    image = camera.pixel_from_direction @ (depth * direction)
    assert image[2] == pytest.approx(depth)  # unit depth: the third row is the depth
    np.testing.assert_allclose(image[:2] / image[2], pixel[:2], atol=1e-6)
    assert -direction @ camera.world_from_camera[:3, 2] == pytest.approx(1)


@given(coordinates, coordinates)
def test_look_at_is_rigid_and_aims(eye, target):
    away = np.subtract(target, eye)
    assume(np.linalg.norm(np.cross(away, (0, 1, 0))) > 1e-6)
    pose = a_camera(
        pose=look_at(eye, target)
    ).world_from_camera  # the camera refuses poses that are not rigid
    np.testing.assert_allclose(-pose[:3, 2], away / np.linalg.norm(away), atol=1e-9)
    np.testing.assert_array_equal(pose[:3, 3], eye)
    assert pose[1, 1] >= 0  # up is up


@pytest.mark.parametrize(
    ("eye", "up"), [((0, 0, 0), (0, 1, 0)), ((0, 5, 0), (0, 1, 0)), ((0, 0, 1), (0, 0, 0))]
)
def test_look_at_without_a_solution(eye, up):
    with pytest.raises(CameraPathError, match="can't look at"):
        look_at(eye, (0, 0, 0), up)


def changed(row, column, value):
    matrix = np.eye(4)
    matrix[row, column] = value
    return matrix


@pytest.mark.parametrize(
    ("matrix", "problem"),
    [
        (np.eye(3), "4x4"),
        (changed(0, 3, np.nan), "finite"),
        (changed(1, 3, np.inf), "finite"),
        (changed(3, 0, 0.5), "last row"),
        (changed(0, 0, 1.01), "not rigid: .* 0.0201"),
        (changed(0, 0, -1.0), "reflection"),
    ],
)
def test_poses_that_are_not_rigid(matrix, problem):
    with pytest.raises(CameraPathError, match=problem):
        a_camera(pose=matrix)


def test_poses_of_four_digits_are_rigid():
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", (10, 20, 30), degrees=True).as_matrix().round(4)
    a_camera(pose=pose)


@pytest.mark.parametrize(
    ("fov_deg", "size"), [(0, (4, 4)), (180, (4, 4)), (math.nan, (4, 4)), (50, (0, 4)), (50, (4, -1))]
)
def test_numbers_out_of_range(fov_deg, size):
    with pytest.raises(CameraPathError):
        a_camera(*size, fov_deg=fov_deg)


def test_a_principal_point_must_be_finite():
    with pytest.raises(CameraPathError, match="principal point"):
        a_camera(principal_point=(0.5, math.inf))


def test_same_views():
    camera = a_camera()
    assert camera.is_same_view(a_camera())
    for other in (
        a_camera(fov_deg=51),
        a_camera(width=641),
        a_camera(pose=look_at((1, 2, 3.0001), (0, 1, 0))),
    ):
        assert not camera.is_same_view(other)
