"""Monte Carlo noise is not seen as a difference, and defects still are."""

import numpy as np
import pytest
import scipy.ndimage

from enfilade.metric.amplitude import response
from enfilade.metric.cortex import CortexTransform
from enfilade.metric.noise import ChannelNoise, NoiseFilters, response_variance
from enfilade.viewing import Viewing

PPD = Viewing(640, 480).pixels_per_degree


def noisy(image, deviation, seed):
    rng = np.random.default_rng(seed)
    return (image + deviation * rng.standard_normal(image.shape)).clip(0).astype(np.float32)


def filtered(image, supports):
    """The filter of the frames (§5.2) along the last two axes: a Gaussian of sigma support / 6 per pixel."""
    image, shown = image.astype(np.float64), np.empty_like(image)
    for support in np.unique(supports):
        reach = int(support / 2)
        weights = np.exp(-0.5 * np.square(np.arange(-reach, reach + 1) / (support / 6)))
        blurred = image
        for axis in (-2, -1):
            blurred = scipy.ndimage.correlate1d(blurred, weights / weights.sum(), axis)
        shown[..., supports == support] = blurred[..., supports == support]
    return shown


def test_variance_through_the_nonlinearity():
    level, deviation = 30.0, 4.0
    draws = noisy(np.full((2, 100_000), level), deviation, 3)
    measured = np.var(np.diff(response(draws), axis=0))
    variance = np.full((1, 1), 2 * deviation**2, np.float32)
    assert response_variance(np.full((1, 1), level, np.float32), variance)[0, 0] == pytest.approx(
        measured, rel=0.05
    )


def test_black_pixels_keep_a_finite_slope():
    variance = response_variance(np.zeros((1, 2), np.float32), np.float32([[0.0, 1.0]]))
    assert variance[0, 0] == 0.0
    assert 0 < variance[0, 1] < response(np.float32([2.0]))[0] ** 2


