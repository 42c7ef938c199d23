"""Adaptive sampling by the uncertainty of displayed values."""

import numpy as np
import pytest
import scipy.ndimage

from enfilade.arrays import lanes
from enfilade.kernels.tone import srgb_encode
from enfilade.methods.decoupled.adaptive_sampling import (
    AdaptiveSampling,
    displayed_deviation,
    displayed_tolerance,
    variance_around,
)
from enfilade.methods.decoupled.edges import beside, dilated
from enfilade.records import Shading

H, W = 20, 30


class Means:
    """An estimate of a mask of pixels, by their mean luminance and its variance, (H, W)."""

    evaluated = 0  # pixels

    def __init__(self, sampled, mean, variance):
        self._of = [np.asarray(of, np.float32)[sampled] for of in (mean, variance)]

    def luminance(self, where=None):
        where = np.ones(self._of[0].shape, bool) if where is None else where
        Means.evaluated += where.sum()
        return tuple(lanes(of[where]) for of in self._of)


class Noisy:
    """An estimate of a mask of pixels, some of which have noise; it counts its rays, (H, W)."""

    def __init__(self, sampled, counts, noisy):
        self._sampled, self._counts, self._noisy = sampled, counts, noisy

    def add(self, spp, where):
        self._counts[self._sampled] += spp * where

    def luminance(self, where):
        variance = np.where(self._noisy, 2.0 / np.maximum(self._counts, 1), 0.0)
        return Means(self._sampled, np.full((H, W), 1.0), variance).luminance(where)


def deviations(low, high, exposure_ev=0.0):
    low, high = (lanes(np.asarray(of, np.float32)) for of in (low, high))
    return np.array(displayed_deviation(low, high, exposure_ev))


def test_deviations_are_those_of_srgb():
    low, high = np.random.default_rng(8).uniform(-0.1, 1.5, (2, 4096)).astype(np.float32)
    expected = 0.5 * np.subtract(*(srgb_encode(np.clip(2.0 * of, 0.0, 1.0)) for of in (high, low)))
    np.testing.assert_allclose(deviations(low, high, 1.0), expected, atol=1e-6)


def test_the_unseen_share_follows_the_rays_of_each_pixel():
    # Bright pixels beside two dark ones, of which the right one has fewer rays.
    mean = np.array([[0.0, 0.2, 0.0]])
    everywhere, counts = np.ones((1, 3), bool), np.array([[31, 31, 7]], np.uint32)
    estimate = Means(everywhere, mean, np.zeros((1, 3)))
    few, many = (deviations([0.0], [0.2 / (n + 1.0)])[0] for n in (7, 31))
    assert few > many
    for tolerance, expected in (
        (0.9 * many, (True, True)),
        (0.9 * few, (False, True)),
        (1.1 * few, (False, False)),
    ):
        found = AdaptiveSampling(128, tolerance, 0.0).uncertain(estimate, everywhere, counts=counts)
        assert (found[0, 0], found[0, 2]) == expected


@pytest.mark.parametrize("exposure_ev", [0.0, -1.5])
def test_uncertain_pixels_agree_with_a_numpy_twin(exposure_ev):
    rng = np.random.default_rng(4)
    sampled = rng.uniform(size=(H, W)) < 0.7
    mean, variance, beneath = (rng.uniform(0.0, high, (H, W)).astype(np.float32) for high in (0.5, 1e-3, 0.4))
    counts = rng.integers(4, 64, (H, W)).astype(np.uint32)
    shown = np.where(sampled, mean, np.float32(0))
    unseen = (scipy.ndimage.maximum_filter(shown, 3) - mean) / (1.0 + counts)
    deviation = np.maximum(np.sqrt(variance), unseen)
    low, high = (
        srgb_encode(np.clip((mean + s * deviation + beneath) * 2.0**exposure_ev, 0.0, 1.0)) for s in (-1, 1)
    )
    expected = 0.5 * (high - low)
    tolerance = float(np.median(expected))
    rays = AdaptiveSampling(128, tolerance, exposure_ev, beneath)
    found = rays.uncertain(Means(sampled, mean, variance), sampled, counts=counts)
    some = sampled & (rng.uniform(size=(H, W)) < 0.3)
    among = rays.uncertain(Means(sampled, mean, variance), sampled, some, counts)
    np.testing.assert_array_equal(among, found & some)
    is_decided = abs(expected - tolerance) > 1e-5
    assert is_decided.mean() > 0.99
    np.testing.assert_array_equal(found[is_decided], (sampled & (expected > tolerance))[is_decided])


