"""The forward warp against the exact image and against the painter's algorithm."""

import dataclasses
import math

import numpy as np
import pytest
import scipy.ndimage
from scipy.spatial.transform import Rotation

from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.paper.disparity import disparity_gradient
from enfilade.methods.paper.warp import _land, warp_keyframe
from enfilade.records import Geometry, Halves, Keyframe
from enfilade.settings import WarpSettings
from support.analytic_scene import AnalyticScene, Material, Plane, Quad, Sphere, Waves
from support.analytic_truth import first_hits, keyframe_of, pixel_centres, projected, psnr, ray_directions
from support.example_scenes import ball, room, room_walk, wall
from twins.painter import occlusion_compatible_order, painted

SETTINGS = WarpSettings()


def camera_at(eye, target=(0, 0, 0), size=(96, 72), fov_deg=50.0):
    return Camera(look_at(eye, target), fov_deg, *size)


def beside(camera, shift, turn_deg=(0, 0, 0)):
    pose = camera.world_from_camera.copy()
    pose[:3, :3] = Rotation.from_rotvec(turn_deg, degrees=True).as_matrix() @ pose[:3, :3]
    pose[:3, 3] += shift
    return dataclasses.replace(camera, world_from_camera=pose)


SCENES = {"wall": wall(), "ball": ball(), "noisy room": room(noise=1.0), "specular room": room(specular=True)}


@pytest.mark.parametrize("name", SCENES)
def test_a_warp_to_the_same_camera_is_exact(name):
    keyframe = keyframe_of(SCENES[name], room_walk(3).cameras[1], spp=3)
    got = warp_keyframe(keyframe, keyframe.geometry.camera, SETTINGS)
    assert not got.is_disoccluded.any()
    assert got.color.tobytes() == keyframe.shading.color.tobytes()
    assert got.shape_index.tobytes() == keyframe.geometry.shape_index.tobytes()
    assert (got.magnification == 1.0).all()
    np.testing.assert_allclose(got.depth, keyframe.geometry.depth, rtol=1e-6)


PLANES = {
    "facing": Plane((0, 0, 0), (0, 0, 1), Material(Waves((0.2, 0.3, 0.5), (0.9, 0.7, 0.4), 1.3))),
    "leaning": Plane((0, 0, 0), (0.5, 0.3, 1), Material(Waves((0.2, 0.3, 0.5), (0.9, 0.7, 0.4), 1.3))),
    "steep": Plane((0, 0, 0), (2.0, 0.2, 1), Material(Waves((0.2, 0.3, 0.5), (0.9, 0.7, 0.4), 1.3))),
    "floor": Plane((0, -1, 0), (0, 1, 0), Material(Waves((0.2, 0.3, 0.5), (0.9, 0.7, 0.4), 1.3))),
}
TRANSLATIONS = {
    "right": (0.06, 0, 0),
    "up": (0.01, 0.03, 0),
    "nearer": (0, 0, -0.08),
    "back": (0.02, 0, 0.05),
    "aslant": (-0.03, 0.02, -0.06),
}


@pytest.mark.parametrize("translation", TRANSLATIONS)
@pytest.mark.parametrize("plane", PLANES)
def test_planes_have_no_pinholes(plane, translation):
    scene = AnalyticScene((PLANES[plane],))
    camera = camera_at((0.2, 0.1, 4))
    keyframe = keyframe_of(scene, camera)
    checked = 0
    for step in range(1, 26, 3):
        target = beside(camera, np.array(TRANSLATIONS[translation]) * step)
        known, magnification = in_view_of(scene, camera, target)
        # Up to twice a pixel's size a side, and away from the border of the keyframe.
        known &= (magnification < 2.0) & (magnification > 0.02)
        got = warp_keyframe(keyframe, target, SETTINGS)
        assert not (got.is_disoccluded & known).any(), step
        checked += known.sum()
    assert checked > 9 * 1000


