"""Denoised irradiance: less noise, the same mean, and no surface tinted by one path."""

from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.decoupled import denoising
from enfilade.methods.decoupled.denoising import correct_light, denoise_light
from enfilade.methods.decoupled.edges import dilated
from enfilade.methods.denoise import denoise
from enfilade.records import Shading
from support.analytic_truth import geometry_of
from support.example_scenes import wall

SPP, OUTLIER = 8, 64.0
GEOMETRY = geometry_of(wall(), Camera(look_at((0, 0, 4), (0, 0, 0)), 45, 160, 120))
WHERE = np.ones(GEOMETRY.shape_index.shape, bool)


def noisy(chance, seed=0):
    """Means of paths, one of which in `chance` finds a light; the mean is 1."""
    hits = np.random.default_rng(seed).binomial(SPP, 1.0 / chance, WHERE.shape)
    light = (hits * (chance / SPP)).astype(np.float32)
    return Shading(light[..., None].repeat(3, axis=2), np.full(WHERE.shape, chance / SPP, np.float32))


def denoised(light, where=WHERE, **options):
    return denoise_light(GEOMETRY, light, where, **({"quality": "balanced", "outlier": OUTLIER} | options))


@pytest.mark.parametrize("chance", [2, 20, 100])
def test_the_mean_of_skewed_samples_is_kept(chance):
    light = noisy(chance)
    found = denoised(light)
    assert found.std() < 0.15 * light.color.std()
    assert found.mean() == pytest.approx(light.color.mean(), rel=0.01)


def test_a_difference_of_lobes_keeps_its_negative_light():
    sign = np.where(np.arange(160) < 80, 1.0, -0.5).astype(np.float32)
    light = noisy(2)
    found = denoised(Shading(light.color * sign[:, None], light.variance * np.square(sign)))
    assert found[:, :70].mean() == pytest.approx(1.0, rel=0.02)
    assert found[:, 90:].mean() == pytest.approx(-0.5, rel=0.02)
    assert found[:, 90:].std() < 0.1


@pytest.mark.parametrize(("least", "runs"), [(-0.5, 1), (-10.0, 2)])
def test_light_below_zero_is_accounted_for_by_the_denoiser_or_the_correction(monkeypatch, least, runs):
    denoiser = Mock(wraps=denoise)
    monkeypatch.setattr(denoising, "denoise", denoiser)
    light = noisy(2)
    light.variance[:] = 0.0  # as in the prepass: all that the denoiser leaves out is added again
    light.color[40:44, 60:64] = 0.0
    without = denoised(light)
    light.color[40:44, 60:64] = least
    denoiser.reset_mock()
    found = denoised(light)
    assert denoiser.call_count == runs
    assert (found - without).sum() == pytest.approx(light.color[40:44, 60:64].sum(), rel=0.2)


def test_light_below_zero_alone_is_kept_beside_a_highlight():
    light = noisy(2)
    light.color[:, 96:] = -0.5
    light.color[:10, :10] = 1e6
    assert denoised(light)[20:, 110:].mean() == pytest.approx(-0.5, rel=0.02)


def test_regions_far_apart_are_denoised_apart(monkeypatch):
    denoiser = Mock(wraps=denoise)
    monkeypatch.setattr(denoising, "denoise", denoiser)
    is_lit = np.zeros_like(WHERE)
    is_lit[40:60, 10:30] = is_lit[40:60, 130:150] = True
    light = noisy(2)
    found = denoised(Shading(light.color * is_lit[..., None], light.variance * is_lit), is_lit)
    assert denoiser.call_count == 2
    assert found[is_lit].mean() == pytest.approx(light.color[is_lit].mean(), rel=0.02)
    assert found[is_lit].std() < 0.25 * light.color[is_lit].std()


def test_regions_own_what_is_around_them():
    spot, corner = np.zeros((2, 200, 200), np.bool_)
    spot[10:20, 44:64] = corner[20:197, 190:197] = corner[190:197, 72:197] = True
    regions = denoising._regions(spot | corner)
    for (part, own), region, other in zip(regions, (spot, corner), (corner, spot), strict=True):
        assert own[dilated(region, denoising.MARGIN)[part]].all()
        assert not own[other[part]].any()


