"""Compositing of two warped keyframes: visible surfaces, weights, disocclusions."""

import dataclasses

import numpy as np
import pytest
import scipy.ndimage

from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.paper.composite import agrees, composite
from enfilade.methods.paper.disparity import outline_pixels
from enfilade.methods.paper.warp import warp_keyframe
from enfilade.records import Geometry, Halves, Keyframe, Warped
from enfilade.settings import WarpSettings
from support.analytic_scene import AnalyticScene, Material, Plane, Quad, Sphere
from support.analytic_truth import (
    first_hits,
    geometry_of,
    keyframe_of,
    projected,
    psnr,
    ray_directions,
    traced_image,
)
from support.example_scenes import room, room_walk

SETTINGS = WarpSettings(depth_tolerance=0.02)
CAMERA = Camera(look_at((0, 0, 4), (0, 0, 0)), 50.0, 1, 1)


def pixel(depth=2.0, shape_index=1):
    size = (1, 1)
    return Geometry(
        CAMERA,
        np.full(size, depth, np.float32),
        np.zeros((*size, 3), np.float32),
        np.zeros((*size, 3), np.float32),
        np.full(size, shape_index, np.uint32),
        np.zeros(size, np.uint8),
    )


def warped(value, *, depth=2.0, shape_index=1, magnification=1.0, is_disoccluded=False, is_mixed=False):
    size = (1, 1)
    return Warped(
        Halves(*(np.full((*size, 3), value, np.float32) for _ in range(2))),
        np.full(size, depth, np.float32),
        np.full(size, shape_index, np.uint32),
        np.full(size, magnification, np.float32),
        np.full(size, 0.25 * magnification, np.float32),
        np.full(size, is_disoccluded),
        np.full(size, is_mixed),
    )


def composited(before, after, progress=0.5, of=None):
    color, is_disoccluded = composite(before, after, of or pixel(), progress=progress, settings=SETTINGS)
    assert color.dtype == np.float32
    return float(color[0, 0, 0]), bool(is_disoccluded[0, 0])


@pytest.mark.parametrize(
    ("progress", "expected"), [(0.5, 0.5), (0.25, 0.25), (0.9, 0.9), (0.0, 0.0), (1.0, 1.0)]
)
def test_keyframes_are_weighted_by_their_distance_in_time(progress, expected):
    color, is_disoccluded = composited(warped(0.0), warped(1.0), progress)
    assert color == pytest.approx(expected, abs=1e-6)
    assert not is_disoccluded


def test_magnified_samples_weigh_less():
    assert composited(warped(0.0, magnification=4.0), warped(1.0))[0] == pytest.approx(0.8)
    assert composited(warped(0.0, magnification=0.1), warped(1.0))[0] == pytest.approx(
        0.5
    )  # minified samples gain no weight


@pytest.mark.parametrize(
    "wrong",
    [
        {"depth": 1.0},  # an occluder
        {"depth": 3.0},  # an occluded surface
        {"depth": 2.05},
        {"shape_index": 2},
        {"is_disoccluded": True},
        {"is_mixed": True},  # with a share of another surface
    ],
)
def test_only_the_visible_surface_is_used(wrong):
    assert composited(warped(0.2), warped(0.9, **wrong)) == (pytest.approx(0.2), False)
    assert composited(warped(0.9, **wrong), warped(0.2)) == (pytest.approx(0.2), False)
    assert composited(warped(0.9, **wrong), warped(0.9, **wrong)) == (0.0, True)


def test_depths_agree_within_the_tolerance():
    assert composited(warped(0.0, depth=2.039), warped(1.0, depth=1.961))[0] == pytest.approx(0.5)


def test_sky_is_composited():
    sky = pixel(depth=0.0, shape_index=0)
    assert (
        composited(warped(0.0, depth=0.0, shape_index=0), warped(1.0, depth=0.0, shape_index=0), of=sky)[0]
        == 0.5
    )
    assert composited(warped(0.0, depth=0.0, shape_index=0), warped(1.0), of=sky) == (0.0, False)
    assert composited(warped(0.0, depth=0.0, shape_index=0), warped(1.0)) == (1.0, False)


def test_disocclusions_are_not_sky():
    sky = pixel(depth=0.0, shape_index=0)
    disoccluded = warped(0.0, depth=0.0, shape_index=0, is_disoccluded=True)
    assert not agrees(disoccluded, sky, np.full((1, 1), False), 0.02).any()
    assert composited(disoccluded, disoccluded, of=sky) == (0.0, True)


def between(scene, path, first, last, frame):
    before, after = (
        warp_keyframe(keyframe_of(scene, path.cameras[f]), path.cameras[frame], SETTINGS)
        for f in (first, last)
    )
    truth = keyframe_of(scene, path.cameras[frame])
    progress = (frame - first) / (last - first)
    color, is_disoccluded = composite(before, after, truth.geometry, progress=progress, settings=SETTINGS)
    return color, is_disoccluded, truth, (before, after)


def test_a_composited_room_matches_its_exact_image():
    path = room_walk(25)
    color, is_disoccluded, truth, _ = between(room(), path, 0, 12, 5)
    assert is_disoccluded.mean() < 0.06
    # Checkerboards sampled once a pixel and resampled: their edges differ by half a pixel.
    assert psnr(color[~is_disoccluded], truth.shading.color[~is_disoccluded].astype(float)) > 20
    smooth = np.isin(truth.geometry.shape_index, (2, 3, 4, 5, 7)) & ~is_disoccluded  # walls and ceiling
    assert psnr(color[smooth], truth.shading.color[smooth].astype(float)) > 34


