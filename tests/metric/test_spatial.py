"""The aperture: what it gathers, from where, from any size of band."""

import numpy as np
import pytest

from enfilade.metric import Fitted
from enfilade.metric.spatial import Aperture, patch_gain

PPD = 28.0
APERTURE_SIGMA_DEG = Fitted().aperture_sigma_deg
SHAPE = (96, 128)


def gathered(energy, reduction):
    aperture = Aperture(SHAPE, PPD, APERTURE_SIGMA_DEG)
    (on_grid,) = aperture.gather(aperture.coarse(energy, reduction)[None], reduction)
    return aperture.full(on_grid)


@pytest.mark.parametrize("reduction", [1, 2, 4, 8])
def test_a_point_becomes_the_gaussian(reduction):
    # Four pixels of equal energy, as coarse bands have them at one sample.
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    energy = np.zeros(tuple(n // reduction + (reduction > 1) for n in SHAPE), np.float32)
    energy[48 // reduction, 64 // reduction] = 1.0
    found = gathered(energy, reduction)
    assert found.sum() == pytest.approx(reduction**2, rel=0.01)
    # Square averages lose where in a square the point was: 3.5 pixels at most.
    middle = (48.0, 64.0)
    for axis, centre in zip((y, x), middle, strict=True):
        assert (found * axis).sum() / found.sum() == pytest.approx(centre, abs=3.6)
    variance = (found * (x - (found * x).sum() / found.sum()) ** 2).sum() / found.sum()
    assert np.sqrt(variance) == pytest.approx(APERTURE_SIGMA_DEG * PPD, rel=0.12)


def test_even_energy_stays_within_and_halves_at_the_border():
    found = gathered(np.ones(SHAPE, np.float32), 1)
    np.testing.assert_allclose(found[40:60, 40:90], 1.0, rtol=1e-3)
    assert found[0, 64] == pytest.approx(0.5, abs=0.1)
    assert found.max() < 1.001


def test_gain_makes_the_reference_patch_one():
    degrees = (np.arange(-200, 201) / 100.0)[:, None]
    radius2 = degrees**2 + degrees.T**2
    patch = np.cos(2 * np.pi * 6 * degrees) * np.exp(-radius2 / (2 * 0.5**2))
    aperture = np.exp(-radius2 / (2 * APERTURE_SIGMA_DEG**2))
    energy = (patch**2 * aperture).sum() / aperture.sum()
    assert patch_gain(APERTURE_SIGMA_DEG) ** 2 * energy == pytest.approx(1.0, rel=0.01)


@pytest.mark.parametrize("shape", [(1, 1), (3, 50), (37, 5)])
def test_any_size(shape):
    aperture = Aperture(shape, PPD, APERTURE_SIGMA_DEG)
    on_grid = aperture.gather(aperture.coarse(np.ones(shape, np.float32), 1)[None], 1)
    assert aperture.full(on_grid[0]).shape == shape
    assert (on_grid <= 1.001).all()
