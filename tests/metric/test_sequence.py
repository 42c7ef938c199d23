"""Sequences: identity, flicker against steady errors, motion compensation, cuts, one score."""

import numpy as np
import pytest
import scipy.ndimage

from enfilade.errors import InputError
from enfilade.metric import Aqm, SequenceAqm, sequence_score
from enfilade.viewing import Viewing

SHAPE = (128, 160)
VIEWING = Viewing(640, 480).cropped(SHAPE[1], SHAPE[0])


@pytest.fixture(scope="module")
def metric():
    return SequenceAqm(Aqm.modern(VIEWING))


@pytest.fixture(scope="module")
def scene():
    """Smooth texture with edges, cd/m2; wraps around horizontally."""
    grain = np.random.default_rng(5).standard_normal(SHAPE)
    grain = scipy.ndimage.gaussian_filter(grain, 1.2, mode="wrap")
    panels = 30.0 + 15.0 * (np.arange(SHAPE[1]) // 40 % 2)
    return (panels * (1.0 + 0.25 * grain / grain.std())).clip(2.0).astype(np.float32)


def played(metric, tests, references, **flow):
    found = [
        metric.compare(test, reference, is_cut=index == 0, **flow)
        for index, (test, reference) in enumerate(zip(tests, references, strict=True))
    ]
    return found, sequence_score(comparison.score for comparison in found)


def test_identical_sequences_score_exactly_zero(metric, scene):
    frames = [np.roll(scene, 2 * step, axis=1) for step in range(3)]
    flow = np.zeros((*SHAPE, 2), np.float32)
    flow[..., 0] = -2.0
    found, score = played(metric, frames, frames, backward_flow_px=flow)
    assert score == 0.0
    for comparison in found:
        assert not comparison.jnd.any()
        assert comparison.steady.score == comparison.transient.score == 0.0


def boil(index, scene):
    noise = np.random.default_rng(index).standard_normal(SHAPE)
    return scene * scipy.ndimage.gaussian_filter(noise, 1.0)


def shimmer(index, scene):
    return (-1) ** index * (np.roll(scene, 1, axis=1) - np.roll(scene, -1, axis=1))


def pump(index, scene):
    patches = (np.arange(SHAPE[0])[:, None] // 24 + np.arange(SHAPE[1]) // 24 + index) % 2
    return np.where(patches, scene, -scene)


@pytest.mark.parametrize("error", [boil, shimmer, pump])
def test_flicker_is_worse_than_a_steady_blur_of_larger_error(metric, scene, error):
    blurred = scipy.ndimage.gaussian_filter(scene, 1.0)
    power = np.mean((blurred - scene) ** 2)
    flickering = []
    for index in range(4):
        change = error(index, scene)
        change = change * np.sqrt(0.9 * power / np.mean(change**2))
        flickering.append((scene + change).clip(0).astype(np.float32))
    references = [scene] * 4
    found, flicker = played(metric, flickering, references)
    steady, blur = played(metric, [blurred.astype(np.float32)] * 4, references)
    assert flicker > blur
    assert found[-1].transient.score > 0.5 * found[-1].steady.score
    assert steady[-1].transient.score == 0.0


def test_an_error_that_sticks_to_a_moving_surface_does_not_flicker(metric, scene):
    error = np.zeros(SHAPE, np.float32)
    error[40:80, 60:100] = 6.0
    references = [np.roll(scene, 3 * step, axis=1) for step in range(3)]
    tests = [np.roll(scene + error, 3 * step, axis=1) for step in range(3)]
    flow = np.zeros((*SHAPE, 2), np.float32)
    flow[..., 0] = -3.0
    followed, _ = played(metric, tests, references, backward_flow_px=flow)
    still, _ = played(metric, tests, references)
    assert followed[-1].transient.score < 0.02 * still[-1].transient.score
    assert still[-1].transient.score > 0.1


def test_a_disoccluded_surface_does_not_flicker(metric, scene):
    # A square that is 15 % too bright uncovers 8 pixels of a textured background in each frame.
    def frame(index):
        is_square = np.zeros(SHAPE, bool)
        is_square[40:90, 30 + 8 * index : 80 + 8 * index] = True
        reference = np.where(is_square, np.float32(60.0), scene)
        test = np.where(is_square, np.float32(69.0), reference)
        flow = np.zeros((*SHAPE, 2), np.float32)
        flow[is_square, 0] = 8.0
        return test, reference, flow

    found = {}
    for has_forward in (False, True):
        for index in range(3):
            test, reference, flow = frame(index)
            compared = metric.compare(
                test,
                reference,
                backward_flow_px=-flow,
                forward_flow_px=flow if has_forward else None,
                is_cut=index == 0,
            )
        found[has_forward] = compared.transient.score
    assert found[False] > 1.0
    assert found[True] < 1e-3


def test_a_cut_has_no_frame_before_it(metric, scene):
    worse = scene * np.float32(0.8)
    metric.compare(worse, scene, is_cut=True)
    assert metric.compare(scene, scene).transient.score > 0
    metric.compare(worse, scene, is_cut=True)
    assert metric.compare(scene, scene, is_cut=True).score == 0.0


def test_the_papers_mode_compares_frames_alone(scene):
    paper = SequenceAqm(Aqm.paper(VIEWING))
    for test in (scene, scene * np.float32(0.9)):
        found = paper.compare(test, scene)
        assert found.transient.score == 0.0
        assert found.score == found.steady.score


def bilinear_transient_jnd(metric, period_px, step_px):
    """Transient part of a grating of 4 cd/m2 on 40 that sticks to a surface which moves to the right."""
    reference = np.full(SHAPE, 40.0, np.float32)
    flow = np.zeros((*SHAPE, 2), np.float32)
    flow[..., 0] = -step_px
    for frame in range(3):
        x = np.arange(SHAPE[1]) - frame * step_px
        test = (reference + 4.0 * np.sin(2.0 * np.pi * x / period_px)).astype(np.float32)
        found = metric.compare(test, reference, backward_flow_px=flow, is_cut=frame == 0)
    return found.transient.score


@pytest.mark.parametrize(("period_px", "most_jnd"), [(4, 0.35), (6, 0.13), (12, 0.02)])
def test_between_pixels_a_fine_steady_error_changes_a_little(metric, period_px, most_jnd):
    # Bilinear samples lose 29 % of a sine half way between pixels at 4 pixels a period, 3 % at 12.
    assert 0.0 < bilinear_transient_jnd(metric, period_px, 1.5) < most_jnd
    assert bilinear_transient_jnd(metric, period_px, 2.0) < 1e-3


def test_sequence_score_lies_between_mean_and_worst():
    assert sequence_score([0.0, 0.0]) == 0.0
    assert sequence_score([2.0] * 5) == pytest.approx(2.0)
    assert 1.0 < sequence_score([0.0, 2.0]) < 2.0
    with pytest.raises(InputError, match="without frames"):
        sequence_score([])


@pytest.mark.parametrize("name", ["backward_flow_px", "forward_flow_px"])
def test_bad_flow_is_refused(metric, scene, name):
    with pytest.raises(InputError, match=rf"{name}.*shape"):
        metric.compare(scene, scene, **{name: np.zeros((3, 4, 2), np.float32)})