def test_regions_that_overlap_are_one():
    mask = np.zeros((200, 200), np.bool_)
    mask[:, :8] = mask[192:, :] = mask[:100, 192:] = mask[60:120, 80:120] = True
    ((part, own),) = denoising._regions(mask)
    assert mask[part].shape == own.shape == mask.shape
    assert own.all()


def test_one_outlier_does_not_tint_the_surface():
    light = noisy(2)
    light.color[60, 80] = 1e5
    light.variance[60, 80] = 1e10
    found, expected = (denoised(one) for one in (light, noisy(2)))
    around = np.abs(found - expected)[40:80, 60:100]
    assert around.max() < 0.5
    assert around.mean() < 0.1


def test_an_outlier_on_a_narrow_surface_leaves_no_dot():
    is_narrow = np.zeros_like(WHERE)
    is_narrow[59:61, 20:140] = True
    light = noisy(2)
    light.color[60, 80] = 1e4
    light.variance[60, 80] = 1e8
    # 1.2; 2548 where the denoiser gets it as it is.
    assert denoised(light, is_narrow, clamped=is_narrow)[is_narrow].max() < 2.0


def test_pixels_without_neighbours_are_not_clamped():
    light = noisy(2)
    is_thin = np.zeros_like(WHERE)
    is_thin[::4, ::4] = True
    light.color[~is_thin] = 0.0
    clamped, unclamped = (denoised(light, is_thin, clamped=where) for where in (is_thin, None))
    np.testing.assert_array_equal(clamped, unclamped)


def test_the_light_of_outliers_is_kept_without_a_blob():
    """One path in two thousand finds nearly half of the light: the mean stays, and the surface is even."""
    hits = np.random.default_rng(1).random(WHERE.shape) < 1.0 / 2000.0
    light = noisy(2)
    light.color[:] += 1500.0 * hits[..., None]
    light.variance[:] = 0.0  # as in the prepass: all that the denoiser loses is added again
    kept, limited, added = (
        denoised(light, outlier=outlier, is_excess_kept=is_kept)
        for outlier, is_kept in ((16.0, True), (16.0, False), (4096.0, False))
    )
    assert kept.mean() == pytest.approx(light.color.mean(), rel=0.01)
    assert limited.mean() < 0.8 * light.color.mean()
    blocks = [image[:, :, 0].reshape(6, 20, 8, 20).mean(axis=(1, 3)) for image in (kept, added)]
    assert blocks[0].std() < 0.5 * blocks[1].std()


@pytest.mark.parametrize(("rare", "tolerance"), [(0.2, 0.03), (5.0, 0.06)])
def test_rare_light_of_a_dark_surface_stays_there(rare, tolerance):
    """As in a dark room beside a bright one, where two paths a pixel mostly find nothing."""
    light = noisy(2)
    is_dark = np.arange(WHERE.shape[1]) >= 80
    shape_index = np.where(is_dark, GEOMETRY.shape_index + 1, GEOMETRY.shape_index).astype(np.uint32)
    hits = np.random.default_rng(5).random(WHERE.shape) < 0.01
    light.color[:] = np.where(is_dark[:, None], 0.05 + 100.0 * rare * hits[..., None], 10.0 * light.color)
    light.variance[:] = 0.0
    geometry = replace(GEOMETRY, shape_index=shape_index)
    found = denoise_light(geometry, light, WHERE, quality="balanced", outlier=16.0, is_excess_kept=True)
    for side in (is_dark, ~is_dark):
        assert found[:, side].mean() == pytest.approx(light.color[:, side].mean(), rel=tolerance)


