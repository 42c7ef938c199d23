"""The hash grid: keys against tuples, lookups against a dictionary."""

import drjit as dr
import numpy as np
import pytest

from enfilade.arrays import Array3f, Bool, Float, UInt
from enfilade.kernels.random import one_sequence
from enfilade.kernels.tone import REC709_LUMINANCE
from enfilade.methods.decoupled import hash_grid_entries as module
from enfilade.methods.decoupled.cache_query import CacheQuery, query_further
from enfilade.methods.decoupled.hash_grid import LEVELS, ORIGIN, SIZE_MASK, entry_key
from enfilade.methods.decoupled.hash_grid_entries import MAX_ERROR, MIN_SAMPLES, Entries
from enfilade.methods.decoupled.integrator import JITTER
from enfilade.methods.decoupled.irradiance_cache import IrradianceCache

UP = np.float32([[0.0, 0.0, 1.0]])


def keys(points, normals, width, level=0, shape_index=1):
    points, normals = np.asarray(points, np.float32).T, np.asarray(normals, np.float32).T
    return np.array(entry_key(Array3f(points), Array3f(normals), UInt(shape_index), Float(width), level))


def keys_of_levels(points, normals, width):
    return [keys(points, normals, width, level) for level in range(LEVELS + 1)]


def entries_of(key, light):
    """Entries of keys, with larger ones of which nothing but the size is known."""
    return Entries.of([key + np.uint64(level) for level in range(LEVELS + 1)], light)


def random_points(count, seed=0):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    return rng.uniform(-5.0, 5.0, (count, 3)), normals / np.linalg.norm(normals, axis=1, keepdims=True)


def names_of(points, normals, size):
    """Entries as tuples: place, and axis of the normal with its sign."""
    axis = np.abs(normals).argmax(axis=1)
    return [
        (*np.floor((p.astype(np.float32) + np.float32(ORIGIN)) / size).astype(int), a, n[a] < 0)
        for p, n, a in zip(points, normals, axis, strict=True)
    ]


@pytest.mark.parametrize(("width", "size"), [(0.7, 0.5), (0.004, 2.0**-8), (3e-4, 2.0**-12)])
def test_keys_are_one_to_one_with_entries_and_directions(width, size):
    # Widths are rounded down to a power of two; the smallest entries are those of a path near the camera.
    points, normals = random_points(30_000)
    names = names_of(points, normals, size)
    found = dict(zip(names, keys(points, normals, width), strict=True))
    assert all(found[name] == key for name, key in zip(names, keys(points, normals, width), strict=True))
    assert len(set(found.values())) == len(found)


def grid_at(point, width, shape_index=1, light=1.0):
    """An uploaded entry at one point."""
    key = keys([point], UP, width, shape_index=shape_index)
    return entries_of(np.repeat(key, MIN_SAMPLES), np.full((MIN_SAMPLES, 3), light)).upload()


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
    assert set(key & np.uint64(SIZE_MASK)) == {32}  # 2^0


def test_keys_are_spread_evenly():
    # Neighbouring entries: each bit of the key is set in half of them, and none depends on another. The
    # others are the exponent of the size.
    points = np.stack(np.meshgrid(*[np.arange(24.0)] * 3), -1).reshape(-1, 3) + 0.5
    key = keys(points, np.tile(UP, (len(points), 1)), 1.0)
    bits = (key[:, None] >> np.arange(7, 64, dtype=np.uint64)) & np.uint64(1)
    limit = 5.0 / np.sqrt(len(points))  # five standard errors of 57 means, and of 1596 correlations
    assert np.abs(2.0 * bits.mean(axis=0) - 1.0).max() < limit
    assert np.abs(np.corrcoef(bits.T) - np.eye(57)).max() < limit


def test_lookup_finds_the_mean_of_the_smallest_entry_with_enough_samples_without_those_of_smaller_ones():
    points, normals = random_points(4000)
    points[:3500] *= 0.25  # dense
    points[3900:] *= 10.0  # with few samples at every level
    light = np.abs(points) + 3.0 * (np.random.default_rng(1).random((4000, 1)) < 0.1)
    # Entries of one width are larger ones of the other.
    width = np.where(np.arange(4000) % 2, 1.2, 0.6).astype(np.float32)
    by_level = keys_of_levels(points, normals, width)
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