def in_view_of(scene, source, target):
    """Target pixels whose surface lies well inside the source's image, and its magnification."""
    depth, shape_index = first_hits(scene, target.eye, ray_directions(target))
    world = target.eye + np.where(shape_index > 0, depth, 0)[..., None] * ray_directions(target)
    at, source_depth = projected(source, world)
    inside = (shape_index > 0) & (source_depth > 0) & (at > 1).all(-1)
    inside &= (at < (source.width - 1, source.height - 1)).all(-1)
    across = np.linalg.norm(np.gradient(at, axis=1), axis=-1)
    down = np.linalg.norm(np.gradient(at, axis=0), axis=-1)
    return inside, 1.0 / np.maximum(np.minimum(across, down), 1e-6)


def test_a_magnified_plane_has_its_exact_colours():
    scene = wall()
    camera = camera_at((0, 0, 4))
    keyframe = keyframe_of(scene, camera)
    for distance in (3.5, 3.0, 2.5, 2.0):
        target = camera_at((0, 0, distance))
        got = warp_keyframe(keyframe, target, SETTINGS)
        assert not got.is_disoccluded.any()
        # Bilinear interpolation of a smooth texture (13 px a wave) leaves its curvature.
        assert psnr(got.color, keyframe_of(scene, target).shading.color) > 40
        np.testing.assert_allclose(got.depth, distance, rtol=1e-5)
        np.testing.assert_allclose(got.magnification, (4 / distance) ** 2, rtol=1e-3)


@pytest.mark.parametrize("roll_deg", [0, 30, 45])
def test_splats_beyond_the_largest_magnification_are_left_out_at_any_roll(roll_deg):
    keyframe = keyframe_of(wall(), camera_at((0, 0, 4)))
    settings = WarpSettings(max_magnification=2.0)
    for magnification, is_disoccluded in ((1.98, False), (2.02, True)):
        target = beside(camera_at((0, 0, 4 / magnification)), (0, 0, 0), (0, 0, roll_deg))
        assert (warp_keyframe(keyframe, target, settings).is_disoccluded == is_disoccluded).all()


def sphere_before_plane(sphere=(0.9, 0.1, 0.1), plane=(0.1, 0.1, 0.9)):
    return AnalyticScene(
        (
            Plane((0, 0, -2), (0, 0, 1), Material(plane)),
            Sphere((0, 0, 0), 0.7, Material(sphere)),
        )
    )


@pytest.mark.parametrize("shift", [(0.5, 0, 0), (0, 0.4, 0), (-0.3, 0.3, -0.5), (0.2, 0, 0.8), (0, 0, -1.0)])
def test_a_sphere_does_not_bleed_over_its_silhouette(shift):
    scene = sphere_before_plane()
    camera = camera_at((0, 0, 4), size=(160, 120))
    target = beside(camera, shift)
    got = warp_keyframe(keyframe_of(scene, camera), target, SETTINGS)
    _, shape_index = first_hits(scene, target.eye, ray_directions(target))
    scale = 4 / (4 + shift[2])
    # A splat is its pixel's size: half of it, and the overlap, may stand out over the silhouette;
    # where the sphere turns away from the keyframe, its tangent plane goes a pixel further.
    width = math.ceil(0.55 * scale) + 1
    sphere = shape_index == 2
    for of, where in ((2, ~sphere), (1, sphere)):
        beyond = scipy.ndimage.binary_erosion(where, np.ones((3, 3)), iterations=width, border_value=1)
        assert not ((got.shape_index == of) & ~got.is_disoccluded & beyond).any()


@pytest.mark.parametrize("shift", [(0.5, 0, 0), (-0.3, 0.3, -0.5)])
def test_colours_do_not_mix_over_a_silhouette(shift):
    scene = sphere_before_plane()
    camera = camera_at((0, 0, 4), size=(160, 120))
    got = warp_keyframe(keyframe_of(scene, camera), beside(camera, shift), SETTINGS)
    hue = got.color[..., 0] / (got.color[..., 0] + got.color[..., 2] + 1e-9)
    np.testing.assert_allclose(hue[got.shape_index == 2], 0.9, atol=1e-3)
    np.testing.assert_allclose(hue[(got.shape_index == 1) & ~got.is_disoccluded], 0.1, atol=1e-3)


