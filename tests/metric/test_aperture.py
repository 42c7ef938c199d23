"""The aperture: what it integrates, from where, from any size of band."""

import numpy as np
import pytest

from enfilade.metric.aperture import APERTURE_SIGMA_DEG, Aperture, patch_gain

PPD = 28.0
SHAPE = (96, 128)


def integrated(energy, reduction, shape=SHAPE):
    aperture = Aperture(shape, PPD, APERTURE_SIGMA_DEG)
    return aperture.integrate(aperture.coarse(energy, reduction), reduction), aperture.reduction


@pytest.mark.parametrize("reduction", [1, 2, 4, 8, 16])
def test_a_point_becomes_the_gaussian(reduction):
    # Four pixels of equal energy, as coarse bands have them at one sample.
    energy = np.zeros(tuple(n // reduction + (reduction > 1) for n in SHAPE), np.float32)
    energy[48 // reduction, 64 // reduction] = 1.0
    found, step = integrated(energy, reduction)
    y, x = np.mgrid[: found.shape[0], : found.shape[1]] * step
    assert found.sum() * step**2 == pytest.approx(reduction**2, rel=0.01)
    # Square averages lose where in a square the point was: 3.5 pixels at most.
    for axis, centre in ((y, 48.0), (x, 64.0)):
        assert (found * axis).sum() / found.sum() == pytest.approx(centre, abs=3.6)
    variance = (found * (x - (found * x).sum() / found.sum()) ** 2).sum() / found.sum()
    own = 0.0 if reduction <= step else reduction**2 / 6.0  # of the interpolation between coarse samples
    assert np.sqrt(variance - own) == pytest.approx(APERTURE_SIGMA_DEG * PPD, rel=0.12)


def test_even_energy_stays_within_and_halves_at_the_border():
    found, _ = integrated(np.ones(SHAPE, np.float32), 1)
    np.testing.assert_allclose(found[5:8, 5:12], 1.0, rtol=1e-3)
    assert found[0, 8] == pytest.approx(0.5, abs=0.1)
    assert found.max() < 1.001


@pytest.mark.parametrize("shape", [(1, 1), (3, 50), (37, 5)])
def test_any_size(shape):
    found, step = integrated(np.ones(shape, np.float32), 1, shape)
    assert (step * (found.shape[0] - 1), step * (found.shape[1] - 1)) >= (shape[0] - 1, shape[1] - 1)
    assert (found <= 1.001).all()


def test_gain_makes_the_reference_patch_one():
    degrees = (np.arange(-200, 201) / 100.0)[:, None]
    radius2 = degrees**2 + degrees.T**2
    patch = np.cos(2 * np.pi * 6 * degrees) * np.exp(-radius2 / (2 * 0.5**2))
    aperture = np.exp(-radius2 / (2 * APERTURE_SIGMA_DEG**2))
    energy = (patch**2 * aperture).sum() / aperture.sum()
    assert patch_gain(APERTURE_SIGMA_DEG) ** 2 * energy == pytest.approx(1.0, rel=0.01)
