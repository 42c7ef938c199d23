"""Sensitivities looked up, and speeds at the size of each band."""

import numpy as np
import pytest

from enfilade.metric import Pursuit
from enfilade.metric.castlecsf import castlecsf_sensitivity
from enfilade.metric.cortex import bands
from enfilade.metric.csf import spatiovelocity_sensitivity
from enfilade.metric.pyramid import Pyramid
from enfilade.metric.sensitivity import ChannelSensitivity, SensitivityTable

PPD = 28.0
LADDER = bands(PPD)
SHAPE = (64, 64)


@pytest.fixture(scope="module")
def table():
    return SensitivityTable(lambda rho, v, _: spatiovelocity_sensitivity(rho, v), LADDER, PPD)


def sensitivity(table, velocity):
    one = Pyramid(np.ones((), np.float32))
    return ChannelSensitivity(
        table, SHAPE, adapting=one, contrast=one, velocity=velocity, eyes=(Pursuit.NONE,)
    )


def test_table_is_the_formula(table):
    speeds = np.geomspace(0.15, 500, 777).astype(np.float32)
    for band in LADDER:
        exact = spatiovelocity_sensitivity(band.centre_cpp * PPD, speeds.astype(np.float64))
        got = table.row(band)[table.speed_index(speeds)]
        # Half a step is 0.12 % of the speed, to which the exponential adds where nothing is seen.
        is_seen = exact > 1
        np.testing.assert_allclose(got[is_seen], exact[is_seen], rtol=0.02)
        assert (got[~is_seen] < 1.05).all()
    assert table.speed_index(np.float32([0.15, 1e5])).tolist() == [0, len(table.row(LADDER[0])) - 1]


def test_table_by_luminance_is_the_formula():
    def csf(rho, speed, luminance):
        return castlecsf_sensitivity(rho, speed * rho, luminance, 1.0)

    table = SensitivityTable(csf, LADDER, PPD, by_luminance=True)
    speed, luminance = np.float32([0.15, 1.0, 7.0]), np.float32([0.01, 3.0, 900.0])
    got = table.row(LADDER[2])[table.speed_index(speed) + table.luminance_index(luminance)]
    exact = csf(LADDER[2].centre_cpp * PPD, speed.astype(float), luminance.astype(float))
    np.testing.assert_allclose(got, exact, rtol=0.05)


def test_still_images_have_one_weight_a_band(table):
    weights = list(sensitivity(table, None).weights(LADDER[1]))
    assert [weight.shape for weight in weights] == [()] * 6
    assert weights[0] == table.row(LADDER[1])[0]


def test_opposite_motions_do_not_cancel(table):
    # Stripes that move left and right by turns: the averaged speed is theirs, not zero.
    velocity = np.zeros((2, 33, 33), np.float32)
    velocity[0] = np.where(np.arange(33) % 2, 6.0, -6.0)
    coarse = LADDER[-2]
    assert coarse.reduction > 1
    upright = list(sensitivity(table, velocity).weights(coarse))[3]
    expected = spatiovelocity_sensitivity(coarse.centre_cpp * PPD, 6.0)
    np.testing.assert_allclose(upright, expected, rtol=0.01)