ORDERS = {
    "sideways": ((0.25, 0, 0), (0, 0, 0)),
    "up": ((0.02, 0.2, 0), (0, 0, 0)),
    "forwards": ((0.05, 0.02, -0.4), (0, 0, 0)),
    "backwards": ((0.05, 0, 0.4), (0, 0, 0)),
    "aslant": ((0.2, -0.1, -0.3), (2, -4, 1)),
}


@pytest.mark.parametrize("motion", ORDERS)
@pytest.mark.parametrize("name", ["sphere", "room"])
def test_the_z_buffer_matches_the_painters_algorithm(name, motion):
    if name == "sphere":
        scene, camera = sphere_before_plane(), camera_at((0, 0, 4), size=(64, 48))
    else:
        scene, camera = room(), room_walk(3, size=(64, 48)).cameras[1]
    target = beside(camera, *ORDERS[motion])
    keyframe = keyframe_of(scene, camera)
    splats = _land(keyframe.geometry, target).splats
    longest = np.maximum(*(np.linalg.norm(side, axis=0) for side in (splats.by_x, splats.by_y)))
    table = list(
        zip(
            np.array(splats.x),
            np.array(splats.y),
            np.array(splats.inverse_depth),
            np.array(splats.by_x).T,
            np.array(splats.by_y).T,
            np.array(splats.slope).T,
            np.array(splats.is_splat) & (longest <= SETTINGS.max_magnification),
            strict=True,
        )
    )
    order = occlusion_compatible_order(camera, target)
    lanes = painted(table, order, target.width, target.height, math.inf)
    shape_indices = np.where(lanes >= 0, keyframe.geometry.shape_index.ravel()[lanes], 0)
    got = warp_keyframe(keyframe, target, SETTINGS)
    np.testing.assert_array_equal(got.is_disoccluded, lanes < 0)
    # The order holds for points; pixels have a width, so that their order is unsure where two surfaces
    # meet in an edge (no occlusion there, and the overlap of the splats decides).
    differs = got.shape_index != shape_indices
    edge = scipy.ndimage.generic_filter(got.shape_index, np.ptp, size=3, mode="nearest") > 0
    assert not (differs & ~edge).any()
    assert differs.mean() < 0.005


@pytest.mark.parametrize("shift", [(0.4, 0, 0), (-0.3, 0.1, -0.3), (0.1, 0, 0.5)])
def test_disocclusions_are_surfaces_that_the_keyframe_does_not_show(shift):
    scene = sphere_before_plane()
    camera = camera_at((0, 0, 4), size=(160, 120))
    target = beside(camera, shift)
    got = warp_keyframe(keyframe_of(scene, camera), target, SETTINGS)

    direction = ray_directions(target)
    depth, shape_index = first_hits(scene, target.eye, direction)
    world = target.eye + depth[..., None] * direction
    to_world = world - camera.eye
    seen_at, _ = first_hits(scene, camera.eye, to_world)
    at, ahead = projected(camera, world)
    is_inside = (ahead > 0) & (at > 0).all(-1) & (at < (camera.width, camera.height)).all(-1)
    is_seen = (seen_at > 1 - 1e-6) & is_inside

    # Splats end within half a pixel of the silhouette.
    shows = ~got.is_disoccluded & (got.shape_index == shape_index)
    wrong = shows != is_seen
    border = scipy.ndimage.binary_dilation(edges(is_seen) | edges(shape_index), np.ones((3, 3)))
    assert is_seen.mean() < 0.98
    assert not (wrong & ~border).any()


def edges(labels):
    """Pixels beside a pixel with another label."""
    low = scipy.ndimage.minimum_filter(labels.astype(int), 3, mode="nearest")
    high = scipy.ndimage.maximum_filter(labels.astype(int), 3, mode="nearest")
    return low != high


