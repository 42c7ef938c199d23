"""Cortex transform: 31 channels, energies, directions, size of the ladder."""

from itertools import pairwise

import numpy as np
import pytest

from enfilade.metric.cortex import CortexTransform, bands
from enfilade.viewing import Viewing

PPD = Viewing(640, 480).pixels_per_degree


@pytest.fixture(scope="module")
def cortex():
    return CortexTransform(64, 96, PPD)


def every_channel(cortex, images):
    spectra = cortex.spectra(images)
    for band in cortex.bands:
        ring = cortex.ring(spectra, band)
        for orientation in band.orientations:
            yield band, orientation, cortex.fan(ring, band, orientation)


def test_bands_and_channels_at_28_pixels_per_degree():
    assert sum(len(band.orientations) for band in bands(PPD)) == 31
    # Geometric mean of the half-power frequencies, cpd; the base: power-weighted mean.
    centres = [band.centre_cpp * PPD for band in bands(PPD)]
    assert centres == pytest.approx([16.6, 9.9, 4.9, 2.5, 0.90, 0.22], rel=0.015)


@pytest.mark.parametrize(("ppd", "levels"), [(3, 3), (0.5, 2), (14, 5), (28, 6), (60, 7), (120, 8)])
def test_ladder_follows_pixels_per_degree(ppd, levels):
    ladder = bands(ppd)
    assert len(ladder) == levels
    assert all(fine.centre_cpp > coarse.centre_cpp for fine, coarse in pairwise(ladder))


def test_filters_keep_energy(cortex):
    rng = np.random.default_rng(6)
    image = rng.standard_normal((1, 64, 96)).astype(np.float32)
    energy = sum(
        float(np.square(channel, dtype=np.float64).sum()) * band.reduction**2
        for band, _, channel in every_channel(cortex, image)
    )
    # At the Nyquist frequency itself f and -f are one, and get the mean of their two filters.
    assert energy == pytest.approx(float(np.square(image, dtype=np.float64).sum()), rel=5e-3)


def test_a_constant_is_in_the_base_only(cortex):
    for band, _, channel in every_channel(cortex, np.full((1, 64, 96), 3.0, np.float32)):
        np.testing.assert_allclose(channel, 3.0 if band.is_base else 0.0, atol=2e-6)


def test_dip_between_four_channels():
    # Half way between two rings (1/8 cycle per pixel) and two fans (15 degrees).
    size = 256
    y, x = np.mgrid[:size, :size]
    fx, fy = 31 / size, 8 / size  # 0.1251 cycles per pixel, 14.5 degrees
    grating = np.cos(2 * np.pi * (fx * x + fy * y)).astype(np.float32)
    cortex = CortexTransform(size, size, PPD)
    peaks = [np.abs(channel).max() for _, _, channel in every_channel(cortex, grating[None])]
    pooled = np.sum(np.float64(peaks) ** 3.5) ** (1 / 3.5)
    assert 20 * np.log10(pooled) == pytest.approx(-2.6, abs=0.3)


def test_orientation_is_that_of_the_frequency_vector(cortex):
    upright = np.broadcast_to(np.cos(2 * np.pi * 12 * np.arange(96) / 96), (1, 64, 96)).astype(np.float32)
    loudest = max(every_channel(cortex, upright), key=lambda found: np.abs(found[2]).max())
    assert loudest[1] == 3  # theta = 0: the vector points along x
