"""Measures of sequences: nothing for identical ones, more for more noise, and what each is blind to."""

import math
import sys

import numpy as np
import pytest

from enfilade.comparison.measures import (
    SCALES,
    Flip,
    Psnr,
    Temporal,
    display_pair,
    open_measure,
    visible_before,
    why_missing,
)
from enfilade.errors import InputError, SettingsError
from support.displayed_frames import HEIGHT, VIEWING, WIDTH, noise, pair, picture
from twins.temporal_error import temporal_error

FRAMES = 4
SHIFT = 1.5  # pixels a frame


def _error(name: str, size: float) -> float:
    """Error of a moving picture with noise drawn afresh in each frame."""
    measure, values = open_measure(name, VIEWING), []
    for frame in range(FRAMES):
        reference = picture(SHIFT * frame)
        test = reference + noise(frame, size) if size else reference
        values.append(measure.measure(pair(test, reference, shift=SHIFT, is_first=frame == 0)))
    return SCALES[name].error_of(measure.pool(values))


@pytest.mark.parametrize("name", SCALES)
def test_identical_sequences_have_no_error_and_more_noise_has_more(name):
    if why_missing(name):
        pytest.skip(why_missing(name))
    assert _error(name, 0.0) == pytest.approx(0.0, abs=1e-6)
    errors = [_error(name, size) for size in (0.01, 0.03, 0.1)]
    assert 0.0 < errors[0] < errors[1] < errors[2]


def test_psnr_of_a_known_error():
    reference = np.full((HEIGHT, WIDTH, 3), 0.5, np.float32)
    measure = Psnr()
    values = [measure.measure(pair(reference + np.float32(off), reference)) for off in (0.1, 0.05)]
    assert values == pytest.approx([20.0, 26.02], abs=0.01)
    # of the mean of both squared errors
    assert measure.pool(values) == pytest.approx(-10.0 * math.log10((0.01 + 0.0025) / 2.0), abs=0.01)
    assert math.isinf(measure.measure(pair(reference, reference)))


def test_an_error_that_stays_on_its_surface_does_not_flicker():
    measure = Temporal()
    assert measure.measure(pair(picture() + 0.05, picture(), is_first=True)) is None
    # the same on every surface: exactly nothing
    found = measure.measure(pair(picture(SHIFT) + 0.05, picture(SHIFT), shift=SHIFT))
    assert found == pytest.approx(0.0, abs=1e-6)


def test_an_error_that_moves_with_its_surface_does_not_flicker():
    stain = picture(0.0) - 0.5
    moved = np.roll(stain, 2, axis=1)
    measure = Temporal()
    measure.measure(pair(picture() + 0.2 * stain, picture(), is_first=True))
    found = measure.measure(pair(picture(2) + 0.2 * moved, picture(2), shift=2.0))
    assert found == pytest.approx(0.0, abs=1e-6)
    # ... and one that stays on the screen does
    measure.measure(pair(picture() + 0.2 * stain, picture(), is_first=True))
    assert measure.measure(pair(picture(2) + 0.2 * stain, picture(2), shift=2.0)) > 0.003


def test_noise_drawn_afresh_counts_by_the_root_of_two():
    measure = Temporal()
    values = [
        measure.measure(pair(picture() + noise(f, 0.05), picture(), is_first=f == 0)) for f in range(FRAMES)
    ]
    assert values[0] is None
    assert measure.pool(values) == pytest.approx(0.05 * math.sqrt(2.0), rel=0.03)
    # a bias of any size on top changes nothing
    biased = Temporal()
    off = [
        biased.measure(pair(picture() + noise(f, 0.05) + 0.1, picture(), is_first=f == 0))
        for f in range(FRAMES)
    ]
    assert biased.pool(off) == pytest.approx(measure.pool(values), rel=1e-3)


