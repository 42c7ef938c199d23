"""The kernel against NumPy: one channel of any size, and whole comparisons."""

import numpy as np
import pytest

from enfilade.device import activate
from enfilade.metric import Aqm, MetricOptions, SequenceAqm
from enfilade.metric.pyramid import double, halved_shape
from enfilade.viewing import Viewing

activate("cpu")

from enfilade.metric.kernels import gathered_energies  # noqa: E402  after the device is chosen

START = 5


def plain(channel, weight, shape, summed):
    """Means over squares, by their definition."""
    rows, columns = (slice(START, START + n) for n in shape)
    before, difference = (plane[rows, columns].astype(float) * weight for plane in channel)
    after = before + difference
    energies = before**2, after**2, np.abs(after * np.abs(after) - before * np.abs(before))
    means = []
    for energy in energies:
        whole = np.zeros([-(-n // summed) * summed for n in shape])
        whole[: shape[0], : shape[1]] = energy
        squares = whole.reshape(whole.shape[0] // summed, summed, -1, summed)
        means.append(squares.mean(axis=(1, 3)))
    return means


@pytest.mark.parametrize("summed", [1, 2, 8])
@pytest.mark.parametrize("shape", [(1, 1), (2, 37), (47, 61), (64, 48)])
@pytest.mark.parametrize("spread", [0, 1, 2])
def test_energies_of_a_channel(summed, shape, spread):
    random = np.random.default_rng(2)
    channel = random.standard_normal((2, shape[0] + 11, shape[1] + 8)).astype(np.float32)
    size = {0: (), 1: shape, 2: halved_shape(shape, 2)}[spread]
    weight = np.asarray(random.uniform(0.5, 2.0, size), np.float32)
    found = gathered_energies(
        *channel, weight, weight_step=max(spread, 1), start=START, shape=shape, summed=summed
    )
    everywhere = double(weight, shape) if spread == 2 else weight
    for energy, expected in zip(found, plain(channel, everywhere, shape, summed), strict=True):
        np.testing.assert_allclose(energy, expected, rtol=2e-5, atol=2e-6)


@pytest.mark.parametrize("ppd", [6.0, 28.0, 130.0])
@pytest.mark.parametrize("moves", [False, True])
def test_comparisons_are_those_of_numpy(ppd, moves):
    viewing = Viewing(640, 480, distance_m=0.5 * ppd / 27.93).cropped(101, 66)
    random = np.random.default_rng(7)
    reference = random.uniform(5.0, 90.0, (66, 101)).astype(np.float32)
    test = reference.copy()
    test[20:40, 30:60] *= np.float32(0.8)
    velocity = random.uniform(-5.0, 5.0, (66, 101, 2)).astype(np.float32) if moves else None
    noise = np.full_like(reference, 0.5)
    for options in (MetricOptions.modern(), MetricOptions.modern().without("luminance_adaptive")):
        found, expected = (
            Aqm(viewing, options=options, has_kernels=has).compare(
                test, reference, velocity=velocity, noise_variance=noise
            )
            for has in (True, False)
        )
        assert expected.score > 0.5
        np.testing.assert_allclose(found.jnd, expected.jnd, rtol=2e-3, atol=2e-3 * expected.jnd.max())
        # The last of every second sample may lie in the border, where NumPy repeats the one before.
        assert found.score == pytest.approx(expected.score, rel=5e-4)


def test_equal_images_give_exactly_zero():
    viewing = Viewing(640, 480).cropped(80, 60)
    image = np.random.default_rng(1).uniform(5.0, 90.0, (60, 80)).astype(np.float32)
    flow = np.full((60, 80, 2), 2.5, np.float32)
    judge = SequenceAqm(viewing, has_kernels=True)
    for _ in range(2):
        assert judge.judge(image, image.copy(), backward_flow_px=flow).score == 0.0
