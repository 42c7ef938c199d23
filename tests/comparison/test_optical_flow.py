"""Estimated flow against shifts that are known."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

from enfilade.comparison.optical_flow import FlowEstimator
from enfilade.errors import InputError


def texture(height, width, seed=0, sigma=2.0):
    noise = gaussian_filter(np.random.default_rng(seed).standard_normal((height, width)), sigma, mode="wrap")
    return (0.4 + 0.12 * noise / noise.std()).astype(np.float32)


def moved(image, right, down):
    return shift(image, (down, right), order=3, mode="wrap").astype(np.float32)


@pytest.mark.parametrize(
    ("size", "motion", "tolerance_px"),
    [
        ((240, 320), (3.3, -1.6), 0.1),
        ((240, 320), (0.25, 0.0), 0.1),
        ((240, 320), (-14.0, 6.0), 0.1),
        ((600, 1200), (5.0, 2.5), 0.2),  # halved before the search
    ],
)
def test_a_known_shift_is_found(size, motion, tolerance_px):
    height, width = size
    estimator = FlowEstimator(width, height)
    now = texture(height, width)
    lumas = [estimator.luma(image) for image in (moved(now, *np.negative(motion)), now, moved(now, *motion))]
    flow = estimator.flow(lumas[1], lumas[0], lumas[2])
    assert (flow.has_backward, flow.has_forward) == (True, True)
    inner = slice(40, -40), slice(40, -40)
    error = np.hypot(*np.moveaxis(flow.motion[inner] - np.float32(motion), -1, 0))
    assert np.median(error) < tolerance_px
    np.testing.assert_allclose(np.median(flow.forward[inner], axis=(0, 1)), motion, atol=2 * tolerance_px)
    np.testing.assert_allclose(
        np.median(flow.backward[inner], axis=(0, 1)), np.negative(motion), atol=2 * tolerance_px
    )


def test_what_stands_still_has_exactly_no_flow():
    estimator = FlowEstimator(64, 48)
    luma = estimator.luma(texture(48, 64))
    flow = estimator.flow(luma, luma, luma)
    assert not flow.motion.any()
    assert flow.has_backward
    assert flow.has_forward


@pytest.mark.parametrize("sigma", [0.02, 0.06, 0.15])
@pytest.mark.parametrize("right", [0.0, 3.3, 12.0])
def test_noise_is_no_motion_and_hides_none(sigma, right):
    # as of a path tracer: independent from frame to frame
    rng = np.random.default_rng(3)
    estimator = FlowEstimator(320, 240)
    still = texture(240, 320)
    lumas = [
        estimator.luma(image + rng.normal(0.0, sigma, image.shape).astype(np.float32))
        for image in (moved(still, -right, 0.0), still, moved(still, right, 0.0))
    ]
    flow = estimator.flow(lumas[1], lumas[0], lumas[2])
    assert (flow.has_backward, flow.has_forward) == (True, True)  # no cut
    error = np.hypot(flow.motion[..., 0] - right, flow.motion[..., 1])
    assert np.median(error[40:-40, 40:-40]) < 0.02 + 1.5 * sigma


def test_there_is_no_flow_across_a_cut():
    estimator = FlowEstimator(160, 120)
    one, other = estimator.luma(texture(120, 160)), estimator.luma(texture(120, 160, seed=9))
    flow = estimator.flow(one, other, None)
    assert (flow.has_backward, flow.has_forward) == (False, False)
    assert not flow.motion.any()


def test_the_same_images_give_the_same_bytes():
    now = texture(120, 160)
    flows = []
    for _ in range(2):
        estimator = FlowEstimator(160, 120)
        flows.append(estimator.flow(estimator.luma(now), None, estimator.luma(moved(now, 2.0, 1.0))).forward)
    assert flows[0].tobytes() == flows[1].tobytes()


@pytest.mark.parametrize("size", [(1, 1), (5, 9), (9, 300), (31, 33)])
def test_tiny_images(size):
    estimator = FlowEstimator(size[1], size[0])
    rng = np.random.default_rng(1)
    lumas = [estimator.luma(rng.random(size, np.float32)) for _ in range(2)]
    flow = estimator.flow(lumas[0], None, lumas[1])
    assert flow.forward.shape == (*size, 2)
    assert np.isfinite(flow.forward).all()


def test_another_size_is_refused():
    with pytest.raises(InputError, match=r"shape \(4, 6\), not \(48, 64\)"):
        FlowEstimator(64, 48).luma(np.zeros((4, 6), np.float32))


@pytest.mark.parametrize(
    ("size", "searched"), [((4000, 1000), (1000, 250)), ((1000, 4000), (250, 1000)), ((2000, 10), (1000, 32))]
)
def test_large_images_are_searched_small_however_they_stand(size, searched):
    width, height = size
    luma = FlowEstimator(width, height).luma(np.zeros((height, width), np.float32))
    assert luma.shape == searched[::-1]