def test_the_temporal_error_is_that_of_its_twin():
    tests = [picture(), picture(SHIFT)]
    tests = [image + noise(i, 0.05) for i, image in enumerate(tests)]
    pairs = [pair(tests[i], picture(SHIFT * i), shift=SHIFT, is_first=i == 0) for i in range(2)]
    measure = Temporal()
    found = [measure.measure(p) for p in pairs][1]
    errors = [p.test - p.reference for p in pairs]
    twin = temporal_error(errors[1], errors[0], pairs[1].flow.backward, pairs[1].visible_before)
    assert found == pytest.approx(twin, rel=1e-5)


def test_a_cut_is_no_flicker():
    measure = Temporal()
    for _ in range(2):
        assert measure.measure(pair(picture() + noise(1, 0.1), picture(), is_first=True)) is None
    assert measure.pool([None, None]) == 0.0


def _layers(items: np.ndarray, z: np.ndarray, shift: float) -> dict[str, np.ndarray]:
    """A camera far away that looks along z and slides: planes that face it."""
    height, width = items.shape
    position = np.zeros((height, width, 3), np.float32)
    position[..., 2] = z
    normal = np.zeros((height, width, 3), np.float16)
    normal[..., 2] = 1.0
    backward = np.zeros((height, width, 2), np.float32)
    backward[..., 0] = -shift
    depth = np.full((height, width), 4.0, np.float32)
    return {"shape_index": items, "P": position, "N": normal, "Z": depth, "backward": backward}


def test_what_was_hidden_or_outside_was_not_visible_before():
    items = np.ones((3, 6), np.uint32)
    items[:, 3:] = 2
    flat = np.zeros((3, 6), np.float32)
    now, last = _layers(items, flat, 1.0), _layers(np.roll(items, -1, axis=1), flat, 1.0)
    # Column 0 comes from outside.
    assert visible_before(now, last).tolist() == [[False, True, True, True, True, True]] * 3
    # Another item was there before.
    assert not visible_before(now, _layers(np.full_like(items, 7), flat, 1.0)).any()
    # The same item, on another plane.
    assert not visible_before(now, _layers(np.roll(items, -1, axis=1), flat + 1.0, 1.0)).any()


def test_flip_is_that_of_its_own_package_at_our_pixels_per_degree():
    evaluate = pytest.importorskip("flip_evaluator").evaluate
    a, b = picture(), picture() + noise(3, 0.1)
    seen = pair(b, a)
    want = evaluate(seen.reference, seen.test, "LDR", True, False, True, {"ppd": VIEWING.pixels_per_degree})[
        1
    ]
    assert Flip(VIEWING).measure(seen) == pytest.approx(want)


def test_without_its_package_flip_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    with pytest.raises(SettingsError, match=r"pip install 'enfilade\[measures\]'"):
        Flip(VIEWING)


def test_without_its_package_colorvideovdp_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "pycvvdp", None)
    with pytest.raises(SettingsError, match="pip install cvvdp"):
        open_measure("cvvdp", VIEWING)


def test_an_unknown_measure_is_refused_with_the_known_ones():
    with pytest.raises(SettingsError, match="choose one of aqm, flip, psnr, temporal, cvvdp"):
        open_measure("taste", VIEWING)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_no_colour_is_refused(bad):
    image = picture()
    image[3, 4, 1] = bad
    with pytest.raises(InputError, match="the test holds pixels"):
        display_pair(image, picture(), VIEWING)
    with pytest.raises(InputError, match="shape"):
        display_pair(picture()[:-1], picture(), VIEWING)


def test_frames_are_exposed_and_clipped():
    bright = np.full((HEIGHT, WIDTH, 3), 0.75, np.float32)
    seen = display_pair(bright, -bright, VIEWING, exposure_ev=1.0)
    assert seen.test.max() == pytest.approx(1.0)
    assert seen.reference.max() == 0.0
    assert seen.test_cd_m2[0, 0] == pytest.approx(VIEWING.peak_cd_m2)
    assert seen.reference_cd_m2[0, 0] == pytest.approx(VIEWING.black_cd_m2)
