"""The change of an error along the motion, and the sensitivity to it."""

import numpy as np

from enfilade.metric.transient import error_change, flicker_sensitivity, moved, was_visible


def test_moved_is_exact_on_a_ramp():
    ramp = np.add.outer(2.0 * np.arange(9), 3.0 * np.arange(12)).astype(np.float32)
    flow = np.full((9, 12, 2), (0.25, -0.5), np.float32)
    found, is_inside = moved(ramp, flow)
    np.testing.assert_allclose(found[is_inside], (ramp + 0.75 - 1.0)[is_inside], rtol=1e-5)
    assert not is_inside[0].any()
    assert not is_inside[:, -1].any()
    assert is_inside[1:, :-1].all()


def test_change_follows_the_surface():
    here = np.zeros((6, 8), np.float32)
    here[3, 4] = 1.0
    flow = np.zeros((6, 8, 2), np.float32)
    flow[..., 0] = -1.0
    right = np.roll(here, 1, axis=1)
    assert not error_change(right, here, flow).any()
    assert error_change(here, right, flow).min() == -1.0
    assert np.count_nonzero(error_change(right, here, None)) == 2
    # A surface that was outside of the image, in part or whole, has no change.
    edge = np.zeros_like(here)
    edge[:, 0] = 1.0
    assert not error_change(edge, here, flow)[:, 0].any()
    assert not error_change(edge, here, np.float32(0.5) * flow)[:, 0].any()


def test_outlines_between_pixels_are_not_taken_for_disocclusions():
    # A square moves by 2.5 pixels before a background at rest: its outline was visible all around.
    is_before, is_now = np.zeros((2, 20, 30), bool)
    is_before[5:15, 5:15] = is_now[5:15, 8:18] = True
    forward, backward = np.zeros((2, 20, 30, 2), np.float32)
    forward[is_before, 0], backward[is_now, 0] = 2.5, -2.5
    found = was_visible(forward, backward)
    np.testing.assert_array_equal(found, ~(is_before & ~is_now))


def test_flicker_is_seen_best_at_low_spatial_frequency():
    light = np.array([10.0, 100.0])
    coarse, fine = (flicker_sensitivity(cpd, 30.0, light) for cpd in (1.0, 16.0))
    assert (coarse > 5 * fine).all()
    assert coarse[1] > coarse[0]
