"""Paths as lanes: joined in order, and what they contribute."""

from dataclasses import replace
from types import SimpleNamespace

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, Bool, UInt, rows
from enfilade.kernels.random import one_sequence
from enfilade.methods.decoupled.paths import Contributions, compact, joined, merged, spawn
from enfilade.renderer import Bounce, Branch, Rays


def made(count, first):
    origin = Array3f(np.arange(3 * count, dtype=np.float32).reshape(count, 3).T + first)
    path = spawn(Rays(origin, Array3f(0, 0, 1) + dr.zeros(Array3f, count)), one_sequence(count), spread=first)
    return path, (UInt(np.arange(count) + first), Bounce(origin, origin.x, origin.x > 5.0, origin.x > 9.0))


def test_trees_are_joined_lane_by_lane():
    parts = [made(3, 1), made(2, 10), made(1, 20)]
    path, (numbers, bounce) = joined(parts)
    assert np.array(numbers).tolist() == [1, 2, 3, 10, 11, 20]
    assert np.array(path.rays.origin.x).tolist() == [1, 4, 7, 10, 13, 20]
    assert np.array(path.spread).tolist() == [1, 1, 1, 10, 10, 20]
    assert np.array(bounce.is_delta).tolist() == [False, False, True, True, True, True]
    states = np.concatenate([np.array(p.sampler.path) for p, _ in parts])
    assert np.array(path.sampler.path).tolist() == states.tolist()
    assert path.bounce is None


def test_only_interfaces_lead_into_glass_and_out_of_it():
    path, _ = made(4, 1)
    path = replace(path, is_within=Bool([False, True, True, False]))
    sample = SimpleNamespace(
        is_interface=Bool([True, True, False, False]), is_within=Bool([True, False, False, False])
    )
    assert np.array(path.is_within_after(sample)).tolist() == [True, False, True, False]


def test_a_single_tree_stays_itself():
    only = made(4, 0)
    assert joined([only]) is only


def test_lists_without_paths_are_left_out():
    (first, _), (second, _) = made(3, 1), made(2, 10)
    nothing = compact(first, UInt())
    assert dr.width(merged([nothing, nothing]).lane) == 0
    assert np.array(merged([nothing, first, second]).lane).tolist() == [0, 1, 2, 0, 1]
    assert dr.width(nothing.on_branch(Branch.TRANSMITTED).lane) == 0
    branches = merged([first, second.on_branch(Branch.TRANSMITTED)]).branch
    assert np.array(branches).tolist() == [1, 1, 1, 2, 2]


def test_contributions_to_one_lane_are_summed():
    light = Contributions(4)
    assert rows(light.summed()).tolist() == [[0, 0, 0]] * 4
    light.add(Array3f([1, 2, 3], [10, 20, 30], 0), UInt([2, 0, 2]))
    light.add(Array3f(0.5), UInt([2]))
    light.add_once(Array3f(1), UInt([1]))
    assert rows(light.summed()).tolist() == [[2, 20, 0], [1, 1, 1], [4.5, 40.5, 0.5], [0, 0, 0]]
    light.add(Array3f(np.nan), UInt([0]))  # the estimate leaves such paths out
    assert np.isnan(rows(light.summed())).any(axis=1).tolist() == [True, False, False, False]
