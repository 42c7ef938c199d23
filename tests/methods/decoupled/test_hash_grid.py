"""The hash grid: keys against tuples, lookups against a dictionary."""

import numpy as np
import pytest

from enfilade.arrays import Array3f, Bool, Float, UInt
from enfilade.kernels.tone import REC709_LUMINANCE
from enfilade.methods.decoupled import hash_grid as module
from enfilade.methods.decoupled.hash_grid import (
    LEVELS,
    MAX_ERROR,
    MIN_SAMPLES,
    Entries,
    entry_key,
)
from enfilade.methods.decoupled.hash_grid_fill import gather_spp

UP = np.float32([[0.0, 0.0, 1.0]])


def keys(points, normals, width, level=0, shape_index=1):
    points, normals = np.asarray(points, np.float32).T, np.asarray(normals, np.float32).T
    return np.array(entry_key(Array3f(points), Array3f(normals), UInt(shape_index), Float(width), level))


def random_points(count, seed=0):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    return rng.uniform(-5.0, 5.0, (count, 3)), normals / np.linalg.norm(normals, axis=1, keepdims=True)


def names_of(points, normals, size):
    """Entries as tuples: cell, and axis of the normal with its sign."""
    axis = np.abs(normals).argmax(axis=1)
    return [
        (*np.floor(p.astype(np.float32) / size).astype(int), a, n[a] < 0)
        for p, n, a in zip(points, normals, axis, strict=True)
    ]


@pytest.mark.parametrize(("width", "size"), [(0.7, 0.5), (0.004, 2.0**-8), (3e-4, 2.0**-12)])
def test_keys_are_one_to_one_with_cells_and_directions(width, size):
    # Widths are rounded down to a power of two; the smallest cells are those of a path near the camera.
    points, normals = random_points(30_000)
    names = names_of(points, normals, size)
    found = dict(zip(names, keys(points, normals, width), strict=True))
    assert all(found[name] == key for name, key in zip(names, keys(points, normals, width), strict=True))
    assert len(set(found.values())) == len(found)


def grid_at(point, width, shape_index=1, light=1.0):
    """An uploaded entry at one point."""
    key = keys([point], UP, width, shape_index=shape_index)
    return Entries.of([np.repeat(key, MIN_SAMPLES)], np.full((MIN_SAMPLES, 3), light)).upload()


def is_found(grid, points, width, shape_index=1):
    """Whether lookups at points find an entry."""
    position = Array3f(np.float32(points).T)
    at = position, Array3f(*UP[0].tolist()), UInt(shape_index), Float(width)
    return np.array(grid.lookup(*at, Array3f(0.5))[1])


# Entries of the camera's paths 1 m away are ENTRY_PX pixels wide: 2 mm at 1280 pixels, 0.5 mm at 3840.
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(("width", "apart_m"), [(2.0**-9, 32.0), (2.0**-11, 8.0)])
def test_far_surfaces_do_not_share_entries(axis, width, apart_m):
    # At all distances of 2^k m, among them those at which coordinates of 14 bits repeat.
    near = np.full((1, 3), 0.3)
    far = near + np.eye(3)[axis] * np.array([[apart_m]] + [[2.0**k] for k in range(-2, 14)])
    grid = grid_at(near[0], width)
    assert is_found(grid, near, width).all()
    assert not is_found(grid, far, width).any()
    assert len({*keys(far[1:], np.tile(UP, (16, 1)), width).tolist()}) == 16


@pytest.mark.parametrize("shape_index", [1, 8191, 8192, 8193, 100_000])
def test_shapes_do_not_share_entries(shape_index):
    # Also those whose indices differ by 8192, or by any other power of two.
    point, others = [0.3, 0.3, 0.3], {shape_index ^ (1 << bit) for bit in range(31)} | {shape_index + 8192}
    grid = grid_at(point, 0.01, shape_index)
    assert is_found(grid, [point], 0.01, shape_index).all()
    assert not is_found(grid, [point] * len(others), 0.01, np.array(sorted(others), np.uint32)).any()