def test_values_of_disoccluded_pixels_are_zero():
    # The first pixel of the keyframe, to which empty keys would point, shows the sky.
    keyframe = keyframe_of(ball(), camera_at((0, 0, 4)))
    got = warp_keyframe(keyframe, beside(keyframe.geometry.camera, (0, 0, 0), (0, 15, 0)), SETTINGS)
    assert 0.1 < got.is_disoccluded.mean() < 0.6
    for values in (got.color, got.depth, got.shape_index, got.magnification):
        assert np.isfinite(values).all()
        assert not values[got.is_disoccluded].any()


def test_the_sky_moves_with_the_rotation():
    scene = ball(horizon=(0, 0, 0), zenith=(1, 1, 1))
    camera = camera_at((0, 0, 4))
    target = beside(camera, (0.3, 0.1, -0.2), (3, 0, 0))
    got = warp_keyframe(keyframe_of(scene, camera), target, SETTINGS)
    truth = keyframe_of(scene, target)
    sky = (got.shape_index == 0) & ~got.is_disoccluded & (truth.geometry.shape_index == 0)
    assert sky.mean() > 0.5
    assert not got.depth[sky].any()
    # The gradient rises by 0.006 a pixel; half a pixel is repeated at the border and beside the ball.
    np.testing.assert_allclose(got.color[sky], truth.shading.color[sky], atol=0.003)
    inner = scipy.ndimage.binary_erosion(sky, iterations=2)
    np.testing.assert_allclose(got.color[inner], truth.shading.color[inner], atol=1e-4)


def test_a_surface_before_the_sky_hides_it():
    camera = camera_at((0, 0, 4))
    target = beside(camera, (0.4, 0, 0))
    got = warp_keyframe(keyframe_of(ball(), camera), target, SETTINGS)
    _, shape_index = first_hits(ball(), target.eye, ray_directions(target))
    inner = scipy.ndimage.binary_erosion(shape_index == 1, iterations=2)
    visible = inner & ~got.is_disoccluded
    assert (got.shape_index[visible] == 1).all()


def test_surfaces_behind_the_camera_are_left_out():
    camera = room_walk(3).cameras[1]
    target = beside(camera, (0, 0, -3.2))  # through the lamp, close to the pillar
    got = warp_keyframe(keyframe_of(room(), camera), target, SETTINGS)
    for values in (got.color, got.depth, got.magnification):
        assert np.isfinite(values).all()
    assert (got.depth[~got.is_disoccluded & (got.shape_index > 0)] > 0).all()
    turned = warp_keyframe(keyframe_of(room(), camera), beside(camera, (0, 0, 0), (0, 180, 0)), SETTINGS)
    assert turned.is_disoccluded.all()


def test_another_size_of_image():
    keyframe = keyframe_of(wall(), camera_at((0, 0, 4), size=(64, 48)))
    target = camera_at((0, 0, 4), size=(96, 72))
    got = warp_keyframe(keyframe, target, SETTINGS)
    assert got.color.shape == (72, 96, 3)
    assert not got.is_disoccluded.any()
    np.testing.assert_allclose(got.magnification, 1.5**2, rtol=1e-3)


def test_both_halves_are_warped_alike():
    plain = keyframe_of(wall(), camera_at((0, 0, 4)))
    color = plain.shading.color
    halves = dataclasses.replace(plain, shading=Halves(color, 2 * color))
    single, pair = (warp_keyframe(k, camera_at((0.1, 0, 3)), SETTINGS) for k in (plain, halves))
    assert pair.shading.first.tobytes() == single.color.tobytes()
    np.testing.assert_allclose(pair.shading.second, 2 * single.color, rtol=1e-6)
    np.testing.assert_allclose(pair.color, 1.5 * single.color, rtol=1e-6)


def test_the_disparity_gradient_of_a_plane_is_exact():
    scene = AnalyticScene((PLANES["leaning"],))
    camera = camera_at((0.2, 0.1, 4))
    geometry = keyframe_of(scene, camera).geometry
    normal = np.array(PLANES["leaning"].normal)
    # 1 / depth = n . (P (x, y, 1)) / (n . (point - eye)): linear in x and y.
    exact = (normal @ camera.direction_from_pixel)[:2] / (normal @ -camera.eye)
    gradient = disparity_gradient(geometry)
    # Differences of float32 numbers near 0.25, each of them off by a few 3e-8.
    np.testing.assert_allclose(gradient, np.broadcast_to(exact, gradient.shape), atol=2e-7)