def test_means_below_zero_are_as_uncertain_as_those_above():
    """Black pixels of lobes that are a difference got no more rays."""
    mean, variance = np.array([[-0.7, 0.7, -0.7, -0.1]]), np.array([[0.04, 0.04, 0.0, 0.04]])
    everywhere, beneath = np.ones((1, 4), bool), np.array([[0.0, 0.0, 0.0, 0.3]], np.float32)
    found = AdaptiveSampling(128, 0.02, 0.0, beneath).uncertain(Means(everywhere, mean, variance), everywhere)
    assert found.tolist() == [[True, True, False, True]]


def test_without_pixels_none_is_uncertain():
    nowhere = np.zeros((H, W), bool)
    assert not AdaptiveSampling(128, 0.0, 0.0).uncertain(None, nowhere).any()


def test_what_is_clipped_at_white_is_not_uncertain():
    grey = np.array([0.2, 0.2, 50.0, 1.1, 1.1])
    deviation = np.array([0.0, 0.02, 5.0, 0.05, 0.5])
    found = deviations(grey - deviation, grey + deviation)
    assert found[[0, 2, 3]].tolist() == [0.0, 0.0, 0.0]
    # sRGB of 0.22 and of 0.18; of 0.6 and of white
    np.testing.assert_allclose(found[[1, 4]], [(0.5064 - 0.4614) / 2.0, (1.0 - 0.7977) / 2.0], atol=1e-3)
    assert deviations(grey - deviation, grey + deviation, -1.0)[3] > 0.01


@pytest.mark.parametrize(
    ("sky", "spp", "is_uncertain"), [(100.0, 16, True), (100.0, 8000, False), (0.3, 16, False)]
)
def test_a_bright_surface_beside_a_pixel_may_have_been_missed(sky, spp, is_uncertain):
    mean, everywhere = np.full((H, W), 0.2), np.ones((H, W), bool)
    mean[:, :10] = sky
    estimate = Means(everywhere, mean, np.zeros((H, W)))
    counts = np.full((H, W), spp, np.uint32)
    found = AdaptiveSampling(128, 0.02, 0.0).uncertain(estimate, everywhere, counts=counts)
    assert found[:, 10].all() == is_uncertain
    assert not found[:, 11:].any()  # no bright surface beside them
    assert not found[:, :10].any()


def test_the_tolerance_follows_the_quality():
    tolerances = [displayed_tolerance(quality) for quality in (1.0, 4.0, 16.0, 64.0)]
    np.testing.assert_allclose(tolerances, [0.0033, 0.0066, 0.0132, 0.0264])


@pytest.mark.parametrize(
    ("mean", "variance", "is_faint"),
    [(0.02, 0.0, True), (0.3, 0.0, False), (0.02, 0.01, True), (0.02, 0.02, False)],
)
def test_faint_pixels_change_what_is_displayed_by_little(mean, variance, is_faint):
    # The variance is that of a mean of two rays.
    everywhere = np.ones((H, W), bool)
    estimate = Means(everywhere, np.full((H, W), mean), np.full((H, W), variance))
    sampling = AdaptiveSampling(128, 0.05, 0.0, beneath=np.full((H, W), 0.3, np.float32))
    rms = np.sqrt(mean**2 + variance)
    assert (deviations([0.3], [0.3 + rms])[0] < 0.05) == is_faint
    assert (sampling.is_faint(estimate, everywhere, 2) == is_faint).all()


def test_whether_a_pixel_is_faint_follows_from_those_around_it():
    """A pixel that has found a rare bright path would be averaged with more rays than others."""
    everywhere, mean = np.ones((H, W), bool), np.zeros((H, W))
    mean[10, 12] = 20.0
    found = AdaptiveSampling(128, 0.05, 0.0).is_faint(
        Means(everywhere, mean, np.zeros((H, W))), everywhere, 1
    )
    around = dilated(mean > 0.0, 3) & (mean == 0.0)
    np.testing.assert_array_equal(found, ~around)


def test_pixels_with_few_others_around_are_not_faint():
    sampled = np.zeros((H, W), bool)
    sampled[2, :20] = sampled[10:13, 12:15] = True  # a line, of which six other pixels are near; a square
    black = Means(sampled, np.zeros((H, W)), np.zeros((H, W)))
    found = AdaptiveSampling(128, 0.05, 0.0).is_faint(black, sampled, 1)
    assert not found[2].any()
    assert found[10:13, 12:15].all()


