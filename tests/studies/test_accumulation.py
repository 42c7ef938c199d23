"""Temporal accumulation of the denoised baselines: static surfaces average, others begin anew."""

import numpy as np
import pytest

from enfilade.gbuffer import positions
from studies.bench.accumulation import MAX_FRAMES, History, _fetched_sharply, accumulate
from support.closed_room import opened_room, room_path
from support.in_memory import walk_of

SIZE = (64, 48)


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    return walk_of(room_path(3, SIZE), opened_room(tmp_path_factory.mktemp("room")))


def noisy(walk, frame, sigma=0.1):
    """A smooth function of the points that are seen, with noise."""
    signal = 0.5 + 0.2 * np.sin(positions(walk.view(frame).geometry))
    noise = np.random.default_rng(frame).normal(0.0, sigma, signal.shape)
    return signal.astype(np.float32), (signal + noise).astype(np.float32)


def test_visible_surfaces_average_and_others_begin_anew(walk):
    _, first = noisy(walk, 0)
    signal, color = noisy(walk, 1)
    history = History(first, np.full(first.shape[:2], 3.0, np.float32))
    found = accumulate(color, walk.view(1), history, walk.view(0))
    is_new = found.count == 1.0
    assert 0.0 < is_new.mean() < 0.3
    np.testing.assert_array_equal(found.color[is_new], color[is_new])
    assert set(np.unique(found.count)) == {1.0, 4.0}
    # A quarter of the new noise, and three quarters of the old, which bilinear reads reduce further.
    error = [float(np.std((image - signal)[~is_new])) for image in (found.color, color)]
    assert error[0] < 0.8 * error[1]


def test_history_is_clipped_and_its_length_bounded(walk):
    signal, color = noisy(walk, 1, sigma=0.01)
    wrong = History(np.full_like(color, 50.0), np.full(color.shape[:2], 99.0, np.float32))
    found = accumulate(color, walk.view(1), wrong, walk.view(0))
    assert found.count.max() == MAX_FRAMES
    assert np.median(np.abs(found.color - signal)) < 0.1


def test_a_surface_that_came_closer_is_not_the_same(walk):
    _, color = noisy(walk, 1)
    other = walk_of(room_path(3, SIZE), walk.renderer).view(0)
    other.geometry.depth[:] *= 0.8
    history = History(color, np.ones(color.shape[:2], np.float32))
    found = accumulate(color, walk.view(1), history, other)
    assert (found.count[walk.view(1).geometry.is_hit] == 1.0).mean() > 0.9


def test_history_does_not_overshoot_beside_lights():
    image = np.full((12, 12, 3), 0.3, np.float32)
    image[4:8, 4:8] = 50.0
    y, x = np.mgrid[:12, :12].astype(np.float32)
    read = _fetched_sharply(image, x + np.float32(0.3), y)
    assert read.min() >= np.float32(0.3)
    assert read.max() <= 50.0
    assert 5.0 < read[5, 3, 0] < 25.0  # three tenths of the way into the light