def test_lookups_that_are_distributed_as_the_samples_find_as_much_light():
    # Of two widths; nine tenths of the points in one corner, which is ten times as bright.
    points, normals = random_points(4000)
    points[:3600] *= 0.1
    light = np.random.default_rng(2).uniform(0.8, 1.2, (4000, 1)).repeat(3, axis=1)
    light[:3600] *= 10.0
    width = np.where(np.arange(4000) % 3, 0.6, 2.5).astype(np.float32)
    grid = Entries.of(keys_of_levels(points, normals, width), light).upload()
    position, normal = (Array3f(of.T.astype(np.float32)) for of in (points, normals))
    found, is_hit = (np.array(of) for of in grid.lookup(position, normal, UInt(1), Float(width)))
    assert 0.1 < is_hit[3600:].mean() < 1.0
    np.testing.assert_allclose(found[0].sum(), light[is_hit, 0].sum(), rtol=1e-5)


def seen_in_entries(light):
    """Lookups in four neighbouring entries with 64 estimates each, (4, 64), which have one parent."""
    points = np.float32([[x, y, 0.1] for y in (0.1, 0.6) for x in (0.1, 0.6)])
    every = np.repeat(points, light.shape[1], axis=0)
    levels = keys_of_levels(every, np.tile(UP, (len(every), 1)), 0.5)
    assert [len(np.unique(level)) for level in levels] == [4, 1, 1, 1]
    grid = Entries.of(levels, light.reshape(-1, 1).repeat(3, axis=1)).upload()
    at = Array3f(points.T), Array3f(*UP[0].tolist()), UInt(1), Float(0.5)
    return np.array(grid.lookup(*at)[0])[0]


def test_lit_and_dark_entries_keep_their_own_light():
    # Dark entries have larger relative errors, one of 98 percent: they are not left out.
    light = np.random.default_rng(3).exponential(0.01, (4, 64)) + np.array([1.0, 0.0, 0.0, 0.0])[:, None]
    light[3] = np.r_[0.32, np.full(63, 1e-4)]
    np.testing.assert_allclose(seen_in_entries(light), light.mean(axis=1), rtol=1e-5)


def test_light_that_few_paths_find_is_shared_by_all_entries_around():
    # Eight of 512 paths find light. Entries that have it, and those that missed it by chance, have the mean.
    light = np.full((4, 128), 0.01)
    light[[0, 0, 0, 2, 2, 2, 2, 3], [5, 28, 99, 2, 49, 50, 101, 17]] = 6.0
    np.testing.assert_allclose(seen_in_entries(light), light.mean(), rtol=1e-5)


def test_lookup_of_points_without_an_entry_misses():
    points, _ = random_points(200)
    grid = entries_of(keys(points * 0.0, np.tile(UP, (200, 1)), 0.7), np.ones((200, 3))).upload()
    far = Array3f((points + 50).T.astype(np.float32))
    assert not np.array(grid.lookup(far, Array3f(0, 0, 1), UInt(1), Float(0.7), Array3f(0.5))[1]).any()


def test_moved_points_without_an_entry_use_their_own():
    point = np.float32([[0.1, 0.2, 0.01 - ORIGIN]])
    own = entries_of(np.repeat(keys(point, UP, 0.5), MIN_SAMPLES), np.ones((MIN_SAMPLES, 3)))
    below = keys(point + np.float32([0.0, 0.0, -0.1]), UP, 0.5)
    assert below != keys(point, UP, 0.5)
    at = Array3f(point.T), Array3f(UP.T), UInt(1), Float(0.5)
    offset = Array3f(0.5, 0.5, 0.0)  # half an entry down
    light, is_found = own.upload().lookup(*at, offset)
    assert np.array(is_found).all()
    np.testing.assert_allclose(np.array(light), 1.0)
    both = Entries.joined([own, entries_of(np.repeat(below, MIN_SAMPLES), np.full((MIN_SAMPLES, 3), 7.0))])
    np.testing.assert_allclose(np.array(both.upload().lookup(*at, offset)[0]), 7.0)


