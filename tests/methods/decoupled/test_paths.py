"""Paths as lanes: joined in order."""

import drjit as dr
import numpy as np

from enfilade.arrays import PCG32, Array3f, UInt
from enfilade.methods.decoupled.paths import joined, spawn
from enfilade.renderer import Bounce, Rays


def made(count, first):
    origin = Array3f(np.arange(3 * count, dtype=np.float32).reshape(count, 3).T + first)
    path = spawn(Rays(origin, Array3f(0, 0, 1) + dr.zeros(Array3f, count)), PCG32(count), spread=first)
    return path, (UInt(np.arange(count) + first), Bounce(origin, origin.x, origin.x > 5.0))


def test_trees_are_joined_lane_by_lane():
    parts = [made(3, 1), made(2, 10), made(1, 20)]
    path, (numbers, bounce) = joined(parts)
    assert np.array(numbers).tolist() == [1, 2, 3, 10, 11, 20]
    assert np.array(path.rays.origin.x).tolist() == [1, 4, 7, 10, 13, 20]
    assert np.array(path.spread).tolist() == [1, 1, 1, 10, 10, 20]
    assert np.array(bounce.is_delta).tolist() == [False, False, True, True, True, True]
    states = np.concatenate([np.array(p.rng.state) for p, _ in parts])
    assert np.array(path.rng.state).tolist() == states.tolist()
    assert path.bounce is None


def test_a_single_tree_stays_itself():
    only = made(4, 0)
    assert joined([only]) is only