def means_of(rays, counts):
    """Means of the first rays of each pixel, (H, W), and their variances, as of an estimate."""
    used = np.arange(rays.shape[2]) < counts[..., None]
    mean = (rays * used).sum(axis=2) / counts
    variance = (np.square(rays - mean[..., None]) * used).sum(axis=2) / counts / np.maximum(counts - 1, 1)
    return Shading(mean[..., None].repeat(3, axis=2).astype(np.float32), variance.astype(np.float32))


@pytest.mark.parametrize("level", [1.0, -1.0])
def test_the_variance_around_a_pixel_is_that_of_single_rays(level):
    rays = np.random.default_rng(3).normal(level, 0.1, (64, 64, 4))
    counts, sampled = np.where(np.arange(64) < 20, 1, 4) * np.ones((64, 1), int), np.ones((64, 64), bool)
    sampled[:, 40:] = False
    light = means_of(rays, counts)
    light.color[~sampled] = light.variance[~sampled] = 0.0
    found = variance_around(light, sampled, counts)
    assert found[:, 23:37].mean() == pytest.approx(0.01, rel=0.05)
    assert found[:, 17:23].mean() == pytest.approx(0.01, rel=0.1)
    assert found[:, :40].mean() == pytest.approx(0.01, rel=0.05)


def test_an_outlier_of_a_single_ray_is_not_certain():
    light = means_of(np.zeros((H, W, 1)), np.ones((H, W), int))
    light.color[10, 12] = 20.0
    found = variance_around(light, np.ones((H, W), bool), np.ones((H, W), int))
    assert found[10, 12] == pytest.approx(20.0**2 / 49.0, rel=0.05)


def test_rays_double_where_the_value_is_uncertain_and_beside_it():
    sampled = np.ones((H, W), bool)
    sampled[:, 0] = False  # pixels of the estimate are those of a mask
    traced = np.zeros((H, W), int)
    noisy = np.zeros((H, W), bool)
    noisy[7, 8] = True

    estimate = Noisy(sampled, traced, noisy)
    edges = noisy | (np.arange(W) == 20)
    Means.evaluated = 0
    refined = AdaptiveSampling(most=100, tolerance=0.02, exposure_ev=0.0).refine(
        estimate, sampled, edges, sampled, 4
    )
    expected = np.where(dilated(noisy), 100 - 16, 0) + np.where(edges, 12, 0)
    np.testing.assert_array_equal(traced, expected)
    np.testing.assert_array_equal(refined, expected > 0)
    # Edges and what is beside them, which is compared with them; then the noisy pixel with its neighbours.
    assert Means.evaluated == dilated(edges).sum() + 3 * dilated(noisy, 2).sum()


def test_edges_are_not_refined_beyond_the_largest_number_of_rays():
    everywhere = np.ones((H, W), bool)
    rays = AdaptiveSampling(most=4, tolerance=0.0, exposure_ev=0.0)
    assert not rays.refine(None, everywhere, everywhere, everywhere, 4).any()