@pytest.mark.parametrize("width", [2.0**k for k in range(-9, 3)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_planes_at_round_coordinates_lie_inside_of_entries(axis, width):
    # What rays hit lies on both sides of such a plane, by rounding.
    normal = np.eye(3)[[axis]]
    for at in (-3.0, -0.5, 0.0, 0.25, 2.0):
        points = np.full((3, 3), 0.3) + np.eye(3)[axis] * (at - 0.3 + np.array([[-1e-6], [0.0], [1e-6]]))
        assert len(set(keys(points, np.repeat(normal, 3, axis=0), width))) == 1


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.0, 0.6, 0.8)])
def test_jittered_lookups_interpolate_along_the_surface(normal):
    # A plane that is dark on one side of the border between two columns of entries, and lit on the other.
    tangents = np.array([(1.0, 0.0, 0.0), np.cross(normal, (1.0, 0.0, 0.0))])
    rng = np.random.default_rng(4)
    points = rng.uniform(-12.0, 12.0, (100_000, 2)) @ tangents + 0.37 * np.array(normal)
    light = np.where(points[:, :1] + ORIGIN < 0.0, 0.0, 1.0).repeat(3, axis=1) + 1.0
    normals = np.tile(np.float32([normal]), (len(points), 1))
    grid = Entries.of(keys_of_levels(points, normals, 1.0), light).upload()
    cache = IrradianceCache(view=None, images=(), weights=(), hash_grid=grid)

    ahead, count = np.linspace(-2.5, 2.5, 41), 4096
    across = rng.uniform(-6.0, 6.0, len(ahead) * count)
    points = np.column_stack([np.repeat(ahead - ORIGIN, count), across]) @ tangents + 0.37 * np.array(normal)
    query = CacheQuery(
        position=Array3f(points.T.astype(np.float32)),
        normal=Array3f(normal),
        shape_index=UInt(1),
        width=Float(1.0),
        weight=dr.full(Array3f, 1.0, len(points)),
        depth=UInt(1),
        sharp=(),
    )
    found, is_miss = query_further(cache, query, one_sequence(len(points)), Float(JITTER))
    assert not np.array(is_miss).any()
    ramp = np.array(found)[0].reshape(-1, count).mean(axis=1) - 1.0
    assert np.abs(ramp - np.clip(0.5 + ahead / JITTER, 0.0, 1.0)).max() < 0.08


