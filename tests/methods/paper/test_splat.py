"""The z-buffer of splats against its twin."""

import math

import numpy as np
import pytest

from enfilade.arrays import Array2f, Bool, Float
from enfilade.methods.paper.splat import EMPTY, INFINITE, Splats, splat_nearest
from twins.splat import nearest

W, H = 24, 17


def random_splats(count, seed, spread=1.5):
    random = np.random.default_rng(seed)
    table = np.zeros(count, dtype="f4,f4,f4,2f4,2f4,2f4,?")
    table["f0"] = random.uniform(-3, W + 3, count)
    table["f1"] = random.uniform(-3, H + 3, count)
    table["f2"] = random.uniform(0.05, 2.0, count)
    table["f3"] = random.normal((1, 0), spread, (count, 2))
    table["f4"] = random.normal((0, 1), spread, (count, 2))
    table["f5"] = random.normal(0, 0.03, (count, 2))
    table["f6"] = random.random(count) < 0.9
    return table


def as_lanes(table):
    def vector(name):
        return Array2f(*(Float(np.ascontiguousarray(c)) for c in table[name].T))

    x, y, inverse_depth = (Float(np.ascontiguousarray(table[name])) for name in ("f0", "f1", "f2"))
    is_splat = Bool(np.ascontiguousarray(table["f6"]))
    return Splats(x, y, inverse_depth, vector("f3"), vector("f4"), vector("f5"), is_splat)


def winners(keys):
    """Lanes of the nearest splats as (H, W), -1 where there is none."""
    found = np.array(keys).reshape(H, W)
    return np.where(found == EMPTY, -1, (found & 0xFFFFFFFF).astype(np.int64))


def one(x=10.5, y=8.5, near=0.5, by_x=(1, 0), by_y=(0, 1), slope=(0, 0)):
    table = random_splats(1, 0)
    table[0] = (x, y, near, by_x, by_y, slope, True)
    return table


@pytest.mark.parametrize(("count", "seed", "spread"), [(60, 1, 1.5), (300, 2, 0.7), (25, 3, 5.0), (1, 4, 1)])
@pytest.mark.parametrize("reach", [3.0, 12.0])
def test_splatting_matches_its_twin(count, seed, spread, reach):
    table = random_splats(count, seed, spread)
    got = winners(splat_nearest(as_lanes(table), width=W, height=H, reach=reach))
    np.testing.assert_array_equal(got, nearest([tuple(s) for s in table], W, H, reach))


def test_the_order_of_the_splats_does_not_matter():
    table = random_splats(200, 5)
    order = np.random.default_rng(6).permutation(200)
    straight = winners(splat_nearest(as_lanes(table), width=W, height=H, reach=9.0))
    shuffled = winners(splat_nearest(as_lanes(table[order]), width=W, height=H, reach=9.0))
    np.testing.assert_array_equal(np.where(shuffled < 0, -1, order[shuffled]), straight)


def test_keys_contain_the_depth_at_the_pixel_centre():
    # 1 / depth is 0.5 at (10.5, 8.5) and rises by 0.1 a source pixel, which is 4 target pixels wide.
    keys = splat_nearest(
        as_lanes(one(by_x=(4, 0), by_y=(0, 4), slope=(0.1, 0.0))), width=W, height=H, reach=9.0
    )
    row = np.array(keys).reshape(H, W)[8]
    columns = np.flatnonzero(row != EMPTY)
    assert columns.tolist() == [8, 9, 10, 11, 12]  # centres within 0.55 x 4 px of 10.5
    depth = (row[columns] >> 32).astype(np.uint32).view(np.float32)
    np.testing.assert_allclose(depth, 1.0 / (0.5 + 0.1 * (columns - 10) / 4), rtol=1e-6)


def test_of_equal_depths_the_lower_lane_wins():
    table = np.concatenate([one(), one()])
    keys = splat_nearest(as_lanes(table), width=W, height=H, reach=9.0)
    assert winners(keys)[8, 10] == 0


def test_surfaces_at_infinity_lie_behind_all_others():
    table = np.concatenate([one(near=0.0), one(near=1e-6)])
    keys = splat_nearest(as_lanes(table), width=W, height=H, reach=9.0)
    assert winners(keys)[8, 10] == 1
    alone = np.array(splat_nearest(as_lanes(one(near=0.0)), width=W, height=H, reach=9.0)).reshape(H, W)
    assert (alone[8, 10] >> 32).astype(np.uint32).view(np.float32) == np.float32(INFINITE)


@pytest.mark.parametrize(
    "change",
    [
        {"by_x": (-1, 0)},  # seen from behind
        {"by_x": (1e-9, 0)},  # from the edge
        {"by_x": (40, 0)},  # larger than the reach
        {"x": -5.0},
        {"x": 1e30},
        {"y": -1e30},
        {"y": H + 0.6},
        {"by_x": (math.inf, 0)},
    ],
)
def test_splats_that_face_away_are_too_large_or_outside_cover_nothing(change):
    keys = splat_nearest(as_lanes(one(**change)), width=W, height=H, reach=9.0)
    assert (winners(keys) == -1).all()


def test_splats_of_a_plane_leave_no_cracks():
    # Parallelograms of a linear map, at every magnification that stays within the reach.
    for angle in np.linspace(0, 1.5, 7):
        for scale in (0.4, 0.7, 1.0, 1.3, 2.0, 3.9):
            map_ = (
                scale
                * np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
                @ np.array([[1.0, 0.4], [0.0, 0.8]])
            )
            size = 101
            y, x = np.mgrid[:size, :size].reshape(2, -1) - size / 2
            at = map_ @ (x, y) + np.array([[W / 2], [H / 2]])
            splats = Splats(
                Float(at[0]),
                Float(at[1]),
                Float(0.5),
                Array2f(*map_[:, 0].tolist()),
                Array2f(*map_[:, 1].tolist()),
                Array2f(0),
                Bool(True),
            )
            keys = splat_nearest(splats, width=W, height=H, reach=9.0)
            assert (winners(keys) >= 0).all(), (angle, scale)
