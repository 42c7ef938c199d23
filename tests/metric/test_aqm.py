"""Properties of both modes: identity, local defects, borders, invalid pixels, any size, refusals."""

import doctest
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import enfilade.metric.aqm
from enfilade.errors import InputError
from enfilade.metric import Aqm, HalvesAqm
from enfilade.viewing import Viewing

PAPER = Viewing(640, 480)
MODES = {"paper": Aqm.paper, "modern": Aqm.modern}


def moving(shape, across, down):
    velocity = np.empty((*shape, 2), np.float32)
    velocity[...] = across, down
    return velocity


def test_examples():
    found = doctest.testmod(enfilade.metric.aqm)
    assert found.attempted > 0
    assert found.failed == 0


def test_equal_images_give_exactly_zero(aqm, textured):
    for velocity in (None, moving(textured.shape, 7.0, 3.0)):
        compared = aqm.compare(textured, textured.copy(), velocity=velocity)
        assert not compared.jnd.any()
        assert not compared.probability.any()
        assert compared.score == compared.percent_visible == 0.0
        assert compared.steady.band_jnd == (0.0,) * 6


@pytest.mark.parametrize("defect", ["blur", "object", "edge"])
def test_a_local_defect_lights_up_there_only(aqm, textured, defect):
    test = textured.copy()
    rows, columns = slice(48, 72), slice(64, 96)
    if defect == "blur":
        test[rows, columns] = textured[rows, columns].mean()
    elif defect == "object":
        test[rows, columns] += 30.0
    else:
        test[rows, 80] += 25.0
    jnd = aqm.compare(test, textured).jnd
    assert jnd[rows, columns].max() > 7
    row, column = np.unravel_index(jnd.argmax(), jnd.shape)
    assert 44 <= row < 76
    assert 60 <= column < 100
    # The 0.9 cpd band reaches one of its periods, 32 pixels, the fine ones much less; the aperture 25.
    far = np.ones(jnd.shape, bool)
    far[16:104, 32:128] = False
    assert jnd[far].max() < (0.15 if aqm.has_transient else 0.08) * jnd.max()


def test_the_score_lies_between_the_largest_band_and_the_sum_of_all(aqm):
    reference = np.full((128, 160), 40.0, np.float32)
    test = reference.copy()
    test[60:68, 76:84] = 60.0
    found = aqm.compare(test, reference)
    bands = found.steady.band_jnd
    # Maps of coarse bands are interpolated, which costs a few percent.
    assert 0.95 * max(bands) < found.score < 1.05 * sum(bands)


@pytest.mark.parametrize("size", [0.45, 0.55])
@pytest.mark.parametrize("speed", [0.0, 5.0])
def test_where_most_of_a_frame_is_brighter_the_rest_is_not_seen(aqm, size, speed):
    reference = np.full((128, 160), 50.0, np.float32)
    test = reference.copy()
    test[:, : int(160 * size)] = 55.0
    jnd = aqm.compare(test, reference, velocity=moving(reference.shape, speed, 0.0)).jnd
    assert jnd[:, 150:].max() < 0.1 * jnd[:, :60].max()


def test_invalid_pixels_neither_ring_nor_count(aqm, textured):
    valid = np.ones(textured.shape, bool)
    valid[50:70, 60:90] = False
    holed = np.where(valid, textured, np.float32(np.nan))
    velocity = moving(textured.shape, 1.0, 0.0)
    velocity[~valid] = np.nan
    for pair in ((holed, textured), (textured, holed), (np.where(valid, textured, textured + 40), textured)):
        compared = aqm.compare(*pair, velocity=velocity, valid=valid)
        assert not compared.jnd.any()
        assert compared.score == compared.percent_visible == 0.0
    assert aqm.compare(textured + 9, textured, valid=np.zeros_like(valid)).score == 0.0


def test_pixels_beside_invalid_ones_move_as_they_do(aqm):
    bars = (50.0 + 10.0 * np.cos(np.pi * np.arange(160) / 2.0) * np.ones((128, 1))).astype(np.float32)
    reference, velocity = np.full(bars.shape, 50.0, np.float32), moving(bars.shape, 20.0, 0.0)
    valid = np.ones(bars.shape, bool)
    valid[::8] = False
    velocity[~valid] = 0.0
    jnd = aqm.compare(bars, reference, velocity=velocity, valid=valid).jnd
    everywhere = aqm.compare(bars, reference, velocity=moving(bars.shape, 20.0, 0.0)).jnd
    assert np.median(jnd[valid]) == pytest.approx(np.median(everywhere), rel=0.5)