def test_sizes_do_not_share_entries():
    point = np.float32([[0.3, 0.3, 0.3]])
    by_size = {int(keys(0.0 * point, UP, 2.0**k)[0]) for k in range(-29, 40)}
    assert len(by_size) == 69
    points, normals = random_points(500)
    key = keys(points, normals, 0.7, 1)
    np.testing.assert_array_equal(key, keys(points, normals, 1.4, 0))
    assert set(key & np.uint64(127)) == {32}  # 2^0


def test_keys_are_spread_evenly():
    # Neighbouring cells: each bit of the key is set in half of them, and none depends on another. The others
    # are the exponent of the size.
    cells = np.stack(np.meshgrid(*[np.arange(24.0)] * 3), -1).reshape(-1, 3) + 0.5
    key = keys(cells, np.tile(UP, (len(cells), 1)), 1.0)
    bits = (key[:, None] >> np.arange(7, 64, dtype=np.uint64)) & np.uint64(1)
    limit = 5.0 / np.sqrt(len(cells))  # five standard errors of 57 means, and of 1596 correlations
    assert np.abs(2.0 * bits.mean(axis=0) - 1.0).max() < limit
    assert np.abs(np.corrcoef(bits.T) - np.eye(57)).max() < limit


def test_lookup_finds_the_mean_of_the_smallest_entry_with_enough_samples_without_those_of_smaller_ones():
    points, normals = random_points(4000)
    points[:3500] *= 0.25  # dense
    points[3900:] *= 10.0  # with few samples at every level
    light = np.abs(points) + 3.0 * (np.random.default_rng(1).random((4000, 1)) < 0.1)
    width = np.where(np.arange(4000) % 2, 1.2, 0.6).astype(
        np.float32
    )  # entries of one are larger ones of the other
    by_level = [keys(points, normals, width, level) for level in range(LEVELS + 1)]
    half = len(points) // 2
    parts = [Entries.of([key[of] for key in by_level], light[of]) for of in (slice(half), slice(half, None))]
    entries = Entries.joined(parts[::-1])  # in any order

    # Judge the entries from the smallest size up, by all samples that are not in a smaller one.
    luminance, size = light @ REC709_LUMINANCE, np.log2(width / 0.6).astype(int)
    chosen, is_left = {}, np.ones(len(points), bool)
    for now in range(LEVELS + 1):
        level = now - size
        is_here = is_left & (level >= 0) & (level < LEVELS)
        own, above = (np.choose(np.clip(level + k, 0, LEVELS), by_level) for k in (0, 1))
        for parent in np.unique(above[is_here]):
            children = [is_here & (own == key) for key in np.unique(own[is_here & (above == parent)])]
            freedom = max(sum(c.sum() - 1 for c in children), 1)
            variance = sum(c.sum() * luminance[c].var() for c in children) / freedom
            mean = luminance[np.any(children, axis=0)].mean()
            for child in children:
                if child.sum() >= MIN_SAMPLES and np.sqrt(variance / child.sum()) < MAX_ERROR * mean:
                    chosen[own[child][0]] = light[child].mean(axis=0)
                    is_left &= ~child

    at = Array3f(points.T.astype(np.float32)), Array3f(normals.T.astype(np.float32)), UInt(1), Float(width)
    found, is_hit = (np.array(v) for v in entries.upload().lookup(*at, Array3f(0.5)))
    used = []
    for i, of_point in enumerate(zip(*by_level[:LEVELS], strict=True)):
        levels = [level for level, key in enumerate(of_point) if key in chosen]
        assert is_hit[i] == bool(levels)
        if levels:
            np.testing.assert_allclose(found[:, i], chosen[of_point[levels[0]]], rtol=1e-5)
        used.append(levels[0] if levels else -1)
    assert np.bincount(np.array(used) + 1, minlength=LEVELS + 1).min() > 5


