"""The whole chain: twin, identity, defects, motion, holes, properties, refusals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enfilade.errors import InputError
from enfilade.metric import Aqm, MetricOptions, Pursuit
from enfilade.viewing import Viewing

PAPER = Viewing(640, 480)


def moving(shape, across, down):
    velocity = np.empty((*shape, 2), np.float32)
    velocity[...] = across, down
    return velocity


def bars(shape, period, *, upright):
    """A grating of contrast 0.5 around 40 cd/m2; upright bars repeat along x."""
    index = np.arange(shape[1])[None, :] if upright else np.arange(shape[0])[:, None]
    wave = np.broadcast_to(np.cos(2 * np.pi * (index + 0.5) / period), shape)
    return (40.0 + 20.0 * wave).astype(np.float32)


@pytest.mark.parametrize("motion", ["still", "uniform", "sheared"])
def test_twin(twin, motion):
    shape = (38, 45)
    viewing = PAPER.cropped(shape[1], shape[0])
    metric = Aqm(viewing)
    rng = np.random.default_rng(3)
    reference = (30 + 10 * rng.random(shape) + 10 * (np.arange(45) // 6 % 2)).astype(np.float32)
    test = reference.copy()
    test[10:20, 15:30] *= 0.8
    velocity = {"still": None, "uniform": moving(shape, 6.0, -2.0), "sheared": None}[motion]
    if motion == "sheared":
        velocity = moving(shape, 2.0, -1.0)
        velocity[..., 0] += 0.1 * np.arange(45)
    expected = twin.jnd_map(
        test,
        reference,
        centres_cpd=[band.centre_cpp * viewing.pixels_per_degree for band in metric.cortex.bands],
        margin=32,
        padded_shape=(metric.cortex.height_px, metric.cortex.width_px),
        velocity=velocity,
    )
    compared = metric.compare(test, reference, velocity=velocity)
    relative = np.abs(compared.jnd - expected) / np.maximum(expected, 0.3)
    # Coarse bands are interpolated, and speeds averaged over their samples.
    assert np.percentile(relative, 50) < 0.01
    assert np.percentile(relative, 90) < 0.06
    assert compared.score == pytest.approx((expected**3.5).mean() ** (1 / 3.5), rel=3e-3)


def test_equal_images_give_exactly_zero(metric, textured):
    for velocity in (None, moving(textured.shape, 7.0, 3.0)):
        compared = metric.compare(textured, textured.copy(), velocity=velocity)
        assert not compared.jnd.any()
        assert not compared.probability.any()
        assert compared.score == compared.percent_visible == 0.0
        assert compared.band_jnd == (0.0,) * 6


@pytest.mark.parametrize("defect", ["blur", "object", "edge"])
def test_a_local_defect_lights_up_there_only(metric, textured, defect):
    test = textured.copy()
    rows, columns = slice(48, 72), slice(64, 96)
    if defect == "blur":
        test[rows, columns] = textured[rows, columns].mean()
    elif defect == "object":
        test[rows, columns] += 30.0
    else:
        test[rows, 80] += 25.0
    jnd = metric.compare(test, textured).jnd
    assert jnd[rows, columns].max() > 10
    row, column = np.unravel_index(jnd.argmax(), jnd.shape)
    assert 46 <= row < 74
    assert 62 <= column < 98
    # The 0.9 cpd band reaches one of its periods, 32 pixels; the fine ones much less.
    far = np.ones(jnd.shape, bool)
    far[16:104, 32:128] = False
    assert jnd[far].max() < 0.08 * jnd.max()


@pytest.mark.parametrize(("eye", "share"), [(Pursuit.NONE, 0.05), (Pursuit.BOTH, 0.4)])
def test_a_pan_forgives_upright_bars_only(metric, eye, share):
    # 7 cpd bars that lose half their contrast, at 20 deg/s to the right (3.5 on a retina that
    # follows): upright ones blur along their frequency vector, level ones do not.
    shape = (128, 160)
    pan = moving(shape, 20.0, 0.0)
    scores = {}
    for upright in (True, False):
        reference = bars(shape, 4, upright=upright)
        test = (40 + 0.5 * (reference - 40)).astype(np.float32)
        still = metric.compare(test, reference, pursuit=eye)
        panned = metric.compare(test, reference, velocity=pan, pursuit=eye)
        scores[upright] = (still.score, panned.score)
    assert scores[True][0] == pytest.approx(scores[False][0], rel=0.02)
    assert scores[True][1] < share * scores[True][0]
    assert scores[False][1] == pytest.approx(scores[False][0], rel=0.02)


def test_motion_may_differ_from_place_to_place(metric):
    reference = bars((128, 160), 4, upright=True)
    test = (40 + 0.5 * (reference - 40)).astype(np.float32)
    velocity = moving(reference.shape, 0.0, 0.0)
    velocity[:, 80:, 0] = 20.0
    jnd = metric.compare(test, reference, velocity=velocity).jnd
    still = metric.compare(test, reference).jnd
    np.testing.assert_allclose(jnd[:, :72], still[:, :72], rtol=0.02, atol=0.02)
    assert jnd[:, 84:].max() < 0.4 * still.max()


def test_a_uniform_shift_does_not_move(metric):
    # A frame that is darker everywhere by the same factor has no pattern that motion could reveal.
    test = np.full((128, 160), 39.0, np.float32)
    reference = np.full((128, 160), 40.0, np.float32)
    still = metric.compare(test, reference)
    moved = metric.compare(test, reference, velocity=moving((128, 160), 20.0, 5.0))
    assert 0 < still.score < 1
    assert moved.score == pytest.approx(still.score, rel=1e-3)


@pytest.mark.parametrize("share", [0.45, 0.55])
@pytest.mark.parametrize("speed", [0.0, 5.0])
def test_where_most_of_a_frame_is_brighter_the_rest_is_not_seen(viewing, share, speed):
    reference = np.full((128, 160), 50.0, np.float32)
    test = reference.copy()
    test[:, : int(160 * share)] = 55.0
    velocity = moving(reference.shape, speed, 0.0)
    for options in (MetricOptions.modern(), MetricOptions()):
        jnd = Aqm(viewing, options=options).compare(test, reference, velocity=velocity).jnd
        assert jnd[:, 150:].max() < 0.1 * jnd[:, :60].max()


def test_both_hypotheses_take_the_larger_sensitivity(metric, textured):
    test = textured.copy()
    test[40:70, 50:90] *= 0.8
    velocity = moving(textured.shape, 4.0, 1.0)
    maps = {eye: metric.compare(test, textured, velocity=velocity, pursuit=eye).jnd for eye in Pursuit}
    either = np.maximum(maps[Pursuit.PURSUIT], maps[Pursuit.NONE])
    # A channel more sensitive in one hypothesis, another in the other: together they may see more.
    assert (maps[Pursuit.BOTH] >= either * 0.98).all()
    assert maps[Pursuit.BOTH].max() > 1


def test_holes_do_not_ring(metric, textured):
    test = textured.copy()
    valid = np.ones(textured.shape, bool)
    valid[50:70, 60:90] = False
    test[~valid] = np.nan
    velocity = moving(textured.shape, 1.0, 0.0)
    velocity[~valid] = np.nan
    compared = metric.compare(test, textured, velocity=velocity, valid=valid)
    assert not compared.jnd.any()
    filled = metric.compare(textured, test, velocity=velocity, valid=valid)
    assert np.isfinite(filled.jnd).all()
    assert not filled.jnd.any()


def test_what_is_not_judged_does_not_count(metric, textured):
    test = textured.copy()
    test[:, :80] += 20
    valid = np.zeros(textured.shape, bool)
    valid[:, 80:] = True
    compared = metric.compare(test, textured, valid=valid)
    assert not compared.jnd.any()
    assert compared.percent_visible == 0.0
    nothing = metric.compare(test, textured, valid=np.zeros_like(valid))
    assert nothing.score == nothing.percent_visible == 0.0


def test_a_comparison_keeps_its_mask_when_the_caller_changes_his(metric, textured):
    valid = np.ones(textured.shape, bool)
    compared = metric.compare(textured, textured, valid=valid)
    valid[:] = False
    assert compared.valid.all()


def test_borders_do_not_ring(metric):
    ramp = np.broadcast_to(np.linspace(5, 90, 160, dtype=np.float32), (128, 160)).copy()
    test = ramp.copy()
    test[60:68, 76:84] += 15
    jnd = metric.compare(test, ramp).jnd
    assert jnd[:, :8].max() < 0.3
    assert jnd[:, -8:].max() < 0.3


def test_one_pixel_outlier_stays_local(metric, textured):
    test = textured.copy()
    test[64, 80] = 1e5
    jnd = metric.compare(test, textured).jnd
    assert np.isfinite(jnd).all()
    assert jnd[64, 80] > 5
    # The coarse bands reach 1/r = 32 pixels; the outlier is 60 dB above anything on a screen.
    assert jnd[:16].max() < 0.02 * jnd.max()


@settings(max_examples=10, deadline=None)
@given(height=st.integers(1, 40), width=st.integers(1, 40), seed=st.integers(0, 99))
def test_any_size(height, width, seed):
    rng = np.random.default_rng(seed)
    reference = rng.uniform(5, 90, (height, width)).astype(np.float32)
    test = (reference * 0.7).astype(np.float32)
    metric = Aqm(PAPER.cropped(width, height))
    compared = metric.compare(test, reference)
    assert compared.jnd.shape == (height, width)
    assert np.isfinite(compared.jnd).all()
    assert 0 <= compared.percent_visible <= 100
    mirrored = metric.compare(test[:, ::-1].copy(), reference[:, ::-1].copy())
    assert mirrored.score == pytest.approx(compared.score, rel=0.05)


@settings(max_examples=8, deadline=None)
@given(share=st.floats(0.1, 0.9), seed=st.integers(0, 99))
def test_a_smaller_error_is_less_visible(share, seed):
    rng = np.random.default_rng(seed)
    reference = rng.uniform(20, 60, (24, 32)).astype(np.float32)
    error = rng.uniform(-5, 5, (24, 32)).astype(np.float32)
    metric = Aqm(PAPER.cropped(32, 24))
    whole = metric.compare(reference + error, reference).score
    part = metric.compare(reference + np.float32(share) * error, reference).score
    assert 0 < part < whole


def test_mirror_images_are_judged_alike(metric, textured):
    test = textured.copy()
    test[40:60, 20:50] *= 0.8
    plain = metric.compare(test, textured).jnd
    turned = metric.compare(test[::-1, ::-1].copy(), textured[::-1, ::-1].copy()).jnd
    np.testing.assert_allclose(turned[::-1, ::-1], plain, atol=0.05 * plain.max())


def test_swapping_changes_little(metric, textured):
    test = textured.copy()
    test[40:60, 20:50] *= 0.8
    there, back = metric.compare(test, textured), metric.compare(textured, test)
    # Only the mean that contrasts are taken over changes.
    assert back.score == pytest.approx(there.score, rel=0.03)


def test_visibility_falls_with_distance(textured):
    test = textured + np.where(np.arange(160) % 2, 4.0, -4.0).astype(np.float32)
    near = Aqm(PAPER.cropped(160, 128)).compare(test, textured).score
    far_viewing = Viewing(160, 128, PAPER.cropped(160, 128).diagonal_m, distance_m=1.0)
    assert Aqm(far_viewing).compare(test, textured).score < 0.2 * near


def test_bands_add_up_to_the_score(metric, textured):
    test = textured.copy()
    test[40:90, 20:100] *= 0.9
    compared = metric.compare(test, textured)
    assert sum(j**3.5 for j in compared.band_jnd) ** (1 / 3.5) == pytest.approx(compared.score, rel=0.05)
    np.testing.assert_allclose(compared.probability, 1 - 0.25**compared.jnd, atol=1e-5)


def test_black_images(metric):
    black = np.zeros((128, 160), np.float32)
    assert metric.compare(black, black).score == 0.0
    assert np.isfinite(metric.compare(black + 1, black).jnd).all()


def with_value(image, value):
    bad = image.copy()
    bad[3, 5] = value
    return bad


@pytest.mark.parametrize(
    ("value", "word"), [(np.nan, "not finite"), (np.inf, "not finite"), (-0.5, "negative")]
)
def test_bad_luminance_is_refused_by_place(metric, textured, value, word):
    bad = with_value(textured, value)
    with pytest.raises(InputError, match=f"test is {word}.* row 3, column 5"):
        metric.compare(bad, textured)
    with pytest.raises(InputError, match=f"reference is {word}"):
        metric.compare(textured, bad)
    valid = np.ones(textured.shape, bool)
    valid[3, 5] = False
    assert metric.compare(bad, textured, valid=valid).score == 0.0


@pytest.mark.parametrize(
    ("name", "array", "word"),
    [
        ("test", np.zeros((128, 159), np.float32), "shape"),
        ("test", np.zeros((128, 160)), "float64"),
        ("test", [[1.0]], "list"),
        ("velocity", np.zeros((128, 160), np.float32), "shape"),
        ("velocity", np.full((128, 160, 2), np.nan, np.float32), "not finite"),
        ("valid", np.zeros((128, 160), np.uint8), "uint8"),
        ("noise_variance", np.full((128, 160), -1, np.float32), "negative"),
    ],
)
def test_wrong_arrays_are_refused_by_name(metric, textured, name, array, word):
    arguments = {"test": textured, "reference": textured, name: array}
    with pytest.raises(InputError, match=f"{name}.*{word}"):
        metric.compare(**arguments)


@pytest.mark.parametrize(("name", "number"), [("mask_slope", 1.5), ("workers", 0)])
def test_wrong_settings_are_refused_by_name(viewing, name, number):
    with pytest.raises(InputError, match=name):
        Aqm(viewing, **{name: number})
