"""Lookup of irradiance images at points in the world, against loops."""

from types import SimpleNamespace

import drjit as dr
import numpy as np
import pytest

from enfilade.arrays import Array3f, Bool, Float, Int, UInt, lanes, matrix3, opaque, vector3
from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.decoupled.surface_image import (
    MIN_TAP_WEIGHT,
    MIN_TAPER,
    PLANE_TOLERANCE,
    TAPER,
    UploadedImage,
    footprint,
    lookup,
    packed,
    upload_layers,
)
from support.analytic_truth import geometry_of
from support.example_scenes import wall as sheet

HEIGHT, WIDTH = 12, 16
CAMERA = Camera(look_at((0.3, 0.2, 4), (0, 0, 0)), 40, WIDTH, HEIGHT)


@pytest.fixture
def wall():
    """A wall at z = 0 of two shapes, with a column of unknown pixels: depth, shape index, values."""
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    direction = np.stack([x, y, np.ones_like(x)], -1) @ CAMERA.direction_from_pixel.T
    depth = (-CAMERA.eye[2] / direction[..., 2]).astype(np.float32)
    shape_index = np.where(x < 8, 1, 2).astype(np.uint32)
    depth[:, 13] = 0.0
    value = np.random.default_rng(1).uniform(0.0, 2.0, (HEIGHT, WIDTH, 3)).astype(np.float32)
    return depth, shape_index, value


def found(wall, points, shape_index, normal=(0.0, 0.0, 1.0), normals=None, **more):
    depth, shape_indices, value = wall
    uploaded = UploadedImage(
        depths=lanes(depth),
        shape_indices=lanes(shape_indices),
        normals=None if normals is None else packed(lanes(normals)),
        values=(lanes(value), 2.0 * lanes(value)),
        variances=(lanes(value[..., 0]), lanes(value[..., 1])),
        eye=vector3(CAMERA.eye),
        direction_from_pixel=matrix3(CAMERA.direction_from_pixel),
        pixel_from_direction=matrix3(CAMERA.pixel_from_direction),
        width=opaque(WIDTH, Int),
        height=opaque(HEIGHT, Int),
    )
    position = Array3f(np.asarray(points, np.float32).T)
    return lookup(position, Array3f(*normal), UInt(shape_index), uploaded, **more)


def by_loops(wall, point, shape_index):
    depth, shape_indices, value = wall
    seen = CAMERA.pixel_from_direction @ (point - CAMERA.eye)
    x, y = seen[:2] / seen[2] - 0.5
    total, weight = np.zeros(3), 0.0
    if seen[2] <= 0 or not (-0.5 < x < WIDTH - 0.5 and -0.5 < y < HEIGHT - 0.5):
        return total, weight
    for j, wy in ((int(np.floor(y)), 1 - y % 1), (int(np.floor(y)) + 1, y % 1)):
        for i, wx in ((int(np.floor(x)), 1 - x % 1), (int(np.floor(x)) + 1, x % 1)):
            u, v = np.clip(i, 0, WIDTH - 1), np.clip(j, 0, HEIGHT - 1)
            there = CAMERA.eye + depth[v, u] * (CAMERA.direction_from_pixel @ (u + 0.5, v + 0.5, 1.0))
            if (
                depth[v, u] > 0
                and shape_indices[v, u] == shape_index
                and abs(there[2] - point[2]) <= PLANE_TOLERANCE * seen[2]
            ):
                total += (wx * wy + MIN_TAP_WEIGHT) * value[v, u]
                weight += wx * wy + MIN_TAP_WEIGHT
    return total, weight


@pytest.mark.parametrize("shape_index", [1, 2])
def test_lookup_matches_loops(wall, shape_index):
    points = np.random.default_rng(2).uniform((-2.5, -1.8, -0.2), (2.5, 1.8, 0.2), (400, 3))
    points[:300, 2] = 0.0
    got = found(wall, points, shape_index)
    wanted = [by_loops(wall, point, shape_index) for point in points]
    np.testing.assert_allclose(np.array(got.weight), [w for _, w in wanted], atol=2e-4)
    np.testing.assert_allclose(np.array(got.totals[0]).T, [t for t, _ in wanted], atol=5e-4)
    np.testing.assert_allclose(np.array(got.totals[1]), 2.0 * np.array(got.totals[0]), rtol=1e-5)
    assert 0.2 < np.mean([w > 0 for _, w in wanted]) < 0.8