def test_light_below_zero_stays_where_the_light_of_outliers_is_distributed():
    """As of paths behind cut-outs, from whose light an expectation is subtracted."""
    light = noisy(2)
    light.variance[:] = 0.0
    is_below = np.arange(WHERE.shape[1]) >= 80
    light.color[:] *= np.where(is_below, -0.5, 1.0).astype(np.float32)[:, None]
    limited, kept = (denoised(light, outlier=16.0, is_excess_kept=of) for of in (False, True))
    np.testing.assert_allclose(kept, limited, atol=2e-3)
    light.color[30, 20] = light.color[90, 60] = 300.0
    found = denoised(light, outlier=16.0, is_excess_kept=True)
    assert np.isfinite(found).all()
    assert found[:, 90:].mean() == pytest.approx(-0.5, rel=0.06)
    assert found[:, :70].mean() == pytest.approx(1.0, rel=0.06)


def test_a_highlight_does_not_brighten_the_dark_surface_around_it():
    light = noisy(2)
    share = np.full(WHERE.shape, 0.01, np.float32)
    share[50:70, 75:85] = 100.0
    light.color[:] *= share[..., None]
    light.variance[:] *= np.square(share)
    found = denoised(light)
    is_far = share < 1.0
    is_far[40:80, 65:95] = False
    assert found[is_far].mean() == pytest.approx(0.01, rel=0.1)
    assert found[50:70, 75:85].mean() == pytest.approx(light.color[50:70, 75:85].mean(), rel=0.03)


def test_pixels_without_irradiance_stay_black():
    where = WHERE.copy()
    where[:, :80] = False
    light = noisy(2)
    known = Shading(light.color * where[..., None], light.variance * where)
    found = denoised(known, where)
    assert found[where].mean() == pytest.approx(1.0, rel=0.03)
    assert not found[~where].any()


@pytest.mark.parametrize("chance", [2, 20])
def test_surfaces_are_not_darker_beside_pixels_without_light(chance):
    """As a ceiling beside the metal rim of a lamp."""
    row, column = np.indices(WHERE.shape)
    distance = np.hypot(row - 60, column - 80)
    where = (distance < 14) | (distance > 18)
    light = noisy(chance)
    light.color[~where] = 0.0
    light.variance[~where] = 0.0
    found = denoised(light, where)
    is_beside = (distance > 18) & (distance < 20)
    assert found[is_beside].mean() == pytest.approx(light.color[where].mean(), rel=0.08)
    assert not found[~where].any()


@pytest.mark.parametrize(("width", "noise"), [(6, 0.2), (40, 0.07)])
def test_light_is_even_up_to_pixels_without_light(width, noise):
    """The outermost pixels had 0.74 to 0.90 of their light, and all of them had twice the noise."""
    where = np.zeros_like(WHERE)
    where[40 : 40 + width] = True
    light = noisy(20)
    band = Shading(light.color * where[..., None], light.variance * where)
    rows = denoised(band, where)[where].reshape(width, -1) / light.color[where].mean()
    np.testing.assert_allclose(rows.mean(axis=1), 1.0, atol=0.05)
    assert rows.std() < noise


def test_averages_over_pixels_keep_less_light_at_a_boundary():
    """Pixels that are half covered keep half of the light; mirrored, a denoiser takes them for noise."""
    where, covered = np.zeros_like(WHERE), np.zeros(WHERE.shape, np.float32)
    where[40:80], covered[41:79], covered[[40, 79]] = True, 1.0, 0.5
    light = noisy(8)
    band = Shading(light.color * covered[..., None], light.variance * np.square(covered))
    found = denoised(band, where, quality="fast", is_mirrored=False)
    assert found[[40, 79]].mean() == pytest.approx(0.5, abs=0.2)  # 0.65; 0.98 if mirrored


@pytest.mark.parametrize("bias", [0.5, 1.2])
def test_another_estimate_lends_its_lack_of_noise_and_not_its_bias(bias):
    light = noisy(20)
    clean = np.full_like(light.color, bias)
    alone, found = denoised(light), correct_light(GEOMETRY, clean, light, WHERE)
    wide = correct_light(GEOMETRY, clean, light, WHERE, levels=denoising.CORRECTION_LEVELS + 1)
    assert wide.mean() == pytest.approx(light.color.mean(), rel=0.02)
    assert wide.std() < 0.8 * found.std()
    assert found.mean() == pytest.approx(light.color.mean(), rel=0.01)
    assert found.std() < 0.85 * alone.std()
