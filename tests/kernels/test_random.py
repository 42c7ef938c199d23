"""Random numbers are a function of what they are for, and of nothing else."""

import math

import drjit as dr
import numpy as np
import pytest

from enfilade.arrays import lanes
from enfilade.kernels.random import one_sequence, samplers
from enfilade.renderer import RandomKey

COUNT = 1 << 16
LIMIT = 5 / math.sqrt(COUNT)  # five standard errors of a correlation of nothing


def draw(pixel, path=0, *, seed=0, frame=0, purpose=0, draws=2):
    pixel, path = np.broadcast_arrays(np.asarray(pixel, np.uint32), np.asarray(path, np.uint32))
    sampler = samplers(lanes(pixel.ravel()), lanes(path.ravel()), RandomKey(seed, frame, purpose))
    return np.stack([np.array(sampler.next_1d()) for _ in range(draws)])


PIXELS = np.arange(COUNT)


def test_order_and_chunks_do_not_matter():
    whole = draw(PIXELS)
    order = np.random.default_rng(1).permutation(COUNT)
    np.testing.assert_array_equal(draw(order), whole[:, order])
    for part in (slice(0, 1), slice(100, 117), slice(COUNT - 1, None)):
        np.testing.assert_array_equal(draw(PIXELS[part]), whole[:, part])


def test_they_are_uniform():
    numbers = draw(PIXELS, draws=4).astype(float)
    assert numbers.min() >= 0.0
    assert numbers.max() < 1.0
    assert np.abs(numbers.mean(axis=1) - 0.5).max() < LIMIT * math.sqrt(1 / 12)
    counts, _ = np.histogram(numbers[0], 64, (0, 1))
    chi2 = ((counts - COUNT / 64) ** 2 / (COUNT / 64)).sum()
    assert abs(chi2 - 63) < 5 * math.sqrt(2 * 63)


OTHERS = {
    "next pixel": {"pixel": PIXELS + 1},
    "pixel below": {"pixel": PIXELS + 1920},
    "path 64": {"path": 64},
    "next seed": {"seed": 1},
    "far seed": {"seed": 2**32 - 1},
    "next frame": {"frame": 1},
    "frame 256": {"frame": 256},
    "last frame": {"frame": 2**24 - 1},
    "other purpose": {"purpose": 1},
    "last purpose": {"purpose": 255},
}


@pytest.mark.parametrize("name", OTHERS)
def test_other_uses_are_not_correlated(name):
    first, other = draw(PIXELS), draw(**({"pixel": PIXELS} | OTHERS[name]))
    assert (first != other).mean() > 0.999
    for a in first:
        for b in other:
            assert abs(np.corrcoef(a, b)[0, 1]) < LIMIT


def test_draws_of_one_stream_are_not_correlated():
    numbers = draw(PIXELS, draws=6)
    correlation = np.corrcoef(numbers) - np.eye(6)
    assert np.abs(correlation).max() < LIMIT


def test_neighbouring_pixels_are_not_correlated_over_paths():
    # A mean over few paths must not form a pattern in the image.
    means = np.mean([draw(np.arange(4096), path)[0] for path in range(16)], axis=0, dtype=float)
    assert abs(np.corrcoef(means[:-1], means[1:])[0, 1]) < 5 / math.sqrt(4095)
    # One path in each of 16 strata: at most a 256th of the variance of independent paths, 1 / 12 / 16.
    assert means.var() < 1.1 / 12 / 16**3


def test_frames_and_purposes_do_not_run_into_each_other():
    uses = {(frame, purpose) for frame in (0, 1, 2, 255, 256, 257) for purpose in (0, 1, 2, 3)}
    firsts = {draw(np.arange(4), frame=f, purpose=p).tobytes() for f, p in uses}
    assert len(firsts) == len(uses)


def test_seeds_are_not_compiled_into_the_kernel():
    draw(PIXELS)  # compiles
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        for seed, frame, purpose in ((3, 5, 0), (4, 6, 1), (2**32 - 1, 2**24 - 1, 2)):
            draw(PIXELS, seed=seed, frame=frame, purpose=purpose)
        compiled = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT and not k["cache_hit"]]
    assert not compiled


def squares(pixels, paths, dimension=0):
    """Points of the paths of some pixels, (2, pixels, paths)."""
    pixel, path = np.indices((pixels, paths), np.uint32).reshape(2, -1)
    sampler = samplers(lanes(pixel), lanes(path), RandomKey(3, 1, 2))
    for _ in range(dimension):
        sampler.next_1d()
    return np.array(sampler.next_2d()).reshape(2, pixels, paths).astype(float)


@pytest.mark.parametrize("dimension", [0, 1, 7])
@pytest.mark.parametrize("paths", [4, 16, 256])
def test_every_elementary_interval_has_one_path_of_a_pixel(paths, dimension):
    x, y = squares(64, paths, dimension)
    bits = paths.bit_length() - 1
    for columns in (2**k for k in range(bits + 1)):
        cell = np.floor(x * columns) * (paths // columns) + np.floor(y * (paths // columns))
        np.testing.assert_array_equal(np.sort(cell, axis=1), np.tile(np.arange(paths), (64, 1)))


@pytest.mark.parametrize("paths", [12, 100])
def test_any_number_of_paths_is_stratified(paths):
    """Error of the share of a pixel left of a tilted edge: far below that of independent points."""
    x, y = squares(64, paths)
    errors = ((x + 0.37 * y) < 0.6).mean(axis=1) - (0.6 - 0.37 / 2)
    assert np.sqrt(np.mean(np.square(errors))) < 0.6 * math.sqrt(0.24 / paths)


def test_each_path_alone_is_uniform_over_the_square():
    points = squares(2048, 8)[:, :, 5].T
    assert points.min() >= 0.0
    assert points.max() < 1.0
    limit = 5 / math.sqrt(len(points))
    assert np.abs(points.mean(axis=0) - 0.5).max() < limit * math.sqrt(1 / 12)
    assert abs(np.corrcoef(points.T)[0, 1]) < limit


def test_pairs_of_dimensions_are_not_correlated():
    # Means over the paths of a pixel of the product of two numbers. Successive paths lie in opposite halves
    # in all dimensions, so that their products are alike: as many as half of the paths are independent.
    a, b = squares(1024, 16), squares(1024, 16, dimension=1)
    products = ((a - 0.5) * (b - 0.5)).mean(axis=2)
    assert abs(products.mean()) < 5 / 12 / math.sqrt(products.size * 16)
    assert products.std() < 1 / 12 / math.sqrt(8)


def test_a_fork_draws_numbers_of_its_own():
    sampler = one_sequence(COUNT)
    same, other = sampler.copy(), sampler.fork(5)
    numbers = [np.array(of.next_1d()) for of in (sampler, same, other)]
    np.testing.assert_array_equal(numbers[0], numbers[1])
    assert abs(np.corrcoef(numbers[0], numbers[2])[0, 1]) < LIMIT
    # Forks of a fork are no copies of the original, and drawing from one sampler does not advance another.
    assert abs(np.corrcoef(numbers[0], np.array(one_sequence(COUNT).fork(5).fork(5).next_1d()))[0, 1]) < LIMIT
    np.testing.assert_array_equal(np.array(sampler.next_1d()), np.array(same.next_1d()))