def test_pixels_are_weighted_by_the_fourth_power_of_the_cosine_of_the_normals(wall):
    points = np.random.default_rng(3).uniform((-0.8, -0.8, 0.0), (0.8, 0.8, 0.0), (50, 3))
    turned = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    turned[..., 0], turned[..., 2] = np.sin(1.1), np.cos(1.1)
    plain, got = found(wall, points, 1), found(wall, points, 1, normals=turned)
    np.testing.assert_allclose(np.array(got.weight), np.cos(1.1) ** 4 * np.array(plain.weight), atol=1e-3)
    other_way = found(wall, points, 1, normals=turned * np.float32([1, 1, -1]))
    assert not np.array(other_way.weight).any()


def test_surfaces_that_meet_at_an_edge_do_not_mix(wall):
    upright = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    upright[::2, :, 2], upright[1::2, :, 1] = 1.0, 1.0
    depth, shape_indices, value = wall
    value[::2], value[1::2] = 1.0, 5.0
    points = np.random.default_rng(4).uniform((-0.8, -0.8, 0.0), (0.8, 0.8, 0.0), (50, 3))
    got = found((depth, shape_indices, value), points, 1, normals=upright)
    weight = np.array(got.weight)
    known = weight > 0.05
    assert known.any()
    np.testing.assert_allclose(np.array(got.totals[0])[:, known] / weight[known], 1.0, atol=0.02)


def test_parallel_sheets_of_one_shape_do_not_mix():
    """Such as the slats of a blind that are one mesh: here 3 cm apart at 4 m, where a pixel is 12 mm wide."""
    geometry = geometry_of(sheet(), Camera(CAMERA.world_from_camera, CAMERA.fov_deg, 320, 240))
    values = dr.full(Array3f, 1.0, geometry.depth.size), dr.zeros(Float, geometry.depth.size)
    uploaded = upload_layers(geometry, lanes(geometry.is_hit), [values])
    across = np.random.default_rng(5).uniform(-0.5, 0.5, (2, 50))
    for distance, is_found in ((0.0, True), (0.004, True), (0.03, False), (-0.03, False)):
        position = Array3f(*np.stack([*across, np.full(50, distance)]).astype(np.float32))
        got = lookup(position, Array3f(0, 0, 1), UInt(int(geometry.shape_index[0, 0])), uploaded)
        assert np.all((np.array(got.weight) > 0.5) == is_found), distance


def test_the_back_of_a_surface_is_not_found(wall):
    point = [[0.0, 0.0, 0.0]]
    assert np.array(found(wall, point, 1).weight)[0] + np.array(found(wall, point, 2).weight)[0] > 0.5
    behind = (0.0, 0.0, -1.0)
    assert np.array(found(wall, point, 1, behind).weight)[0] == 0.0
    assert np.array(found(wall, point, 2, behind).weight)[0] == 0.0


def test_footprints_grow_with_the_square_of_distance_and_at_grazing_angles():
    def area(x, z, camera=CAMERA):
        point, normal = Array3f(x, 0, z), Array3f(0, 0, 1)
        return np.array(footprint(point, normal, vector3((0, 0, 0)), matrix3(camera.direction_from_pixel)))[0]

    near = area(0, -1)
    assert near == pytest.approx(CAMERA.pixel_angle**2, rel=1e-5)
    assert area(0, -3) == pytest.approx(9 * near, rel=1e-5)
    assert area(1, -1) == pytest.approx(2 * np.sqrt(2) * near, rel=1e-5)
    assert area(1000, -1) == pytest.approx(20 * (1000**2 + 1) * near, rel=1e-4)
    twice_as_fine = Camera(CAMERA.world_from_camera, CAMERA.fov_deg, 2 * WIDTH, 2 * HEIGHT)
    assert area(0, -1, twice_as_fine) == pytest.approx(0.25 * near, rel=1e-5)