def test_the_disparity_gradient_is_exact_up_to_the_horizon():
    # The rows below the horizon have disparities 1, 2, 3 ... times the first: every step is large.
    camera = Camera(look_at((0, 0, 4), (0, 0, 0)), 50.0, 16, 40)
    geometry = keyframe_of(AnalyticScene((PLANES["floor"],)), camera).geometry
    gradient = disparity_gradient(geometry)
    np.testing.assert_allclose(gradient[20:, :, 1], 1.0 / camera.focal_px, rtol=1e-4)
    assert not gradient[:20].any()


def test_the_disparity_gradient_does_not_cross_jumps_and_shapes():
    camera = camera_at((0, 0, 4), size=(4, 1))

    def with_(disparity, shape_index):
        depth = np.where(np.array(shape_index) > 0, 1 / np.maximum(disparity, 1e-9), 0).astype(np.float32)[
            None
        ]
        zeros = np.zeros((1, 4, 3), np.float32)
        shape_indices = np.array([shape_index], np.uint32)
        return Geometry(camera, depth, zeros, zeros, shape_indices, np.zeros((1, 4), np.uint8))

    even = disparity_gradient(with_([0.50, 0.51, 0.52, 0.53], [1, 1, 1, 1]))[0, :, 0]
    np.testing.assert_allclose(even, 0.01, atol=1e-6)
    jump = disparity_gradient(with_([0.50, 0.51, 0.90, 0.92], [1, 1, 1, 1]))[0, :, 0]
    np.testing.assert_allclose(jump, [0.01, 0.01, 0.02, 0.02], atol=1e-6)
    other = disparity_gradient(with_([0.50, 0.51, 0.511, 0.53], [1, 1, 2, 2]))[0, :, 0]
    np.testing.assert_allclose(other, [0.01, 0.01, 0.019, 0.019], atol=1e-6)
    alone = disparity_gradient(with_([0.50, 0.51, 0.52, 0.0], [1, 2, 3, 0]))[0]
    assert not alone.any()


def test_a_thin_wall_seen_from_its_other_side_disappears():
    scene = AnalyticScene((Quad((0, -1, -1), (0, 0, 2), (0, 2, 0)),))
    keyframe = keyframe_of(scene, camera_at((0.5, 0, 4)))
    assert keyframe.geometry.is_hit.any()
    got = warp_keyframe(keyframe, camera_at((-0.5, 0, 4)), SETTINGS)  # from its other side
    # Left are pixels without a neighbour of the same surface, whose slope is not known.
    assert (got.shape_index == 1).sum() <= 0.03 * keyframe.geometry.is_hit.sum()


def test_an_image_of_one_pixel():
    keyframe = keyframe_of(wall(), camera_at((0, 0, 4), size=(1, 1)))
    got = warp_keyframe(keyframe, keyframe.geometry.camera, SETTINGS)
    assert got.color.tobytes() == keyframe.shading.color.tobytes()


def test_sample_positions_are_exact():
    # A ramp of colour over the wall shows any shift.
    camera = camera_at((0, 0, 4))
    keyframe = keyframe_of(wall(), camera)
    ramp = np.repeat(pixel_centres(camera)[..., :1], 3, axis=-1).astype(np.float32)
    keyframe = Keyframe(keyframe.geometry, Halves(ramp, ramp))
    target = beside(camera, (0.137, 0.071, -0.4))
    got = warp_keyframe(keyframe, target, SETTINGS)
    depth, _ = first_hits(wall(), target.eye, ray_directions(target))
    at, _ = projected(camera, target.eye + depth[..., None] * ray_directions(target))
    inner = (at > 1).all(-1) & (at < (camera.width - 1, camera.height - 1)).all(-1)
    error = np.abs(got.color[..., 0] - at[..., 0])[inner]
    assert error.max() < 0.5 / 256 + 1e-4  # positions are rounded to 1/256 px
