"""Sensitivity on the aperture's grid: errors keep the velocity of what they stand on."""

import numpy as np
import pytest

from enfilade.metric import Aqm, MetricOptions
from enfilade.viewing import Viewing

SHAPE = (128, 160)
BACKGROUND_DEG_S = 25.0


@pytest.fixture(scope="module")
def modern():
    return Aqm(Viewing(640, 480).cropped(SHAPE[1], SHAPE[0]), options=MetricOptions.modern())


def bars(*, still):
    """A caption three pixels high before a background in motion, and a fine error in it or around it."""
    velocity = np.zeros((*SHAPE, 2), np.float32)
    velocity[..., 0] = BACKGROUND_DEG_S
    caption = np.zeros(SHAPE, bool)
    caption[62:65, 40:120] = True
    if still:
        velocity[caption] = 0.0
    reference = np.full(SHAPE, 40.0, np.float32)
    test = reference.copy()
    test[caption] += 8.0 * (np.mgrid[: SHAPE[0], : SHAPE[1]][1][caption] % 4 < 2) - 4.0
    return test, reference, velocity


def test_what_stands_before_motion_is_seen_as_if_all_stood(modern):
    test, reference, velocity = bars(still=True)
    standing = modern.compare(test, reference).jnd.max()
    before_motion = modern.compare(test, reference, velocity=velocity).jnd.max()
    swept = modern.compare(test, reference, velocity=bars(still=False)[2]).jnd.max()
    # Channels see the error a little beyond the caption, where the background moves.
    assert before_motion > 0.4 * standing
    assert swept < 0.3 * standing
    assert before_motion > 2.0 * swept


def test_still_images_need_no_velocity(modern):
    test, reference, _ = bars(still=True)
    nothing = np.zeros((*SHAPE, 2), np.float32)
    found = modern.compare(test, reference, velocity=nothing).jnd
    np.testing.assert_allclose(found, modern.compare(test, reference).jnd, rtol=1e-4)


@pytest.mark.parametrize("ppd", [6.0, 28.0, 120.0])
def test_any_density(ppd):
    viewing = Viewing(640, 480, distance_m=0.5 * ppd / 27.93).cropped(SHAPE[1], SHAPE[0])
    modern = Aqm(viewing, options=MetricOptions.modern())
    test, reference, velocity = bars(still=True)
    found = modern.compare(test, reference, velocity=velocity).jnd
    assert np.isfinite(found).all()
    assert found.max() > 0
    assert not modern.compare(reference, reference, velocity=velocity).jnd.any()