def test_samples_light_the_places_where_they_were_found_and_no_others():
    # A lit place that many paths reach, and dark ones beside it that few reach.
    noise = np.random.default_rng(2).normal(1.0, 0.1, (203, 1))
    many, few = np.float32([[0.1, 0.1, 0.1]]), np.float32([[0.6, 0.1, 0.1], [0.1, 0.6, 0.1], [0.6, 0.6, 0.1]])
    points = np.concatenate([many.repeat(200, axis=0), few, few])
    light = (
        noise.repeat(3, axis=1)[[*range(203), 200, 201, 202]] * np.r_[np.ones(200), np.full(6, 0.1)][:, None]
    )
    levels = [keys(points, np.tile(UP, (206, 1)), 0.5, level) for level in range(LEVELS + 1)]
    grid = Entries.of(levels, light).upload()
    found, is_hit = grid.lookup(Array3f(points.T), Array3f(*UP[0].tolist()), UInt(1), Float(0.5))
    assert np.array(is_hit).all()
    np.testing.assert_allclose(np.array(found)[0, 200:], light[200:, 0].mean(), rtol=1e-5)
    np.testing.assert_allclose(np.array(found)[0].sum(), light[:, 0].sum(), rtol=1e-5)


def seen_in_cells(light):
    """Lookups in four neighbouring cells with 64 estimates each, (4, 64), which have one parent."""
    points = np.float32([[x, y, 0.1] for y in (0.1, 0.6) for x in (0.1, 0.6)])
    every = np.repeat(points, light.shape[1], axis=0)
    levels = [keys(every, np.tile(UP, (len(every), 1)), 0.5, level) for level in range(LEVELS + 1)]
    assert [len(np.unique(level)) for level in levels] == [4, 1, 1, 1]
    grid = Entries.of(levels, light.reshape(-1, 1).repeat(3, axis=1)).upload()
    at = Array3f(points.T), Array3f(*UP[0].tolist()), UInt(1), Float(0.5)
    return np.array(grid.lookup(*at)[0])[0]


def test_lit_and_dark_entries_keep_their_own_light():
    # Dark entries have larger relative errors: they do not take the mean of lit ones instead.
    noise = np.random.default_rng(3).exponential(0.01, (4, 64))
    light = np.array([1.0, 0.0, 0.0, 0.0])[:, None] + noise
    np.testing.assert_allclose(seen_in_cells(light), light.mean(axis=1), rtol=1e-5)


def test_light_that_few_paths_find_is_shared_by_all_entries_around():
    # Eight of 512 paths find light. Entries that have it, and those that missed it by chance, have the mean.
    light = np.full((4, 128), 0.01)
    light[[0, 0, 0, 2, 2, 2, 2, 3], [5, 28, 99, 2, 49, 50, 101, 17]] = 6.0
    np.testing.assert_allclose(seen_in_cells(light), light.mean(), rtol=1e-5)


def test_lookup_of_points_without_an_entry_misses():
    points, _ = random_points(200)
    grid = Entries.of([keys(points * 0.0, np.tile(UP, (200, 1)), 0.7)], np.ones((200, 3))).upload()
    far = Array3f((points + 50).T.astype(np.float32))
    assert not np.array(grid.lookup(far, Array3f(0, 0, 1), UInt(1), Float(0.7), Array3f(0.5))[1]).any()


def test_moved_points_without_an_entry_use_their_own():
    point = np.float32([[0.1, 0.2, 0.01]])
    own = Entries.of([np.repeat(keys(point, UP, 0.5), MIN_SAMPLES)], np.ones((MIN_SAMPLES, 3)))
    below = keys(point + np.float32([0.0, 0.0, -0.1]), UP, 0.5)
    assert below != keys(point, UP, 0.5)
    at = Array3f(point.T), Array3f(UP.T), UInt(1), Float(0.5)
    offset = Array3f(0.5, 0.5, 0.0)  # half a cell down
    light, is_found = own.upload().lookup(*at, offset)
    assert np.array(is_found).all()
    np.testing.assert_allclose(np.array(light), 1.0)
    both = Entries.joined([own, Entries.of([np.repeat(below, MIN_SAMPLES)], np.full((MIN_SAMPLES, 3), 7.0))])
    np.testing.assert_allclose(np.array(both.upload().lookup(*at, offset)[0]), 7.0)


