"""Sequences: identity, flicker against steady errors, motion compensation, cuts, one score."""

import numpy as np
import pytest
import scipy.ndimage

from enfilade.errors import InputError
from enfilade.metric import MetricOptions, SequenceAqm, sequence_score
from enfilade.metric.transient import ErrorChange, flicker_sensitivity, moved
from enfilade.viewing import Viewing

SHAPE = (128, 160)
VIEWING = Viewing(640, 480).cropped(SHAPE[1], SHAPE[0])


@pytest.fixture(scope="module")
def judge():
    return SequenceAqm(VIEWING)


@pytest.fixture(scope="module")
def scene():
    """Smooth texture with edges, cd/m2; wraps around horizontally."""
    grain = np.random.default_rng(5).standard_normal(SHAPE)
    grain = scipy.ndimage.gaussian_filter(grain, 1.2, mode="wrap")
    panels = 30.0 + 15.0 * (np.arange(SHAPE[1]) // 40 % 2)
    return (panels * (1.0 + 0.25 * grain / grain.std())).clip(2.0).astype(np.float32)


def played(judge, tests, references, **flow):
    found = [
        judge.judge(test, reference, is_cut=index == 0, **flow)
        for index, (test, reference) in enumerate(zip(tests, references, strict=True))
    ]
    return found, sequence_score(comparison.score for comparison in found)


def test_identical_sequences_score_exactly_zero(judge, scene):
    frames = [np.roll(scene, 2 * step, axis=1) for step in range(3)]
    flow = np.zeros((*SHAPE, 2), np.float32)
    flow[..., 0] = -2.0
    found, score = played(judge, frames, frames, backward_flow_px=flow)
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
def test_flicker_is_worse_than_a_steady_blur_of_larger_error(judge, scene, error):
    blurred = scipy.ndimage.gaussian_filter(scene, 1.0)
    power = np.mean((blurred - scene) ** 2)
    flickering = []
    for index in range(4):
        change = error(index, scene)
        change = change * np.sqrt(0.9 * power / np.mean(change**2))
        flickering.append((scene + change).clip(0).astype(np.float32))
    references = [scene] * 4
    found, flicker = played(judge, flickering, references)
    steady, blur = played(judge, [blurred.astype(np.float32)] * 4, references)
    assert flicker > blur
    assert found[-1].transient.score > 0.5 * found[-1].steady.score
    assert steady[-1].transient.score == 0.0


def test_an_error_that_sticks_to_a_moving_surface_does_not_flicker(judge, scene):
    error = np.zeros(SHAPE, np.float32)
    error[40:80, 60:100] = 6.0
    references = [np.roll(scene, 3 * step, axis=1) for step in range(3)]
    tests = [np.roll(scene + error, 3 * step, axis=1) for step in range(3)]
    flow = np.zeros((*SHAPE, 2), np.float32)
    flow[..., 0] = -3.0
    followed, _ = played(judge, tests, references, backward_flow_px=flow)
    still, _ = played(judge, tests, references)
    assert followed[-1].transient.score < 0.02 * still[-1].transient.score
    assert still[-1].transient.score > 0.1


def test_a_cut_has_no_frame_before_it(judge, scene):
    worse = scene * np.float32(0.8)
    judge.judge(worse, scene, is_cut=True)
    assert judge.judge(scene, scene).transient.score > 0
    judge.judge(worse, scene, is_cut=True)
    assert judge.judge(scene, scene, is_cut=True).score == 0.0


def test_the_paper_knows_no_flicker(scene):
    paper = SequenceAqm(VIEWING, options=MetricOptions.paper())
    for test in (scene, scene * np.float32(0.9)):
        found = paper.judge(test, scene)
        assert found.transient.score == 0.0
        assert found.score == found.steady.score


def test_what_is_not_valid_does_not_flicker(judge, scene):
    valid = np.ones(SHAPE, bool)
    valid[30:60, 30:60] = False
    test = np.where(valid, scene, np.float32(np.nan))
    judge.judge(scene, scene, is_cut=True)
    assert judge.judge(test, scene, valid=valid).score == 0.0
    assert judge.judge(scene, scene).score == 0.0


def test_moved_is_exact_on_a_ramp():
    ramp = np.add.outer(2.0 * np.arange(9), 3.0 * np.arange(12)).astype(np.float32)
    flow = np.full((9, 12, 2), (0.25, -0.5), np.float32)
    found, is_inside = moved(ramp, flow)
    np.testing.assert_allclose(found[is_inside], (ramp + 0.75 - 1.0)[is_inside], rtol=1e-5)
    assert not is_inside[0].any()
    assert not is_inside[:, -1].any()
    assert is_inside[1:, :-1].all()


def test_change_follows_the_surface():
    error = np.zeros((6, 8), np.float32)
    error[3, 4] = 1.0
    black, changes = np.zeros_like(error), ErrorChange()
    flow = np.zeros((6, 8, 2), np.float32)
    flow[..., 0] = -1.0
    assert changes.next(error, black, flow, None) is None
    assert not changes.next(np.roll(error, 1, axis=1), black, flow, None).any()
    assert changes.next(error, black, flow, None).min() == -1.0


def test_the_callers_mask_may_change_after_a_frame():
    ones, changes, valid = np.ones((6, 8), np.float32), ErrorChange(), np.ones((6, 8), bool)
    changes.next(ones, np.zeros_like(ones), None, valid)
    valid[:] = False
    assert (changes.next(np.zeros_like(ones), np.zeros_like(ones), None, None) == -1.0).all()


def test_flicker_is_seen_best_at_low_spatial_frequency():
    light = np.array([10.0, 100.0])
    coarse, fine = (flicker_sensitivity(cpd, 30.0, light, 0.785) for cpd in (1.0, 16.0))
    assert (coarse > 5 * fine).all()
    assert coarse[1] > coarse[0]


def test_sequence_score_lies_between_mean_and_worst():
    assert sequence_score([0.0, 0.0]) == 0.0
    assert sequence_score([2.0] * 5) == pytest.approx(2.0)
    assert 1.0 < sequence_score([0.0, 2.0]) < 2.0
    with pytest.raises(InputError, match="without frames"):
        sequence_score([])


def test_bad_flow_is_refused(judge, scene):
    with pytest.raises(InputError, match=r"backward_flow_px.*shape"):
        judge.judge(scene, scene, backward_flow_px=np.zeros((3, 4, 2), np.float32))
