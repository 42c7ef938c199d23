"""Random numbers are a function of what they are for, and of nothing else."""

import math

import drjit as dr
import numpy as np
import pytest

from enfilade.arrays import Float, UInt, lanes
from enfilade.kernels.random import PrefixedRng, stratified, stratified4, streams
from enfilade.renderer import RandomKey

COUNT = 1 << 16
LIMIT = 5 / math.sqrt(COUNT)  # five standard errors of a correlation of nothing


def draw(pixel, path=0, *, seed=0, frame=0, purpose=0, draws=2):
    pixel, path = np.broadcast_arrays(np.asarray(pixel, np.uint32), np.asarray(path, np.uint32))
    rng = streams(lanes(pixel.ravel()), lanes(path.ravel()), RandomKey(seed, frame, purpose))
    return np.stack([np.array(rng.next_float32()) for _ in range(draws)])


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
    "next path": {"path": 1},
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
    means = np.mean([draw(np.arange(4096), path)[0] for path in range(16)], axis=0)
    assert abs(np.corrcoef(means[:-1], means[1:])[0, 1]) < 5 / math.sqrt(4095)
    assert means.var() == pytest.approx(1 / 12 / 16, rel=5 * math.sqrt(2 / 4096))


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


def squares(pixels, paths):
    """Points of the paths of some pixels, (2, pixels, paths)."""
    pixel, path = np.indices((pixels, paths), np.uint32).reshape(2, -1)
    points = np.array(stratified(lanes(pixel), lanes(path), RandomKey(0, 0, 0)))
    return points.reshape(2, pixels, paths).astype(float)


@pytest.mark.parametrize("paths", [16, 64, 256])
def test_the_paths_of_a_pixel_are_stratified(paths):
    """Error of the share of a pixel left of a tilted edge: far below that of independent points."""
    x, y = squares(64, paths)
    errors = ((x + 0.37 * y) < 0.6).mean(axis=1) - (0.6 - 0.37 / 2)
    assert np.sqrt(np.mean(np.square(errors))) < 0.6 * math.sqrt(0.24 / paths)


def test_each_path_alone_is_uniform_over_the_pixel():
    points = squares(2048, 8)[:, :, 5].T
    assert points.min() >= 0.0
    assert points.max() < 1.0
    limit = 5 / math.sqrt(len(points))
    assert np.abs(points.mean(axis=0) - 0.5).max() < limit * math.sqrt(1 / 12)
    assert abs(np.corrcoef(points.T)[0, 1]) < limit


def test_the_paths_of_a_pixel_are_stratified_in_four_dimensions():
    use = RandomKey(3, 1, 2)
    pixel, path = np.repeat(np.arange(64, dtype=np.uint32), 64), np.tile(np.arange(64, dtype=np.uint32), 64)
    points = np.stack([np.array(x) for x in stratified4(lanes(pixel), lanes(path), use)])
    assert points.min() >= 0.0
    assert points.max() < 1.0
    # Integrals of smooth functions: the mean over a pixel's paths errs far less than that of random points.
    means = np.cos(2 * np.pi * points).reshape(4, 64, 64).mean(axis=2)
    assert (means.std(axis=1) < 0.25 * math.sqrt(0.5 / 64)).all()
    # Each path by itself is uniform.
    first = points.reshape(4, 64, 64)[:, :, 0]
    assert (np.abs(first.mean(axis=1) - 0.5) < 5 * math.sqrt(1 / 12 / 64)).all()


def test_given_numbers_lead():
    pixel = lanes(np.arange(8, dtype=np.uint32))
    rng, alone = (streams(pixel, UInt(0), RandomKey(1, 2, 3)) for _ in "ab")
    prefixed = PrefixedRng([Float(0.25), Float(0.5)], rng)
    assert np.array(prefixed.next_float32()).tolist() == [0.25]
    assert np.array(prefixed.next_float32()).tolist() == [0.5]
    np.testing.assert_array_equal(np.array(prefixed.next_float32()), np.array(alone.next_float32()))