def test_of_too_many_entries_those_with_most_samples_are_uploaded(monkeypatch):
    monkeypatch.setattr(module, "MAX_ENTRIES", 50)
    points, normals = random_points(200)
    key = keys(points, normals, 0.01)
    parts = [Entries.of([k], np.ones((len(k), 3))) for k in (key, *[key] * 3, *[key[:40]] * 4)]
    kept = set(np.array(Entries.joined(parts).upload().keys).tolist())
    assert len(kept) == 50
    assert kept >= set(key[:40].tolist())


def test_samples_that_are_not_finite_are_left_out():
    light = np.ones((6, 3))
    light[2, 1], light[4, 0] = np.nan, np.inf
    entries = Entries.of([np.full(6, 9, np.uint64)], light)
    assert entries.counts.tolist() == [4]
    np.testing.assert_array_equal(entries.sums, [[4.0, 4.0, 4.0]])


@pytest.mark.parametrize("count", [0, MIN_SAMPLES - 1])
def test_entries_of_few_samples_are_not_uploaded(count):
    entries = Entries.joined([Entries.of([np.full(count, 9, np.uint64)], np.ones((count, 3)))])
    assert entries.upload() is None


def test_entries_whose_paths_found_no_light_are_not_uploaded():
    assert grid_at((0.3, 0.3, 0.3), 1.0, light=0.0) is None


def test_entries_with_most_of_their_light_from_one_path_are_not_uploaded():
    light = np.ones((14, 3))
    light[5] = 8.0
    key = np.full(14, 9, np.uint64)
    assert Entries.of([key], light).upload() is not None
    light[5] = 30.0
    assert Entries.of([key], light).upload() is None
    confirmed = [Entries.of([key], light) for _ in range(4)]
    assert Entries.joined(confirmed).upload() is not None


@pytest.mark.parametrize("count", [1, 2, 3, 1024, 1025, 50_000])
def test_every_key_is_found_and_no_other(count):
    # Also those of the fullest bucket, and of the last one.
    points, normals = random_points(2 * count, seed=count)
    key = keys(points, normals, 1e-4)
    light = np.arange(1, count + 1)[:, None] * np.ones(3)
    grid = Entries.of([key[:count]], light).weighted(MIN_SAMPLES).upload()
    at = Array3f(points.T.astype(np.float32)), Array3f(normals.T.astype(np.float32)), UInt(1), Float(1e-4)
    found, is_hit = (np.array(v) for v in grid.lookup(*at))
    assert is_hit.tolist() == [True] * count + [False] * count
    np.testing.assert_allclose(found[:, :count], light.T)


def test_lanes_that_are_not_looked_up_find_nothing():
    grid = grid_at((0.3, 0.3, 0.3), 1.0)
    at = Array3f([0.3] * 2, [0.3] * 2, [0.3] * 2), Array3f(*UP[0].tolist()), UInt(1), Float(1.0)
    light, is_hit = (np.array(v) for v in grid.lookup(*at, where=Bool([True, False])))
    assert is_hit.tolist() == [True, False]
    np.testing.assert_array_equal(light, [[1.0, 0.0]] * 3)


@pytest.mark.parametrize(
    ("width", "height", "spp"), [(64, 36, 4), (320, 180, 4), (480, 270, 2), (640, 360, 1), (960, 540, 1)]
)
def test_larger_frames_have_as_many_gather_rays_and_no_pixel_has_none(width, height, spp):
    assert gather_spp(width * height) == spp