def test_samples_of_entries_that_are_too_many_go_to_larger_ones(monkeypatch):
    points, normals = random_points(4000)
    entries = Entries.of(keys_of_levels(points, normals, 1.2), np.ones((4000, 3)))
    all_keys, _ = entries.chosen(MIN_SAMPLES)
    monkeypatch.setattr(module, "MAX_ENTRIES", len(all_keys) // 2)
    fewer = np.array(entries.upload().keys)
    assert 0 < len(fewer) <= len(all_keys) // 2
    np.testing.assert_array_equal(fewer, np.sort(entries.chosen(2 * MIN_SAMPLES)[0]))


def test_of_too_many_entries_those_with_most_samples_are_uploaded(monkeypatch):
    monkeypatch.setattr(module, "MAX_ENTRIES", 50)
    points, normals = random_points(200)
    key = keys(points, normals, 0.01)
    parts = [entries_of(k, np.ones((len(k), 3))) for k in (key, *[key] * 3, *[key[:40]] * 4)]
    kept = np.array(Entries.joined(parts).upload().keys)
    np.testing.assert_array_equal(kept, np.sort(key[:40]))


def test_samples_that_are_not_finite_are_left_out():
    light = np.ones((6, 3))
    light[2, 1], light[4, 0] = np.nan, np.inf
    entries = entries_of(np.full(6, 9, np.uint64), light)
    assert entries.counts.tolist() == [4]
    np.testing.assert_array_equal(entries.sums, [[4.0, 4.0, 4.0]])


def test_entries_at_which_lookups_find_others_are_left_out():
    def entry(*chain):
        return Entries.of([np.array([key], np.uint64) for key in chain], np.ones((1, 3)))

    # Of the chains from an entry to the larger ones around it, the last one of which is not looked up.
    others = entry(7, 100, 101, 102)
    beside = entry(1, 2, 3, 7)
    within, same = entry(4, 5, 7, 6), entry(7, 8, 9, 10)
    left = Entries.joined([beside, within, same]).without(others)
    assert left.keys.tolist() == [1]
    np.testing.assert_array_equal(left.larger, [[2, 3, 7]])
    np.testing.assert_array_equal(left.sums, np.ones((1, 3)))


@pytest.mark.parametrize("count", [0, MIN_SAMPLES - 1])
def test_entries_of_few_samples_are_not_uploaded(count):
    entries = Entries.joined([entries_of(np.full(count, 9, np.uint64), np.ones((count, 3)))])
    assert entries.upload() is None


def test_entries_whose_paths_found_no_light_are_not_uploaded():
    assert grid_at((0.3, 0.3, 0.3), 1.0, light=0.0) is None


def test_entries_with_most_of_their_light_from_one_path_are_not_uploaded():
    light = np.ones((14, 3))
    light[5] = 8.0
    key = np.full(14, 9, np.uint64)
    assert entries_of(key, light).upload() is not None
    light[5] = 30.0
    assert entries_of(key, light).upload() is None
    confirmed = [entries_of(key, light) for _ in range(4)]
    assert Entries.joined(confirmed).upload() is not None


@pytest.mark.parametrize("count", [1, 2, 3, 1024, 1025, 50_000])
def test_every_key_is_found_and_no_other(count):
    # Also those of the fullest bucket, and of the last one.
    points, normals = random_points(2 * count, seed=count)
    key = keys(points, normals, 1e-4)
    light = np.arange(1, count + 1)[:, None] * np.ones(3)
    grid = entries_of(key[:count], light).weighted(MIN_SAMPLES).upload()
    at = Array3f(points.T.astype(np.float32)), Array3f(normals.T.astype(np.float32)), UInt(1), Float(1e-4)
    found, is_hit = (np.array(v) for v in grid.lookup(*at))
    assert is_hit.tolist() == [True] * count + [False] * count
    np.testing.assert_allclose(found[:, :count], light.T)


def test_light_without_sharp_emitters_is_looked_up_apart():
    points, normals = random_points(400)
    light = np.random.default_rng(6).uniform(0.5, 1.5, (400, 6))
    own = np.repeat(np.arange(400), MIN_SAMPLES)
    levels = keys_of_levels(points[own], normals[own], 0.01)
    parts = [
        Entries.joined([]),
        Entries.of(levels, light[own]),
        Entries.of([np.zeros(0, np.uint64)] * 4, light[:0]),
    ]
    grid = Entries.joined(parts).upload()
    at = *(Array3f(of.T.astype(np.float32)) for of in (points, normals)), UInt(1), Float(0.01)
    for soft_only, expected in ((False, light[:, :3]), (True, light[:, 3:])):
        found, is_found = grid.lookup(*at, soft_only=soft_only)
        assert np.array(is_found).all()
        np.testing.assert_allclose(np.array(found).T, expected, rtol=1e-5)


def test_lanes_that_are_not_looked_up_find_nothing():
    grid = grid_at((0.3, 0.3, 0.3), 1.0)
    at = Array3f([0.3] * 2, [0.3] * 2, [0.3] * 2), Array3f(*UP[0].tolist()), UInt(1), Float(1.0)
    light, is_hit = (np.array(v) for v in grid.lookup(*at, where=Bool([True, False])))
    assert is_hit.tolist() == [True, False]
    np.testing.assert_array_equal(light, [[1.0, 0.0]] * 3)


def test_entries_of_fractional_weight_are_judged_with_their_group():
    # One of 16 estimates, and seven of one estimate that can tell nothing of their variance.
    points = np.float32([[x, y, z] for x in (0.1, 0.6) for y in (0.1, 0.6) for z in (0.1, 0.6)])
    points = points.repeat([16, *[1] * 7], axis=0)
    light = np.ones(len(points))
    light[:16] += 0.6 * np.tile([1.0, -1.0], 8)
    levels = keys_of_levels(points, np.tile(UP, (len(points), 1)), 0.5)
    entries = Entries.of(levels, light[:, None].repeat(3, axis=1)).weighted(0.25)
    assert levels[0][0] in entries.chosen(MIN_SAMPLES)[0]


@pytest.mark.parametrize("width", [0.0, 1e-12, 2.0**95, np.inf])
def test_sizes_at_the_limits_have_larger_ones(width):
    levels = keys_of_levels(np.zeros((1, 3)), UP, width)
    sizes = [int(key[0]) & SIZE_MASK for key in levels]
    assert sizes == list(range(sizes[0], sizes[0] + LEVELS + 1))
