import numpy as np
import pytest

from enfilade.methods.decoupled.edge_filter import DEVIATIONS, filter_edges

SKY = 40.0  # times white


@pytest.fixture
def bars():
    """Bars before a wall, whose edges have noise: the noisy frame, the true one, refined pixels, variance."""
    rng = np.random.default_rng(1)
    x = np.arange(96)
    row = np.where(x % 8 == 0, 0.02, 0.4).astype(np.float32)
    true = np.broadcast_to(row[None, :, None], (64, 96, 3)).copy()
    where = np.zeros((64, 96), bool)
    where[:, (x % 8 == 0) | (x % 8 == 1) | (x % 8 == 7)] = True
    deviation = np.where(where, 0.25 * true[..., 0], 0.0).astype(np.float32)
    noisy = true + (deviation * rng.normal(size=where.shape))[..., None].astype(np.float32)
    return np.maximum(noisy, 0.0).astype(np.float32), true, where, deviation**2


def test_noise_at_edges_falls_by_a_third_and_bars_stay(bars):
    noisy, true, where, variance = bars
    filtered = noisy + filter_edges(noisy, variance, exposure_ev=0.0)
    assert _rms((filtered - true)[where]) < 0.68 * _rms((noisy - true)[where])
    contrast = filtered[:, 8::8].mean() / filtered[:, 12::8].mean()
    assert contrast == pytest.approx(0.05, abs=0.03)


def test_other_pixels_stay_as_they_are(bars):
    noisy, _, where, variance = bars
    assert not filter_edges(noisy, variance, exposure_ev=0.0)[~where].any()


def test_the_mean_is_kept(bars):
    noisy, _, where, variance = bars
    filtered = noisy + filter_edges(noisy, variance, exposure_ev=0.0)
    assert filtered[where].mean() == pytest.approx(noisy[where].mean(), rel=0.01)


def test_no_pixel_changes_by_more_than_its_error(bars):
    noisy, _, _, variance = bars
    change = filter_edges(noisy, 0.01 * variance, exposure_ev=1.0)
    limit = DEVIATIONS * 0.1 * np.sqrt(variance)
    assert (np.abs(change @ np.float32([0.2126, 0.7152, 0.0722])) <= 1.001 * limit + 1e-6).all()
    assert not filter_edges(noisy, 0.0 * variance, exposure_ev=0.0).any()


def test_the_brightness_of_a_sky_behind_bars_stays(bars):
    noisy, _, _, variance = bars
    color = np.where(noisy > 0.2, np.float32(SKY), noisy)
    change = filter_edges(color, variance, exposure_ev=0.0)
    assert not change[color[..., 1] == SKY].any()


def _rms(values):
    return float(np.sqrt(np.mean(np.square(values))))
