"""Reprojection against explicit 4x4 matrices in float64."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from enfilade.arrays import Array2f, Float, matrix3, vector3
from enfilade.camera.pinhole import Camera, look_at, planar_warp
from enfilade.kernels.reproject import NEAREST, reproject, warp_jacobian

W, H = 320, 180
START = Camera(look_at((1, 2, 3), (0, 1, -2)), 55.0, W, H)


def moved(shift, turn_deg, fov_deg=55.0):
    pose = START.world_from_camera.copy()
    pose[:3, :3] = Rotation.from_rotvec(turn_deg, degrees=True).as_matrix() @ pose[:3, :3]
    pose[:3, 3] += shift
    return Camera(pose, fov_deg, W, H)


MOTIONS = {
    "none": START,
    "tiny": moved((1e-5, 0, -2e-5), (1e-4, 0, 0)),
    "small": moved((0.01, 0.005, -0.02), (0.1, -0.2, 0.05)),
    "rotation": moved((0, 0, 0), (5, 10, -3)),
    "sideways": moved((0.5, 0, 0), (0, 0, 0)),
    "big": moved((0.7, -0.3, -0.8), (-4, 15, 6)),
    "zoom": moved((0, 0, 0), (0, 0, 0), fov_deg=30.0),
}

TOLERANCE_PX = dict.fromkeys(MOTIONS, 1e-5) | {"rotation": 1e-4, "sideways": 1e-4, "big": 3e-4, "zoom": 1e-4}


def points(count=2000):
    random = np.random.default_rng(8)
    x, y = random.uniform(0, W, count), random.uniform(0, H, count)
    depth = np.exp(random.uniform(np.log(2.0), np.log(500.0), count))
    return (v.astype(np.float32) for v in (x, y, depth))


def to_clip(camera):
    """Camera matrix (4, 4): homogeneous world to (x w, y w, depth) in pixels, in the OpenGL way."""
    f = camera.focal_px
    k = np.array([[f, 0, -W / 2, 0], [0, -f, -H / 2, 0], [0, 0, -1, 0], [0, 0, 0, 1.0]])
    return k @ np.linalg.inv(camera.world_from_camera)


def project(camera, world):
    """Image coordinates and depth of world points (N, 3)."""
    clip = np.concatenate([world, np.ones((len(world), 1))], axis=1) @ to_clip(camera).T
    return clip[:, 0] / clip[:, 2], clip[:, 1] / clip[:, 2], clip[:, 2]


def lift(camera, x, y, depth):
    """World points at a depth along the optical axis, (N, 3)."""
    f = camera.focal_px
    local = np.stack([(x - W / 2) / f * depth, -(y - H / 2) / f * depth, -depth, np.ones_like(depth)], axis=1)
    return (local @ camera.world_from_camera.T)[:, :3]


def run(target, x, y, disparity):
    warp = planar_warp(START, target)
    flow, ratio, is_ahead = reproject(
        Float(x), Float(y), Float(disparity), change=matrix3(warp.change), epipole=vector3(warp.epipole)
    )
    return np.array(flow).T.reshape(len(x), 2), np.array(ratio), np.array(is_ahead)


def test_lifting_and_projecting_are_inverse():
    x, y, depth = (v.astype(float) for v in points())
    again = project(START, lift(START, x, y, depth))
    np.testing.assert_allclose(again, (x, y, depth), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", MOTIONS)
def test_reprojection_matches_the_explicit_projection(name):
    x, y, depth = points()
    target = MOTIONS[name]
    disparity = np.float32(1) / depth
    exact = [v.astype(float) for v in (x, y)]
    new_x, new_y, new_depth = project(target, lift(START, *exact, 1.0 / disparity.astype(float)))
    flow, ratio, is_ahead = run(target, x, y, disparity)

    is_seen = new_depth * disparity > 0.05
    assert is_seen.mean() > 0.8
    assert is_ahead[is_seen].all()
    expected = np.stack([new_x - exact[0], new_y - exact[1]], axis=1)[is_seen]
    # Sums of terms of up to 320 px in float32, divided: a hundredth of the limit (0.001 px) for
    # small motions; displacements of hundreds of pixels are off by a few 1e-6 of themselves.
    np.testing.assert_allclose(flow[is_seen], expected, atol=TOLERANCE_PX[name], rtol=3e-6)
    np.testing.assert_allclose(ratio[is_seen], (new_depth * disparity)[is_seen], rtol=1e-5)


def test_small_motion_loses_no_digits():
    x, y, depth = points()
    flow, _, _ = run(MOTIONS["tiny"], x, y, np.float32(1) / depth)
    new_x, new_y, _ = project(
        MOTIONS["tiny"], lift(START, x.astype(float), y.astype(float), depth.astype(float))
    )
    expected = np.stack([new_x - x, new_y - y], axis=1)
    assert 1e-5 < np.abs(expected).max() < 1e-2
    # relative to the largest: 24 bits, where x + flow alone would keep 2e-5 px
    assert np.abs(flow - expected).max() < 1e-5 * np.abs(expected).max()


def test_equal_cameras_have_no_motion():
    x, y, depth = points()
    flow, ratio, _ = run(START, x, y, np.float32(1) / depth)
    assert not flow.any()
    assert (ratio == 1.0).all()


def test_points_at_infinity_move_with_the_rotation_alone():
    x, y, _ = points()
    zero = np.zeros_like(x)
    turned = moved((0, 0, 0), (5, 10, -3))
    shifted = moved((7, -9, 4), (5, 10, -3))
    np.testing.assert_allclose(run(shifted, x, y, zero)[0], run(turned, x, y, zero)[0], atol=1e-4)


def test_points_behind_the_camera_are_marked():
    forward = moved(-4.0 * START.world_from_camera[:3, 2], (0, 0, 0))  # 4 units along the view
    x = np.full(4, W / 2, np.float32)
    y = np.full(4, H / 2, np.float32)
    depth = np.array([3.9, 4.0, 4.001, 8.0], np.float32)
    flow, ratio, is_ahead = run(forward, x, y, 1 / depth)
    assert is_ahead.tolist() == [False, False, False, True]
    assert (ratio[:3] == np.float32(NEAREST)).all()
    assert np.isfinite(flow).all()


@pytest.mark.parametrize("name", [n for n in MOTIONS if n != "none"])
def test_the_jacobian_is_the_derivative_on_the_plane(name):
    target, step = MOTIONS[name], 1e-4
    x, y, depth = (v[:200].astype(float) for v in points())
    gradient = np.random.default_rng(2).normal(0, 1e-4, (200, 2))

    def new_position(dx, dy):
        disparity = 1.0 / depth + gradient[:, 0] * dx + gradient[:, 1] * dy
        return np.stack(project(target, lift(START, x + dx, y + dy, 1.0 / disparity))[:2], axis=1)

    by_x = (new_position(step, 0) - new_position(-step, 0)) / (2 * step)
    by_y = (new_position(0, step) - new_position(0, -step)) / (2 * step)
    warp = planar_warp(START, target)
    got = warp_jacobian(
        Float(x),
        Float(y),
        Float(1.0 / depth),
        Array2f(Float(gradient[:, 0]), Float(gradient[:, 1])),
        change=matrix3(warp.change),
        epipole=vector3(warp.epipole),
    )
    for column, expected in zip(got, (by_x, by_y), strict=True):
        # central differences of step 1e-4 px leave 1e-7; the positions in float32 some 1e-5 of 1
        np.testing.assert_allclose(np.array(column).T, expected, rtol=2e-5, atol=2e-5)


def test_the_epipole_does_not_move():
    target = moved(-0.5 * START.world_from_camera[:3, 2], (0, 0, 0))
    warp = planar_warp(START, target)
    flow, _, _ = reproject(
        Float(W / 2), Float(H / 2), Float(0.25), change=matrix3(warp.change), epipole=vector3(warp.epipole)
    )
    np.testing.assert_allclose(np.array(flow).ravel(), 0.0, atol=1e-4)