def test_borders_do_not_ring(aqm):
    ramp = np.broadcast_to(np.linspace(5, 90, 160, dtype=np.float32), (128, 160)).copy()
    test = ramp.copy()
    test[60:68, 76:84] += 15
    jnd = aqm.compare(test, ramp).jnd
    assert max(jnd[:, :8].max(), jnd[:, -8:].max()) < 0.3


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("shape", [(1, 1), (2, 37), (23, 5), (40, 31)])
def test_any_size(mode, shape):
    reference = np.random.default_rng(1).uniform(5, 90, shape).astype(np.float32)
    test = (reference * 0.7).astype(np.float32)
    aqm = MODES[mode](PAPER.cropped(*shape[::-1]))
    compared = aqm.compare(test, reference, velocity=moving(shape, 3.0, 1.0))
    assert compared.jnd.shape == shape
    assert np.isfinite(compared.jnd).all()
    assert 0 <= compared.percent_visible <= 100
    still, mirrored = (
        aqm.compare(*(np.ascontiguousarray(i[:, ::s]) for i in (test, reference))) for s in (1, -1)
    )
    assert mirrored.score == pytest.approx(still.score, rel=0.05)


@settings(max_examples=8, deadline=None)
@given(part=st.floats(0.1, 0.9), seed=st.integers(0, 99), mode=st.sampled_from(sorted(MODES)))
def test_a_smaller_error_is_less_visible(part, seed, mode):
    rng = np.random.default_rng(seed)
    reference = rng.uniform(20, 60, (24, 32)).astype(np.float32)
    error = rng.uniform(-5, 5, (24, 32)).astype(np.float32)
    aqm = MODES[mode](PAPER.cropped(32, 24))
    whole = aqm.compare(reference + error, reference).score
    assert 0 < aqm.compare(reference + np.float32(part) * error, reference).score < whole


def test_turning_and_swapping_change_little(aqm, textured):
    test = textured.copy()
    test[40:60, 20:50] *= 0.8
    plain = aqm.compare(test, textured)
    turned = aqm.compare(test[::-1, ::-1].copy(), textured[::-1, ::-1].copy())
    # The grid of the modern mode's aperture begins at the first pixel.
    np.testing.assert_allclose(turned.jnd[::-1, ::-1], plain.jnd, atol=0.1 * plain.jnd.max())
    # Only the light that contrasts are taken over changes.
    assert aqm.compare(textured, test).score == pytest.approx(plain.score, rel=0.05)


@pytest.mark.parametrize(("mode", "left"), [("paper", 0.2), ("modern", 0.35)])
def test_visibility_falls_with_distance(viewing, mode, left, textured):
    test = textured + np.where(np.arange(160) % 2, 4.0, -4.0).astype(np.float32)
    near, far = (
        MODES[mode](replace(viewing, distance_m=distance)).compare(test, textured).score
        for distance in (0.5, 1.0)
    )
    assert far < left * near


def test_black_images(aqm):
    black = np.zeros((128, 160), np.float32)
    assert aqm.compare(black, black).score == 0.0
    assert np.isfinite(aqm.compare(black + 1, black).jnd).all()


@pytest.mark.parametrize(
    ("value", "word"), [(np.nan, "not finite"), (np.inf, "not finite"), (-0.5, "negative")]
)
def test_bad_luminance_is_refused_by_place(paper, textured, value, word):
    bad, valid = textured.copy(), np.ones(textured.shape, bool)
    bad[3, 5], valid[3, 5] = value, False
    with pytest.raises(InputError, match=f"test is {word}.* row 3, column 5"):
        paper.compare(bad, textured)
    with pytest.raises(InputError, match=f"reference is {word}"):
        paper.compare(textured, bad)
    assert paper.compare(bad, textured, valid=valid).score == 0.0


@pytest.mark.parametrize(
    ("name", "array", "word"),
    [
        ("test", np.zeros((128, 159), np.float32), "shape"),
        ("test", np.zeros((128, 160)), "float64"),
        ("test", [[1.0]], "list"),
        ("velocity", np.zeros((128, 160), np.float32), "shape"),
        ("velocity", np.full((128, 160, 2), np.nan, np.float32), "not finite"),
        ("valid", np.zeros((128, 160), np.uint8), "uint8"),
        ("test", np.full((128, 160), -1, np.float32), "negative"),
        ("change", np.zeros((128, 160), np.float32), "paper's mode"),
    ],
)
def test_wrong_arrays_are_refused_by_name(paper, textured, name, array, word):
    arguments = {"test": textured, "reference": textured, name: array}
    with pytest.raises(InputError, match=f"{name}.*{word}"):
        paper.compare(**arguments)


def test_wrong_settings_are_refused_by_name(viewing):
    for metric in (Aqm.paper, HalvesAqm):
        with pytest.raises(InputError, match="mask_slope"):
            metric(viewing, mask_slope=1.5)
