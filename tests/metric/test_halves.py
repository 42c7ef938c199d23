"""The published metric on halves of noisy images: structure counts, noise does not."""

import numpy as np
import pytest

from enfilade.metric import HalvesAqm, LuminanceHalves, Pursuit
from enfilade.metric.halves import GAIN_DB


@pytest.fixture(scope="module")
def aqm(viewing):
    return HalvesAqm(viewing)


def halves(image, deviation, seed):
    """Two noisy versions of an image."""
    rng = np.random.default_rng(seed)
    noisy = (image + deviation * rng.standard_normal((2, *image.shape))).clip(0).astype(np.float32)
    return LuminanceHalves(*noisy)


def compared(aqm, test, reference, pursuit=Pursuit.BOTH, **more):
    (found,) = aqm.compare_each(test, reference, pursuits=[pursuit], **more)
    return found


def darker_patch(image):
    changed = image.copy()
    changed[30:90, 40:110] *= 0.7
    return changed


def test_equal_halves_are_equal(aqm, textured):
    one = LuminanceHalves(textured, textured)
    found = compared(aqm, one, one)
    assert found.score == found.jnd.max() == 0.0


def test_noise_is_no_difference(aqm, textured):
    found = compared(aqm, halves(textured, 8.0, 1), halves(textured, 8.0, 2))
    assert found.percent_visible < 3.0
    in_one_half = LuminanceHalves(textured, darker_patch(textured))
    assert compared(aqm, in_one_half, LuminanceHalves(textured, textured)).percent_visible == 0.0


@pytest.mark.parametrize("deviation", [1.0, 4.0])
def test_a_difference_is_as_visible_with_noise_as_without(aqm, textured, deviation):
    changed = darker_patch(textured)
    clean = compared(aqm, LuminanceHalves(changed, changed), LuminanceHalves(textured, textured))
    noisy = compared(aqm, halves(changed, deviation, 1), halves(textured, deviation, 2))
    assert clean.percent_visible > 20.0
    assert noisy.percent_visible == pytest.approx(clean.percent_visible, abs=6.0)


def test_gain_of_a_grating(aqm, viewing):
    # A faint still grating at a band's centre: contrast times sensitivity, integrated to its RMS.
    density = viewing.pixels_per_degree
    frequency = 4.9 / density
    x = np.arange(160) * np.ones((128, 1))
    background = np.full((128, 160), 30.0, np.float32)
    contrast = 0.002
    grating = (30.0 * (1.0 + contrast * np.cos(2 * np.pi * frequency * x))).astype(np.float32)
    found = compared(aqm, LuminanceHalves(grating, grating), LuminanceHalves(background, background))
    sensitivity = 245.4 * 10.0 ** (GAIN_DB / 20.0)  # Eq. 4 at 4.9 cpd, 0.15 deg/s
    assert found.jnd[64, 80] == pytest.approx(contrast * sensitivity / np.sqrt(2.0), rel=0.1)


def test_a_pan_blurs_bars_across_it(aqm):
    bars = (40.0 + 10.0 * np.cos(np.pi / 2 * np.arange(160)) * np.ones((128, 1))).astype(np.float32)
    faint = (0.5 * (bars + 40.0)).astype(np.float32)
    velocity = np.zeros((128, 160, 2), np.float32)
    velocity[..., 0] = 20.0
    one, other = (LuminanceHalves(i, i) for i in (bars, faint))
    still, panned = (
        compared(aqm, other, one, velocity=v, pursuit=Pursuit.NONE).score for v in (None, velocity)
    )
    assert panned < 0.1 * still


def test_several_eye_movements_are_compared_at_once(aqm, textured):
    velocity = np.full((128, 160, 2), 3.0, np.float32)
    one, other = (LuminanceHalves(i, i) for i in (textured, darker_patch(textured)))
    found = aqm.compare_each(other, one, pursuits=list(Pursuit), velocity=velocity)
    for pursuit, each in zip(Pursuit, found, strict=True):
        alone = compared(aqm, other, one, velocity=velocity, pursuit=pursuit)
        assert alone.score == each.score > 0.0
        assert alone.jnd.tobytes() == each.jnd.tobytes()


def test_masked_pixels_do_not_count(aqm, textured):
    valid = np.ones(textured.shape, bool)
    valid[30:90, 40:110] = False
    one, other = (LuminanceHalves(i, i) for i in (textured, darker_patch(textured)))
    found = compared(aqm, other, one, valid=valid)
    assert found.jnd.max() == 0.0


def test_a_uniform_difference_stands_still_wherever_the_image_moves(aqm):
    background = np.full((128, 160), 40.0, np.float32)
    brighter = np.float32(1.02) * background
    velocity = np.zeros((128, 160, 2), np.float32)
    velocity[:, 100:, 0] = 20.0
    reference, test = (LuminanceHalves(image, image) for image in (background, brighter))
    still, moving = (
        compared(aqm, test, reference, velocity=v, pursuit=Pursuit.NONE).jnd for v in (None, velocity)
    )
    np.testing.assert_allclose(moving, still, rtol=0.05)