@pytest.mark.parametrize(("most", "reach"), [(2, 1), (16, 1), (17, 2), (64, 3), (128, 4)])
def test_refinement_reads_no_pixel_beyond_its_reach(most, reach):
    # Everything is uncertain, so that rays spread as far as they can; brighter pixels lie beyond.
    sampling = AdaptiveSampling(most, tolerance=1e-4, exposure_ev=0.0)
    assert sampling.reach == reach
    edges = np.zeros((H, W), bool)
    edges[H // 2, W // 2] = True
    read = []

    class Recorded(Noisy):
        def luminance(self, where):
            read.append(np.argwhere(everywhere)[where])
            return super().luminance(where)

    everywhere = np.ones((H, W), bool)
    estimate = Recorded(everywhere, np.zeros((H, W), int), everywhere)
    refined = sampling.refine(estimate, everywhere, edges, everywhere, 0)
    distances = np.abs(np.concatenate(read) - (H // 2, W // 2)).max(axis=1)
    assert distances.max() == reach
    np.testing.assert_array_equal(refined, dilated(edges, reach - 1))


def test_edges_matter_where_the_display_shows_them():
    color = np.zeros((H, W, 3), np.float32)
    color[:, 15:] = 0.05
    dark, bright, white = (
        AdaptiveSampling(128, 0.02, 0.0, beneath=np.full((H, W), value, np.float32)).has_visible_contrast(
            color
        )
        for value in (0.0, 0.6, 2.0)
    )
    expected = np.zeros((H, W), bool)
    expected[:, 14:16] = True
    np.testing.assert_array_equal(dark, expected)
    assert not bright.any()  # sRGB of 0.60 and 0.65: a difference of 0.03
    assert not white.any()


def test_a_view_that_compresses_highlights_shows_their_contrast():
    # Reinhard et al. 2002, Eq. 4: L (1 + L / 16^2) / (1 + L).
    low, high = np.array([0.2, 4.0, 16.0]), np.array([0.25, 8.0, 32.0])
    shown = [v * (1.0 + v / 256.0) / (1.0 + v) for v in (low, high)]
    expected = 0.5 * np.subtract(*(srgb_encode(np.minimum(of, 1.0).astype(np.float32)) for of in shown[::-1]))
    exposed = [lanes((v / 2.0).astype(np.float32)) for v in (low, high)]
    found = np.array(displayed_deviation(*exposed, exposure_ev=1.0, white=16.0))
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert found[1] > 0.02
    assert found[2] == 0.0
    assert not np.array(displayed_deviation(*exposed, exposure_ev=1.0))[1:].any()


def test_what_is_displayed_beneath_an_estimate_lowers_its_visible_deviation():
    everywhere = np.ones((H, W), bool)
    estimate = Means(everywhere, np.full((H, W), 0.02), np.full((H, W), 1e-4))
    # sRGB of 0.01 and 0.03; of 0.51 and 0.53
    alone, above = (0.1901 - 0.0998) / 2.0, (0.7536 - 0.7411) / 2.0
    np.testing.assert_allclose(deviations([0.01, 0.51], [0.03, 0.53]), [alone, above], atol=1e-3)
    for beneath, deviation in ((0.0, alone), (np.full((H, W), 0.5, np.float32), above)):
        for tolerance, expected in ((0.8 * deviation, True), (1.2 * deviation, False)):
            found = AdaptiveSampling(128, tolerance, 0.0, beneath).uncertain(estimate, everywhere)
            assert (found == expected).all()


class Spikes:
    """An estimate of pixels whose rays find a bright path with a small probability."""

    CHANCE, BRIGHT = 0.01, 0.5

    def __init__(self, shape, spp):
        self._random = np.random.default_rng(5)
        self.counts, self._found = np.zeros(shape), np.zeros(shape)
        self.add(spp, np.ones(shape, bool).ravel())

    def add(self, spp, where):
        where = where.reshape(self.counts.shape)
        self._found += where * self._random.binomial(spp, self.CHANCE, where.shape)
        self.counts += where * spp

    @property
    def mean(self):
        return self.BRIGHT * self._found / self.counts

    def luminance(self, where):
        share = self._found / self.counts
        variance = self.BRIGHT**2 * share * (1.0 - share) / (self.counts - 1.0)
        return Means(np.ones(share.shape, bool), self.mean, variance).luminance(where)


@pytest.mark.parametrize(("beneath", "lost", "lost_otherwise"), [(0.5, 0.03, 0.25), (0.0, 0.3, 0.45)])
def test_noise_is_reduced_with_little_loss_of_rare_light(beneath, lost, lost_otherwise):
    everywhere = np.ones((200, 300), bool)
    sampling = AdaptiveSampling(most=64, tolerance=0.05, exposure_ev=0.0, beneath=beneath)
    estimate = Spikes(everywhere.shape, 4)
    deviation = estimate.mean.std()
    sampling.reduce_noise(estimate, everywhere, everywhere, 4)
    assert estimate.mean.std() < 0.95 * deviation
    expected = Spikes.CHANCE * Spikes.BRIGHT
    assert abs(estimate.mean.mean() / expected - 1.0) < lost
    # Were uncertain pixels themselves refined, more of this light would be lost.
    biased = Spikes(everywhere.shape, 4)
    sampling.refine(biased, everywhere, dilated(sampling.uncertain(biased, everywhere)), everywhere, 4)
    assert biased.mean.mean() / expected - 1.0 < -lost_otherwise


def test_noise_is_reduced_beside_uncertain_pixels_where_it_may():
    sampled = np.ones((H, W), bool)
    sampled[:, 9] = False
    within = sampled.copy()
    within[6] = False
    counts = np.where(sampled, 4, 0)
    noisy = np.zeros((H, W), bool)
    noisy[7, 8] = True

    sampling = AdaptiveSampling(most=100, tolerance=0.02, exposure_ev=0.0)
    sampling.reduce_noise(Noisy(sampled, counts, noisy), sampled, within, 4)
    expected = beside(noisy) & within
    assert expected.sum() == 3
    np.testing.assert_array_equal(counts, np.where(expected, 8, np.where(sampled, 4, 0)))