def kernels_of_lookup(height, width):
    """Hashes of the kernels of a lookup in an image of some size, at three points."""
    camera = Camera(CAMERA.world_from_camera, CAMERA.fov_deg, width, height)
    wall = SimpleNamespace(
        camera=camera,
        depth=np.full((height, width), 4.0, np.float32),
        shape_index=np.ones((height, width), np.uint32),
        normal=np.full((height, width, 3), (0.0, 0.0, 1.0), np.float32),
    )
    layer = dr.opaque(Array3f, 1.0, height * width), dr.opaque(Float, 1.0, height * width)
    uploaded = upload_layers(wall, dr.opaque(Bool, True, height * width), [layer])
    position = dr.opaque(Array3f, 0.1, 3)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        dr.eval(lookup(position, Array3f(0, 0, 1), UInt(1), uploaded))
        return [k["hash"] for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]


def test_one_kernel_serves_images_of_all_sizes():
    """A size that were compiled into kernels would cost seconds at every new size of the frames."""
    assert kernels_of_lookup(12, 16) == kernels_of_lookup(30, 40) != []


def test_outermost_pixels_count_within_the_margin(wall):
    pixels = np.stack([np.float64([0.5, -0.9, -1.6, -1.4]), np.full(4, 6.5), np.ones(4)])
    direction = CAMERA.direction_from_pixel @ pixels
    points = (CAMERA.eye[:, None] - direction * CAMERA.eye[2] / direction[2]).T
    none, some = (found(wall, points, 1, margin=margin) for margin in (0.0, 1.5))
    assert (np.array(none.weight) > 0).tolist() == [True, False, False, False]
    assert (np.array(some.weight) > 0).tolist() == [True, True, False, True]
    values = np.array(some.totals[0]).T[[0, 1, 3]] / np.array(some.weight)[[0, 1, 3], None]
    np.testing.assert_allclose(values, np.tile(wall[2][6, 0], (3, 1)), atol=0.01)


def test_the_weight_of_an_image_falls_towards_its_borders(wall):
    """Points behind the pixels of the middle row: full weight in the interior, little at the border."""
    pixels = np.stack([np.arange(WIDTH) + 0.5, np.full(WIDTH, 6.5), np.ones(WIDTH)])
    direction = CAMERA.direction_from_pixel @ pixels
    points = (CAMERA.eye[:, None] - direction * CAMERA.eye[2] / direction[2]).T
    taper = np.array(found(wall, points, 1).taper)
    reach = TAPER * WIDTH
    expected = np.clip(
        (np.minimum(np.arange(WIDTH), WIDTH - 1 - np.arange(WIDTH)) + 0.5) / reach, MIN_TAPER, 1
    )
    np.testing.assert_allclose(taper, expected, atol=1e-3)
    assert taper.min() < 0.3


def test_normals_that_differ_by_more_than_the_least_cosine_do_not_count(wall):
    tilted = np.float32([0.0, 0.6, 0.8])
    normals = np.where(np.arange(HEIGHT)[:, None, None] < 6, tilted, np.float32([0.0, 0.0, 1.0]))
    normals = np.ascontiguousarray(np.broadcast_to(normals, (HEIGHT, WIDTH, 3)))
    x, y = np.meshgrid([2.5, 3.2], [2.5, 9.5])
    direction = np.stack([x, y, np.ones_like(x)], -1).reshape(-1, 3) @ CAMERA.direction_from_pixel.T
    points = CAMERA.eye - direction * (CAMERA.eye[2] / direction[:, 2:])
    loose, strict = (
        np.array(found(wall, points, [1] * 4, normals=normals, min_cosine=least).weight)
        for least in (0.7, 0.9)
    )
    np.testing.assert_allclose(loose, [0.8**4, 0.8**4, 1.0, 1.0], atol=0.01)
    np.testing.assert_allclose(strict, [0.0, 0.0, 1.0, 1.0], atol=0.01)