def test_deviation_of_every_channel():
    # Variance that differs between left and right, measured over 40 draws away from the step.
    cortex = CortexTransform(128, 128, PPD)
    variance = np.where(np.arange(128) < 64, 1.0, 9.0) * np.ones((128, 1))
    noise = ChannelNoise(NoiseFilters(cortex), variance.astype(np.float32))
    rng = np.random.default_rng(4)
    draws = (rng.standard_normal((40, 128, 128)) * np.sqrt(variance)).astype(np.float32)
    spectra = cortex.spectra(draws)
    for band in cortex.bands[:-2]:
        ring = cortex.ring(spectra, band)
        for orientation in band.orientations:
            measured = cortex.fan(ring, band, orientation).std(axis=(0, 1))
            predicted = np.sqrt(np.square(noise.deviation(band, orientation)).mean(axis=0))
            middles = np.array([32, 96]) // band.reduction
            for middle in middles:
                near = slice(middle - 8 // band.reduction, middle + 8 // band.reduction)
                # 40 draws and some hundred independent samples: 10 %.
                assert measured[near].mean() == pytest.approx(predicted[near].mean(), rel=0.1)


@pytest.mark.parametrize("support", [3.0, 9.0])
def test_deviation_of_every_channel_after_a_gaussian(support):
    # Wide on the right, where less is left.
    cortex = CortexTransform(128, 128, PPD)
    supports = np.where(np.arange(128) < 64, 1.0, support) * np.ones((128, 1), np.float32)
    supports = supports.astype(np.float32)
    noise = ChannelNoise(NoiseFilters(cortex), np.ones((128, 128), np.float32), supports / np.float32(6.0))
    rng = np.random.default_rng(4)
    draws = rng.standard_normal((40, 128, 128)).astype(np.float32)
    spectra = cortex.spectra(filtered(draws, supports))
    for band in cortex.bands[:-2]:
        ring = cortex.ring(spectra, band)
        middles = np.array([32, 96]) // band.reduction
        near = [slice(middle - 8 // band.reduction, middle + 8 // band.reduction) for middle in middles]
        of = band.orientations
        measured = sum(np.square(cortex.fan(ring, band, o)).mean(axis=(0, 1)) for o in of)
        predicted = sum(np.square(noise.deviation(band, o)).mean(axis=0) for o in of)
        for span in near:
            # Where next to nothing is left, what the other half leaks into it counts: 1 % of the noise.
            told = pytest.approx(np.sqrt(predicted[span].mean()), rel=0.1, abs=0.008)
            assert np.sqrt(measured[span].mean()) == told


def test_a_filtered_difference_is_found_in_filtered_noise(paper):
    # Both images pass the filter of fast pixels: noise as it was before would explain the bars away.
    bars = np.where(np.arange(160) // 2 % 2, 30.0, 60.0) * np.ones((128, 1))
    blurred = bars.copy()
    blurred[40:90, 60:110] = 45.0
    support = np.full(bars.shape, 6.0, np.float32)
    test, reference = filtered(noisy(blurred, 10.0, 1), support), filtered(noisy(bars, 10.0, 2), support)
    before = {"noise_variance": np.full(bars.shape, 2 * 10.0**2, np.float32)}
    told = paper.compare(test, reference, **before, noise_blur_px=support / np.float32(6.0)).jnd
    assert (told[45:85, 65:105] > 1).mean() > 0.5
    assert (told[:, :40] > 1).mean() < 0.005
    assert (paper.compare(test, reference, **before).jnd[45:85, 65:105] > 1).mean() < 0.1


@pytest.mark.parametrize("relative", [0.05, 0.2, 0.5])
def test_two_noisy_versions_of_one_image_are_the_same(paper, textured, relative):
    deviation = relative * np.sqrt(textured * 40.0)
    test, reference = noisy(textured, deviation, 1), noisy(textured, deviation, 2)
    variance = (2 * deviation**2).astype(np.float32)
    with_map = paper.compare(test, reference, noise_variance=variance)
    without = paper.compare(test, reference)
    assert without.percent_visible > 50
    assert with_map.percent_visible < 0.5


def test_variance_may_differ_from_place_to_place(paper, textured):
    deviation = np.where(np.arange(160) < 80, 1.0, 12.0) * np.ones((128, 1))
    test, reference = noisy(textured, deviation, 1), noisy(textured, deviation, 2)
    variance = (2 * deviation**2).astype(np.float32)
    assert paper.compare(test, reference, noise_variance=variance).percent_visible < 0.5


def test_a_missing_object_is_found_in_noise(paper, textured):
    clean = textured.copy()
    clean[50:80, 40:70] = 70.0  # an object that the test image lacks
    deviation = 0.1 * np.sqrt(textured * 40.0)
    test, reference = noisy(textured, deviation, 1), noisy(clean, deviation, 2)
    variance = (2 * deviation**2).astype(np.float32)
    found = paper.compare(test, reference, noise_variance=variance).jnd
    assert (found[50:80, 40:70] > 1).mean() > 0.8
    assert (found[:, 110:] > 1).mean() < 0.005


def test_a_blurred_patch_is_found_in_noise(paper):
    bars = np.where(np.arange(160) // 3 % 2, 20.0, 70.0) * np.ones((128, 1))
    blurred = bars.copy()
    blurred[40:90, 60:110] = 45.0
    test, reference = noisy(blurred, 4.0, 1), noisy(bars, 4.0, 2)
    variance = np.full(bars.shape, 2 * 4.0**2, np.float32)
    found = paper.compare(test, reference, noise_variance=variance).jnd
    assert (found[45:85, 65:105] > 1).mean() > 0.5
    assert (found[:, :40] > 1).mean() < 0.005


def test_no_noise_no_change(paper, textured):
    test = textured.copy()
    test[40:60, 40:60] += 5
    plain = paper.compare(test, textured)
    silent = paper.compare(test, textured, noise_variance=np.zeros_like(textured))
    np.testing.assert_allclose(silent.jnd, plain.jnd, atol=1e-4)
