"""Measures of the bench: nothing for identical sequences, more for more noise; the temporal error."""

import math
from dataclasses import replace

import numpy as np
import pytest

from enfilade.comparison.measures import why_missing
from enfilade.metric import Pursuit
from studies.bench.measures import SCALES, HalvesPsnr, Temporal, open_measure, visible_before
from support.displayed_frames import VIEWING, noise, pair, picture
from twins.temporal_error import temporal_error

FRAMES = 4
SHIFT = 1.5  # pixels a frame


def _error(name: str, size: float) -> float:
    """Error of a moving picture with independent noise in each frame."""
    measure, values = open_measure(name, VIEWING, Pursuit.BOTH), []
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


def test_independent_noise_counts_by_the_root_of_two():
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


def test_noise_of_the_reference_does_not_count():
    """A test with noise of 0.05 has the same scores against clean and against noisy halves."""
    measures = {kind: (HalvesPsnr(), Temporal()) for kind in ("clean", "noisy")}
    values = {kind: ([], []) for kind in measures}
    for frame in range(FRAMES):
        seen = pair(picture() + noise(frame, 0.05), picture(), is_first=frame == 0)
        halves = tuple(seen.reference + noise(100 * k + frame, 0.1) for k in (1, 2))
        for kind, given in (("clean", seen), ("noisy", replace(seen, halves=halves))):
            for measure, found in zip(measures[kind], values[kind], strict=True):
                found.append(measure.measure(given))
    psnr, temporal = ([measures[k][i].pool(values[k][i]) for k in ("clean", "noisy")] for i in (0, 1))
    assert psnr[1] == pytest.approx(psnr[0], abs=0.3)
    assert psnr[0] == pytest.approx(26.0, abs=0.2)
    assert temporal[1] == pytest.approx(temporal[0], rel=0.05)


def test_a_cut_is_no_flicker():
    measure = Temporal()
    for _ in range(2):
        assert measure.measure(pair(picture() + noise(1, 0.1), picture(), is_first=True)) is None
    assert measure.pool([None, None]) == 0.0


def _layers(shapes: np.ndarray, z: np.ndarray, shift: float) -> dict[str, np.ndarray]:
    """A camera far away that looks along z and slides: planes that face it."""
    height, width = shapes.shape
    position = np.zeros((height, width, 3), np.float32)
    position[..., 2] = z
    normal = np.zeros((height, width, 3), np.float16)
    normal[..., 2] = 1.0
    backward = np.zeros((height, width, 2), np.float32)
    backward[..., 0] = -shift
    depth = np.full((height, width), 4.0, np.float32)
    return {"shape_index": shapes, "P": position, "N": normal, "Z": depth, "backward": backward}


def test_disoccluded_and_entering_pixels_were_not_visible_before():
    shapes = np.ones((3, 6), np.uint32)
    shapes[:, 3:] = 2
    flat = np.zeros((3, 6), np.float32)
    now, last = _layers(shapes, flat, 1.0), _layers(np.roll(shapes, -1, axis=1), flat, 1.0)
    # Column 0 comes from outside.
    assert visible_before(now, last).tolist() == [[False, True, True, True, True, True]] * 3
    # Another shape was there before.
    assert not visible_before(now, _layers(np.full_like(shapes, 7), flat, 1.0)).any()
    # The same shape, on another plane.
    assert not visible_before(now, _layers(np.roll(shapes, -1, axis=1), flat + 1.0, 1.0)).any()