def test_two_keyframes_show_both_sides_of_an_occluder():
    # Each keyframe shows the wall on one side of the ball, both together nearly all of it.
    scene = AnalyticScene(
        (
            Plane((0, 0, -2), (0, 0, 1), Material((0.2, 0.3, 0.4))),
            Sphere((0, 0, 0), 0.6, Material((0.9, 0, 0))),
        )
    )
    middle = Camera(look_at((0, 0, 4), (0, 0, 0)), 45.0, 120, 90)

    def at(x):
        pose = middle.world_from_camera.copy()
        pose[0, 3] = x
        return dataclasses.replace(middle, world_from_camera=pose)

    before, after = (warp_keyframe(keyframe_of(scene, at(x)), middle, SETTINGS) for x in (-0.5, 0.5))
    geometry = geometry_of(scene, middle)
    is_outline = outline_pixels(geometry, SETTINGS.depth_tolerance)
    one = [~agrees(w, geometry, is_outline, SETTINGS.depth_tolerance) for w in (before, after)]
    color, is_disoccluded = composite(before, after, geometry, progress=0.5, settings=SETTINGS)
    np.testing.assert_array_equal(is_disoccluded, one[0] & one[1])
    assert is_disoccluded.mean() < 0.2 * min(one[0].mean(), one[1].mean())
    ball = (geometry.shape_index == 2) & ~is_disoccluded
    assert (color[ball][:, 2] == 0).all()  # no wall in it
    assert (color[(geometry.shape_index == 1) & ~is_disoccluded][:, 2] > 0.05).all()  # no ball in the wall


@pytest.mark.parametrize("frame", [3, 12, 21])
def test_disocclusions_are_surfaces_that_neither_keyframe_shows(frame):
    scene, path = room(), room_walk(25, size=(160, 120), turn_deg=30)
    _, is_disoccluded, truth, (before, after) = between(scene, path, 0, 24, frame)
    camera = path.cameras[frame]
    direction = ray_directions(camera)
    depth, shape_index = first_hits(scene, camera.eye, direction)
    world = camera.eye + depth[..., None] * direction
    seen = np.zeros(shape_index.shape, bool)
    edge = edges(shape_index)
    for end in (0, 24):
        by = is_visible_to(scene, path.cameras[end], world)
        seen |= by
        edge |= edges(by)
    # Splats end within half a pixel of the silhouette: nothing is wrong by more than a pixel.
    border = scipy.ndimage.binary_dilation(edge, np.ones((3, 3)))
    wrong = (is_disoccluded == seen) & ~border
    assert (is_disoccluded & ~border).sum() > 20
    # Surfaces at grazing angles in the keyframe, whose splats exceed the largest size, are disoccluded, too.
    assert not (wrong & ~is_disoccluded).any()
    # Samples from an outline of a keyframe are not used.
    wrong &= ~(before.is_mixed | after.is_mixed)
    assert wrong.mean() < 0.002
    assert (truth.geometry.shape_index > 0).all()


def is_visible_to(scene, camera, world):
    nearest, _ = first_hits(scene, camera.eye, world - camera.eye)
    at, ahead = projected(camera, world)
    inside = (ahead > 0) & (at > 0).all(-1) & (at < (camera.width, camera.height)).all(-1)
    return (nearest > 1 - 1e-6) & inside


def edges(labels):
    low = scipy.ndimage.minimum_filter(labels.astype(int), 3, mode="nearest")
    high = scipy.ndimage.maximum_filter(labels.astype(int), 3, mode="nearest")
    return low != high


def test_a_share_of_the_foreground_is_not_moved_into_the_open_background():
    # A dark post before a white wall, so wide that pixels with centres on the wall show a part of it.
    post = Quad((-0.29, -5, 0), (0.58, 0, 0), (0, 10, 0), Material((0.05, 0.05, 0.05)))
    wall = Plane((0, 0, -6), (0, 0, 1), Material((0.8, 0.8, 0.8)))
    scene = AnalyticScene((wall, post), ambient=(1, 1, 1), light=(0, 0, 0))
    middle = Camera(look_at((0, 0, 2.5), (0, 0, 0)), 50.0, 80, 60)

    def at(x):
        pose = middle.world_from_camera.copy()
        pose[0, 3] = x
        return dataclasses.replace(middle, world_from_camera=pose)

    def keyframe(camera):
        color = traced_image(scene, camera, spp=64, box=True).color
        return Keyframe(geometry_of(scene, camera), Halves(color, color))

    before, after = (warp_keyframe(keyframe(at(x)), middle, SETTINGS) for x in (-0.15, 0.15))
    geometry = geometry_of(scene, middle)
    color, is_disoccluded = composite(before, after, geometry, progress=0.5, settings=SETTINGS)
    is_open = (geometry.shape_index == 1) & ~outline_pixels(geometry, SETTINGS.depth_tolerance)
    np.testing.assert_allclose(color[is_open & ~is_disoccluded], 0.8, atol=0.01)
    assert is_disoccluded.mean() < 0.03
