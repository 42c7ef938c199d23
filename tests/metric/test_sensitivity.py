"""Sensitivities looked up, and speeds at the size of each band."""

import numpy as np
import pytest

from enfilade.metric.cortex import bands
from enfilade.metric.csf import spatiovelocity_sensitivity
from enfilade.metric.sensitivity import ChannelSensitivity, SensitivityTable

PPD = 28.0
LADDER = bands(PPD)


@pytest.fixture(scope="module")
def table():
    return SensitivityTable(lambda rho, v, _: spatiovelocity_sensitivity(rho, v), LADDER, PPD)


def test_table_is_the_formula(table):
    speeds = np.geomspace(0.15, 500, 777).astype(np.float32)
    for band in LADDER:
        exact = spatiovelocity_sensitivity(band.centre_cpp * PPD, speeds.astype(np.float64))
        got = table.row(band)[table.index(speeds)]
        # Half a step is 0.12 % of the speed, to which the exponential adds where nothing is seen.
        is_seen = exact > 1
        np.testing.assert_allclose(got[is_seen], exact[is_seen], rtol=0.02)
        assert (got[~is_seen] < 1.05).all()


def test_any_speed_has_an_entry(table):
    extremes = np.float32([0.15, 1e5])
    assert table.index(extremes).tolist() == [0, len(table.row(LADDER[0])) - 1]


def test_still_images_have_one_number(table):
    sensitivity = ChannelSensitivity(table, [])
    assert sensitivity.map(LADDER[1], 3).shape == ()


def test_opposite_motions_do_not_cancel(table):
    # Stripes that move left and right by turns: the averaged speed is theirs, not zero.
    velocity = np.zeros((2, 32, 32), np.float32)
    velocity[0] = np.where(np.arange(32) % 2, 6.0, -6.0)
    coarse = LADDER[-2]
    assert coarse.reduction > 1
    got = ChannelSensitivity(table, [velocity]).map(coarse, 3)
    expected = spatiovelocity_sensitivity(coarse.centre_cpp * PPD, 6.0)
    np.testing.assert_allclose(got, expected, rtol=0.01)
