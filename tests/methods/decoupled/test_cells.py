"""Light in cells of space."""

import numpy as np
import pytest

from enfilade.arrays import Array3f, Float, UInt
from enfilade.methods.decoupled import cells as module
from enfilade.methods.decoupled.cells import LEAST_ESTIMATES, LEVELS, Estimates, cell_key


def keys(points, normals, width, coarser=0, shape_index=1):
    points, normals = np.asarray(points, np.float32).T, np.asarray(normals, np.float32).T
    return np.array(cell_key(Array3f(points), Array3f(normals), UInt(shape_index), Float(width), coarser))


def random_points(count, seed=0):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    return rng.uniform(-5.0, 5.0, (count, 3)), normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_a_key_is_a_cell_and_a_side():
    points, normals = random_points(3000)
    got = keys(points, normals, 0.7)
    size = 0.5  # the power of two below the width
    axis = np.abs(normals).argmax(axis=1)
    cell = [
        (*np.floor(p.astype(np.float32) / size).astype(int), a, n[a] < 0)
        for p, n, a in zip(points, normals, axis, strict=True)
    ]
    names = {}
    for key, of in zip(got, cell, strict=True):
        assert names.setdefault(key, of) == of
    assert len(names) == len(set(cell))


def test_items_do_not_meet():
    points, normals = random_points(500)
    assert set(keys(points, normals, 0.7, shape_index=3)).isdisjoint(
        keys(points, normals, 0.7, shape_index=4)
    )


def test_levels_do_not_meet():
    points, normals = random_points(500)
    levels = [set(keys(points, normals, 0.7, level)) for level in range(LEVELS)]
    assert all(a.isdisjoint(b) for i, a in enumerate(levels) for b in levels[:i])
    np.testing.assert_array_equal(keys(points, normals, 0.7, 1), keys(points, normals, 1.4, 0))


def test_what_was_estimated_is_found_again():
    points, normals = random_points(2000)
    light = np.abs(points)
    parts = [Estimates.of(keys(points, normals, 0.7, level), light) for level in range(LEVELS)]
    whole = Estimates.joined([*parts, *parts])  # twice, in any order
    mean = whole.sums / whole.counts[:, None]
    cells = whole.opened()
    found, is_known = cells.find(
        Array3f(points.T.astype(np.float32)),
        Array3f(normals.T.astype(np.float32)),
        UInt(1),
        Float(0.7),
        Array3f(0.5),
    )
    found, is_known = np.array(found).T, np.array(is_known)
    enough = dict(zip(whole.keys, whole.counts >= LEAST_ESTIMATES, strict=True))
    place = {key: i for i, key in enumerate(whole.keys)}
    by_level = [keys(points, normals, 0.7, level) for level in range(LEVELS)]
    for i in range(len(points)):
        first = next((k[i] for k in by_level if enough[k[i]]), None)
        assert is_known[i] == (first is not None)
        if first is not None:
            np.testing.assert_allclose(found[i], mean[place[first]], rtol=1e-5)
    assert 0.1 < is_known.mean() < 1.0


def test_of_too_many_cells_those_with_most_estimates_are_kept(monkeypatch):
    monkeypatch.setattr(module, "MOST", 50)
    points, normals = random_points(200)
    key = keys(points, normals, 0.01)
    parts = [Estimates.of(k, np.ones((len(k), 3))) for k in (key, *[key] * 3, *[key[:40]] * 4)]
    kept = set(np.array(Estimates.joined(parts).opened().keys).tolist())
    assert len(kept) == 50
    assert kept >= set(key[:40].tolist())


def test_far_away_nothing_is_known():
    points, _ = random_points(200)
    cells = Estimates.of(keys(points * 0.0, np.tile([0, 0, 1.0], (200, 1)), 0.7), np.ones((200, 3))).opened()
    _, is_known = cells.find(
        Array3f((points + 50).T.astype(np.float32)), Array3f(0, 0, 1), UInt(1), Float(0.7), Array3f(0.5)
    )
    assert not np.array(is_known).any()


def test_estimates_that_are_not_finite_are_left_out():
    light = np.ones((6, 3))
    light[2, 1], light[4, 0] = np.nan, np.inf
    estimates = Estimates.of(np.full(6, 9, np.uint64), light)
    assert estimates.counts.tolist() == [4]
    np.testing.assert_array_equal(estimates.sums, [[4.0, 4.0, 4.0]])


@pytest.mark.parametrize("count", [0, LEAST_ESTIMATES - 1])
def test_few_estimates_are_not_believed(count):
    estimates = Estimates.joined([Estimates.of(np.full(count, 9, np.uint64), np.ones((count, 3)))])
    assert estimates.opened() is None


def test_where_the_cell_next_door_is_unknown_the_point_finds_its_own():
    point, up = np.float32([[0.1, 0.2, 0.01]]), np.float32([[0.0, 0.0, 1.0]])
    own = Estimates.of(np.repeat(keys(point, up, 0.5), LEAST_ESTIMATES), np.ones((LEAST_ESTIMATES, 3)))
    beside = keys(point + np.float32([0.0, 0.0, -0.1]), up, 0.5)
    assert beside != keys(point, up, 0.5)
    at = Array3f(point.T), Array3f(up.T), UInt(1), Float(0.5)
    below = Array3f(0.5, 0.5, 0.0)  # half a cell down: nothing is known there
    light, is_known = own.opened().find(*at, below)
    assert np.array(is_known).all()
    np.testing.assert_allclose(np.array(light), 1.0)
    both = Estimates.joined([own, Estimates.of(np.repeat(beside, LEAST_ESTIMATES), np.full((4, 3), 7.0))])
    np.testing.assert_allclose(np.array(both.opened().find(*at, below)[0]), 7.0)
