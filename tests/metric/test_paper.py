"""The published metric: its twin, motion, outliers, measured thresholds."""

import math

import numpy as np
import pytest

from enfilade.metric import Aqm, Pursuit
from enfilade.metric.channels import ChannelBank
from enfilade.metric.pooling import POOLING_EXPONENT
from enfilade.viewing import Viewing
from twins import metric as twin


def moving(shape, across, down):
    velocity = np.empty((*shape, 2), np.float32)
    velocity[...] = across, down
    return velocity


@pytest.mark.parametrize("motion", ["still", "sheared"])
def test_twin(motion):
    shape = (38, 45)
    viewing = Viewing(640, 480).cropped(shape[1], shape[0])
    rng = np.random.default_rng(3)
    reference = (30 + 10 * rng.random(shape) + 10 * (np.arange(45) // 6 % 2)).astype(np.float32)
    test = reference.copy()
    test[10:20, 15:30] *= 0.8
    velocity = None
    if motion == "sheared":
        velocity = moving(shape, 2.0, -1.0)
        velocity[..., 0] += 0.1 * np.arange(45)
    bank = ChannelBank(viewing)
    expected = twin.jnd_map(
        test,
        reference,
        centres_cpd=[band.centre_cpp * viewing.pixels_per_degree for band in bank.bands],
        margin=32,
        padded_shape=bank.pad(test).shape,
        velocity=velocity,
    )
    compared = Aqm.paper(viewing).compare(test, reference, velocity=velocity)
    relative = np.abs(compared.jnd - expected) / np.maximum(expected, 0.3)
    # Coarse bands are interpolated, and speeds averaged over their samples.
    assert np.percentile(relative, 50) < 0.01
    assert np.percentile(relative, 90) < 0.06
    assert compared.score == pytest.approx((expected**3.5).mean() ** (1 / 3.5), rel=3e-3)


def bars(*, upright):
    """A 7 cpd grating of contrast 0.5 around 40 cd/m2 that loses half of it; upright bars repeat along x."""
    index = np.arange(160)[None, :] if upright else np.arange(128)[:, None]
    wave = np.broadcast_to(np.cos(2 * np.pi * (index + 0.5) / 4), (128, 160))
    return (40.0 + 10.0 * wave).astype(np.float32), (40.0 + 20.0 * wave).astype(np.float32)


@pytest.mark.parametrize(("eye", "left"), [(Pursuit.NONE, 0.05), (Pursuit.BOTH, 0.4)])
def test_a_pan_forgives_upright_bars_only(viewing, eye, left):
    # At 20 deg/s to the right (3.5 on a retina that follows) upright bars blur along their frequency
    # vector, level ones do not.
    observer = Aqm.paper(viewing, pursuit=eye)
    pan, scores = moving((128, 160), 20.0, 0.0), {}
    for upright in (True, False):
        pair = bars(upright=upright)
        still, panned = (observer.compare(*pair, velocity=v).score for v in (None, pan))
        scores[upright] = still, panned
    assert scores[True][0] == pytest.approx(scores[False][0], rel=0.02)
    assert scores[True][1] < left * scores[True][0]
    assert scores[False][1] == pytest.approx(scores[False][0], rel=0.02)


def test_motion_may_differ_from_place_to_place(paper):
    velocity = moving((128, 160), 0.0, 0.0)
    velocity[:, 80:, 0] = 20.0
    pair = bars(upright=True)
    jnd, still = (paper.compare(*pair, velocity=v).jnd for v in (velocity, None))
    np.testing.assert_allclose(jnd[:, :72], still[:, :72], rtol=0.02, atol=0.02)
    assert jnd[:, 84:].max() < 0.4 * still.max()


def test_a_uniform_shift_does_not_move(paper):
    # A frame that is darker everywhere by the same factor has no pattern that motion could reveal.
    test, reference = np.full((128, 160), 39.0, np.float32), np.full((128, 160), 40.0, np.float32)
    still, moved = (paper.compare(test, reference, velocity=v) for v in (None, moving((128, 160), 20.0, 5.0)))
    assert 0 < still.score < 1
    assert moved.score == pytest.approx(still.score, rel=1e-3)


def test_both_hypotheses_take_the_larger_sensitivity(viewing, textured):
    test = textured.copy()
    test[40:70, 50:90] *= 0.8
    velocity = moving(textured.shape, 4.0, 1.0)
    observers = {eye: Aqm.paper(viewing, pursuit=eye) for eye in Pursuit}
    maps = {eye: of.compare(test, textured, velocity=velocity).jnd for eye, of in observers.items()}
    either = np.maximum(maps[Pursuit.PURSUIT], maps[Pursuit.NONE])
    # A channel more sensitive in one hypothesis, another in the other: together they may see more.
    assert (maps[Pursuit.BOTH] >= either * 0.98).all()
    assert maps[Pursuit.BOTH].max() > 1


def test_one_pixel_outlier_stays_local(paper, textured):
    test = textured.copy()
    test[64, 80] = 1e5
    jnd = paper.compare(test, textured).jnd
    assert np.isfinite(jnd).all()
    assert jnd[64, 80] > 5
    # The coarse bands reach 1/r = 32 pixels; the outlier is 60 dB above anything on a screen.
    assert jnd[:16].max() < 0.02 * jnd.max()


def test_bands_add_up_to_the_score(paper, textured):
    test = textured.copy()
    test[40:90, 20:100] *= 0.9
    compared = paper.compare(test, textured)
    pooled = sum(j**3.5 for j in compared.steady.band_jnd) ** (1 / 3.5)
    assert pooled == pytest.approx(compared.score, rel=0.05)
    np.testing.assert_allclose(compared.probability, 1 - 0.25**compared.jnd, atol=1e-5)


# Watson and Ahumada 2005, Journal of Vision 5(9): mean sensitivity of 16 observers, -20 log10 of
# contrast, to horizontal Gabors of Gaussian sigma 0.5 deg at 30 cd/m2: (cpd, dB). Stimuli 1 to 8.
GABORS = (
    (1.12, 36.419),
    (2.00, 39.206),
    (2.83, 41.263),
    (4.00, 42.130),
    (5.66, 39.838),
    (8.00, 36.872),
    (11.3, 32.418),
    (16.0, 25.955),
)


def test_modelfest_gabors():
    ppd, size, mean = 120.0, 256, 30.0
    pitch_m = 2.0 * math.tan(math.radians(1)) / ppd
    observer = Aqm.paper(Viewing(size, size, diagonal_m=pitch_m * size * math.sqrt(2), distance_m=2.0))
    assert len(observer.bands_cpd) == 8  # 120 px/deg: two levels more than at 28
    y, x = (np.mgrid[:size, :size] - (size - 1) / 2) / ppd
    window = np.exp(-(x**2 + y**2) / (2 * 0.5**2))
    background = np.full((size, size), mean, np.float32)

    def sensitivity_db(cpd, contrast=0.01):
        """Without a mask JND are proportional to contrast; the map is pooled over space per square degree."""
        target = (mean * (1 + contrast * np.cos(2 * np.pi * cpd * y) * window)).astype(np.float32)
        jnd = observer.compare(target, background).score * (size / ppd) ** (2 / POOLING_EXPONENT)
        return 20 * math.log10(jnd / contrast)

    error = np.array([sensitivity_db(cpd) - measured for cpd, measured in GABORS])
    # Eq. 4 was not made for these: 9 dB too low at 1 cpd, 5 dB too high at 16. No gain is fitted.
    assert abs(error.mean()) < 3.0
    assert error.std() < 6.0
    assert sensitivity_db(4.0, 0.005) == pytest.approx(sensitivity_db(4.0), abs=0.1)
