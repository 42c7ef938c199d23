"""The temporal filter along the image flow: against its twin, and its effect on aliasing."""

import dataclasses

import numpy as np
import pytest

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera, look_at
from enfilade.gbuffer import image_flow
from enfilade.methods.paper.spatial_filter import reconstruct
from enfilade.methods.paper.support import TemporalLimits, spatial_support_px
from enfilade.methods.paper.temporal_filter import Slice, filter_along_flow
from enfilade.records import Flow, Geometry
from enfilade.settings import AntialiasSettings
from support.analytic_scene import AnalyticScene, Checker, Material, Plane, Quad
from support.analytic_truth import geometry_of, psnr, traced_image
from support.example_scenes import room, room_walk
from twins.trajectory import filtered

H, W = 14, 18
CAMERA = Camera(look_at((0, 0, 1), (0, 0, 0)), 50.0, W, H)
SETTINGS = AntialiasSettings(separate_shapes=False)
SEPARATED = AntialiasSettings(separate_shapes=True)


def limits(reach, least=None):
    reach = np.broadcast_to(np.asarray(reach, np.float32), (H, W)).copy()
    least = reach if least is None else np.broadcast_to(np.asarray(least, np.float32), (H, W)).copy()
    return TemporalLimits(reach, least)


def noise_slice(seed, flow_scale=1.0):
    """A frame of noise with random flow over two shapes."""
    random = np.random.default_rng(seed)
    zeros = np.zeros((H, W, 3), np.float32)
    depth = random.uniform(1.0, 1.04, (H, W)).astype(np.float32)
    shape_index = (1 + (random.random((H, W)) < 0.2)).astype(np.uint32)
    geometry = Geometry(CAMERA, depth, zeros, zeros, shape_index, np.ones((H, W), np.uint8))
    forward, backward = (flow_scale * random.normal(0.3, 1.0, (2, H, W, 2))).astype(np.float32)
    flow = Flow(backward, forward, has_backward=True, has_forward=True)
    return Slice(random.random((H, W, 3)).astype(np.float32), geometry, flow)


@pytest.mark.parametrize(
    ("earlier", "later", "reach", "least", "flow_scale"),
    [
        (3, 3, 3, 3, 1.0),
        (0, 4, 5, 5, 1.0),
        (4, 1, 5, 5, 2.0),
        (5, 5, 5, 2, 0.1),  # slow: ends where half a pixel is covered
        (0, 0, 5, 5, 1.0),
        (3, 3, 1, 1, 1.0),  # more neighbours than the reach
        (2, 2, 0, 0, 1.0),
    ],
)
@pytest.mark.parametrize("settings", [SETTINGS, SEPARATED], ids=["together", "separated"])
def test_filtering_matches_its_twin(earlier, later, reach, least, flow_scale, settings):
    frame = noise_slice(1, flow_scale)
    before = [noise_slice(10 + k, flow_scale) for k in range(earlier)]
    after = [noise_slice(20 + k, flow_scale) for k in range(later)]
    of = limits(reach, least)
    got = filter_along_flow(frame, before, after, of, settings)
    expected = filtered(frame, before, after, of.reach, of.least, separate_shapes=settings.separate_shapes)
    # Positions are rounded to 1/256 px, where float32 may choose another one: a weight then differs by 1/256.
    assert (np.abs(got - expected) < 3e-6).mean() > 0.97
    np.testing.assert_allclose(got, expected, atol=0.02)


def test_each_pixel_has_its_own_reach():
    frame, before, after = noise_slice(1), [noise_slice(2), noise_slice(3)], [noise_slice(4), noise_slice(5)]
    reach = np.arange(H * W).reshape(H, W) % 3
    got = filter_along_flow(frame, before, after, limits(reach), SETTINGS)
    for value in range(3):
        alone = filter_along_flow(frame, before, after, limits(value), SETTINGS)
        np.testing.assert_array_equal(got[reach == value], alone[reach == value])


def test_a_support_of_one_frame_changes_nothing():
    frame = noise_slice(1)
    got = filter_along_flow(frame, [noise_slice(2)], [noise_slice(3)], limits(0), SETTINGS)
    assert got.tobytes() == frame.color.tobytes()


@pytest.mark.parametrize("settings", [SETTINGS, SEPARATED], ids=["together", "separated"])
def test_static_frames_are_unchanged(settings):
    frame = noise_slice(1, flow_scale=0.0)
    got = filter_along_flow(frame, [frame] * 7, [frame] * 7, limits(7, 5), settings)
    np.testing.assert_allclose(got, frame.color, rtol=1e-6)  # 15 products, summed and divided in float32


def weights_of(frames, speed_px, *, reach=7, least=5):
    """Weights of the frame and of the later ones, from impulses in one frame at a time."""

    def slice_(value):
        one = noise_slice(1, 0.0)
        forward = np.full((H, W, 2), (speed_px, 0), np.float32)
        return Slice(
            np.full((H, W, 3), value, np.float32),
            one.geometry,
            Flow(-forward, forward, has_backward=True, has_forward=True),
        )

    def share(n):
        later = [slice_(float(k == n)) for k in range(1, frames + 1)]
        got = filter_along_flow(slice_(float(n == 0)), [], later, limits(reach, least), SETTINGS)
        return float(got[H // 2, 2, 0])

    return np.array([share(n) for n in range(frames + 1)])


def test_weights_are_a_gaussian_over_the_support():
    weights = weights_of(7, 0.01)
    sigma = 15 / 6
    np.testing.assert_allclose(weights / weights[0], np.exp(-0.5 * (np.arange(8) / sigma) ** 2), rtol=1e-5)
    eleven = weights_of(5, 1.0, reach=5)
    np.testing.assert_allclose(eleven[5] / eleven[0], np.exp(-0.5 * (5 / (11 / 6)) ** 2), rtol=1e-5)


@pytest.mark.parametrize(
    ("speed_px", "frames"),
    [
        (0.01, 7),  # half a pixel is never covered: up to 15 frames
        (0.09, 6),  # after five frames 0.45 px: one more
        (0.08, 7),  # 0.40, 0.48: two more
        (0.101, 5),  # covered at the end of the 11 frames
        (0.3, 5),
    ],
)
def test_slow_trajectories_end_when_they_cover_half_a_pixel(speed_px, frames):
    assert (weights_of(7, speed_px) > 0).sum() - 1 == frames


def test_a_trajectory_ends_at_the_border():
    frame = noise_slice(1, 0.0)
    out = Flow(
        np.zeros((H, W, 2), np.float32),
        np.full((H, W, 2), (0.0, 4.0), np.float32),
        has_backward=True,
        has_forward=True,
    )
    white = Slice(np.ones((H, W, 3), np.float32), frame.geometry, out)
    black = Slice(np.zeros((H, W, 3), np.float32), frame.geometry, out)
    got = filter_along_flow(black, [], [white] * 3, limits(3), SETTINGS)[:, 0, 0]
    assert not got[H - 4 :].any()  # the next frame is already outside
    assert (got[: H - 4] > 0.1).all()
    assert (np.diff(got[[0, H - 9, H - 5]]) < 0).all()  # three, two and one of them


def sequence(scene, path, *, support=True):
    """Slices of a whole path, each traced once a pixel."""
    slices = []
    for frame in range(len(path)):
        camera = path.cameras[frame]
        geometry = geometry_of(scene, camera)
        flow = image_flow(geometry, *path.neighbours(frame))
        color = traced_image(scene, camera).color
        if support:
            still = np.zeros(geometry.depth.shape, np.float32)
            color = reconstruct(color, spatial_support_px(still, 28.0, SETTINGS))
        slices.append(Slice(color, geometry, flow))
    return slices


def middle_filtered(slices, settings=SETTINGS, reach=5):
    middle = len(slices) // 2
    size = slices[0].geometry.depth.shape
    of = TemporalLimits(*(np.full(size, reach, np.float32) for _ in range(2)))
    return filter_along_flow(slices[middle], slices[middle - 1 :: -1], slices[middle + 1 :], of, settings)


def test_a_moving_texture_has_less_aliasing():
    # Checks of 0.8 px alias; the samples along the flow lie at different places in the pixel.
    checks = Material(Checker((1, 1, 1), (0, 0, 0), period=0.11))
    scene = AnalyticScene((Plane((0, 0, 0), (0, 0, 1), checks),))
    size, step = (64, 48), 0.0237  # 0.34 px a frame
    cameras = tuple(
        Camera(look_at((step * i, 0.4 * step * i, 4), (step * i, 0.4 * step * i, 0)), 45.0, *size)
        for i in range(11)
    )
    path = CameraPath(cameras, tuple(range(11)), 30.0)
    slices = sequence(scene, path)
    truth = traced_image(scene, cameras[5], spp=256, box=True).color
    raw = traced_image(scene, cameras[5]).color
    inner = (slice(6, -6), slice(6, -6))
    errors = [
        psnr(image[inner], truth[inner].astype(float))
        for image in (raw, slices[5].color, middle_filtered(slices))
    ]
    assert errors[1] > errors[0] + 3  # the spatial filter helps,
    assert errors[2] > errors[1] + 6  # the motion-compensated one much more


def test_motion_compensation_keeps_patterns_sharp():
    # The same average without flow blurs along the motion.
    scene, path = room(), room_walk(48)
    slices = sequence(scene, path, support=False)[18:29]
    still = [
        dataclasses.replace(
            s, flow=Flow(0 * s.flow.backward, 0 * s.flow.forward, has_backward=True, has_forward=True)
        )
        for s in slices
    ]
    truth = traced_image(scene, path.cameras[23], spp=64, box=True).color.astype(float)
    with_flow, without = (psnr(middle_filtered(s), truth) for s in (slices, still))
    assert with_flow > without + 2
    assert with_flow > psnr(slices[5].color, truth)  # and better than one sample a pixel


def test_flow_separation_leaves_no_ghost_beside_an_occluder():
    # A white post before a black wall: where the post hides the wall, trajectories of the wall end.
    white = Material((1.0, 1.0, 1.0))
    scene = AnalyticScene(
        (
            Plane((0, 0, -3), (0, 0, 1), Material((0.0, 0.0, 0.0))),
            Quad((-0.1, -5, 2), (0.2, 0, 0), (0, 10, 0), white),
        ),
        light=(0, 0, 0),
        ambient=(1, 1, 1),
    )
    cameras = tuple(Camera(look_at((0.06 * i, 0, 4), (0.06 * i, 0, 0)), 45.0, 64, 24) for i in range(-5, 6))
    slices = sequence(scene, CameraPath(cameras, tuple(range(11)), 30.0), support=False)
    wall = slices[5].geometry.shape_index == 1
    ghost = middle_filtered(slices)[wall][:, 0]
    apart = middle_filtered(slices, SEPARATED)[wall][:, 0]
    assert ghost.max() > 0.1
    # A trajectory that just misses the post interpolates half a pixel of it.
    assert apart.sum() < 0.3 * ghost.sum()
    post = middle_filtered(slices, SEPARATED)[slices[5].geometry.shape_index == 2][:, 0]
    assert post.min() > 0.6
