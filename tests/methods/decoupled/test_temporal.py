"""Specular AOVs and refined pixels averaged over frames.

Less noise, no light of a bright sky, no mix of frames that differ.
"""

from dataclasses import replace

import numpy as np
import pytest

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera, look_at
from enfilade.gbuffer import find_geometry
from enfilade.methods.base import FRAMES, TaskId
from enfilade.methods.decoupled import Decoupled
from enfilade.methods.decoupled.records import SpecularAov
from enfilade.methods.decoupled.temporal import (
    accumulate_refined,
    accumulate_temporally,
    redisplayed,
    upload_aov,
    upload_displayed,
    without_negative,
)
from support.analytic_truth import geometry_of
from support.example_scenes import wall
from support.in_memory import run_passes, walk_of
from support.material_scene import MATERIALS, front_camera, opened_scene

WIDTH, HEIGHT = 96, 64
SKY = 40.0  # times white
NOISE = 0.05
WEIGHTS = (0.25, 0.5, 0.75, 0.75, 0.5, 0.25)
# A camera that moves by half a pixel from frame to frame; the first is the frame itself.
STEP = 0.5 * 2.0 * 4.0 * np.tan(np.radians(22.5)) / HEIGHT
GEOMETRIES = [
    geometry_of(wall(), Camera(look_at((x, 0, 4), (x, 0, 0)), 45, WIDTH, HEIGHT))
    for x in STEP * np.array([0, -3, -2, -1, 1, 2, 3])
]
RIGHT = np.arange(WIDTH) > WIDTH // 2
WHERE = np.broadcast_to(RIGHT, (HEIGHT, WIDTH))


def test_accumulation_averages_noise_and_keeps_differences(tmp_path):
    renderer = opened_scene(tmp_path, dict.fromkeys(("one", "two"), MATERIALS["diffuse"]))
    rng = np.random.default_rng(4)
    geometries = [find_geometry(renderer, front_camera(x=x)) for x in (0.0, 0.05, -0.05)]
    size = geometries[0].shape_index.shape
    colors = [rng.normal(1.0, 0.1, (*size, 3)).astype(np.float16) for _ in geometries]

    def accumulated(offset):
        aovs = [
            SpecularAov(color + np.float16(offset if k else 0.0), np.full(size, 0.1, np.float16))
            for k, color in enumerate(colors)
        ]
        here, *others = (upload_aov(g, aov, g.is_hit) for g, aov in zip(geometries, aovs, strict=True))
        return accumulate_temporally(geometries[0], here, [(other, 1.0) for other in others], unit=1.0)

    where = geometries[0].is_hit
    averaged = accumulated(0.0)
    assert averaged[where].std() < 0.75 * colors[0][where].std(dtype=float)
    assert abs(averaged[where].mean() - 1.0) < 0.01
    assert not averaged[~where].any()
    # Differences of many standard deviations are not noise.
    np.testing.assert_allclose(accumulated(5.0)[where], colors[0][where], atol=1e-2)


def changed(values, white=1.0, noise=NOISE):
    """The change of the first of seven frames, of which the right half is refined."""
    deviation = np.where(WHERE, np.float32(noise * white), np.float32(0))
    shown = [
        upload_displayed([g, g], color, deviation, white=white)
        for g, color in zip(GEOMETRIES, values, strict=True)
    ]
    here = redisplayed(shown[0], values[0], deviation, WHERE, white=white)
    others = list(zip(shown[1:], WEIGHTS, strict=True))
    found = accumulate_refined(GEOMETRIES[0], values[0], here, others, white=white)
    return found - values[0]


def frames(light):
    rng = np.random.default_rng(2)
    noise = rng.normal(0.0, NOISE, (7, HEIGHT, WIDTH, 1)) * WHERE[..., None]
    return [(light + of).astype(np.float32).repeat(3, axis=2) for of in noise]


def test_noise_of_refined_pixels_falls_and_others_stay():
    made = frames(np.full((HEIGHT, WIDTH, 1), 0.4))
    change = changed(made)
    assert not change[~WHERE].any()
    inner = np.broadcast_to(np.arange(WIDTH) > WIDTH // 2 + 4, WHERE.shape)
    assert (made[0] + change - 0.4)[inner].std() < 0.6 * NOISE
    assert (made[0] + change)[inner].mean() == pytest.approx(0.4, abs=0.002)


def test_the_exposure_is_undone():
    change = changed(frames(np.full((HEIGHT, WIDTH, 1), 0.4)))
    exposed = [0.5 * one for one in frames(np.full((HEIGHT, WIDTH, 1), 0.4))]
    np.testing.assert_allclose(changed(exposed, white=0.5), 0.5 * change, atol=1e-3)


def test_dark_bars_before_a_bright_sky_stay_dark():
    bars = (np.arange(WIDTH) // 8 % 2 == 0)[None, :, None]
    made = frames(np.where(np.broadcast_to(bars, (HEIGHT, WIDTH, 1)), 0.05, SKY))
    change = changed(made)
    assert np.abs(change[made[0] < 1.0]).max() < 4.0 * NOISE


def test_noise_above_white_does_not_brighten_dark_bars():
    is_bar = np.broadcast_to((np.arange(WIDTH) // 4 % 2 == 0)[None, :], WHERE.shape)
    made = [np.where(is_bar[..., None], np.float32(0.05), np.float32(SKY)).repeat(3, axis=2)] * 7
    change = changed(made, noise=np.where(is_bar, 0.01, 5.0))
    assert np.abs(change[is_bar]).max() < 0.02


def test_uncertain_edges_of_other_frames_do_not_brighten_dark_bars_that_are_certain():
    """They had the weight of frames that are as certain: the bars became brighter by 0.23."""
    dark, edge = (np.full((HEIGHT, WIDTH, 3), value, np.float32) for value in (0.01, 0.4))
    shown = [
        upload_displayed([g, g], color, np.full((HEIGHT, WIDTH), noise, np.float32), white=1.0)
        for g, color, noise in zip(GEOMETRIES, [dark, *[edge] * 6], [1e-3, *[0.5] * 6], strict=True)
    ]
    here = redisplayed(shown[0], dark, np.full((HEIGHT, WIDTH), 1e-3, np.float32), WHERE, white=1.0)
    others = list(zip(shown[1:], WEIGHTS, strict=True))
    found = accumulate_refined(GEOMETRIES[0], dark, here, others, white=1.0)
    assert found.max() < 0.02


def test_frames_that_differ_by_more_than_their_noise_do_not_count():
    first, *others = frames(np.full((HEIGHT, WIDTH, 1), 0.4))
    change = changed([first, *[one + np.float32(0.5) for one in others]])
    assert np.abs(change[WHERE].mean()) < 0.5 * NOISE


def test_the_light_of_uncertain_edges_of_a_lamp_is_kept():
    rng = np.random.default_rng(4)
    lamp_shows = rng.random((7, HEIGHT, WIDTH, 1)) < 0.5
    made = [np.where(of, np.float32(1.2), np.float32(0.9)).repeat(3, axis=2) for of in lamp_shows]
    found = made[0] + changed(made)
    assert found[WHERE].std() < 0.9 * made[0][WHERE].std()
    assert found[WHERE].mean() == pytest.approx(1.05, abs=0.01)


def test_light_below_zero_leaves_no_black_dots():
    color = np.random.default_rng(3).uniform(0.1, 0.2, (HEIGHT, WIDTH, 3)).astype(np.float32)
    shapes = np.ones((HEIGHT, WIDTH), np.uint32)
    shapes[9:12, 21] = 2
    color[9:12, 21] = 50.0  # a lamp beside the dot
    expected = color.copy()
    color[10, 20] = -0.3  # a lobe that is a difference, by chance
    color[0, 0] = -0.1  # in a corner
    color[30, 40, 2] = -0.05  # one channel of a saturated colour, whose luminance is above zero
    found = without_negative(color, shapes)
    expected[10, 20] = np.mean([*color[9:12, 19], color[9, 20], color[11, 20]], axis=0)
    expected[0, 0] = np.mean([color[0, 1], color[1, 0], color[1, 1]], axis=0)
    expected[30, 40, 2] = 0.0
    np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_noise_about_zero_is_not_brightened_by_the_pixels_around():
    noise = np.random.default_rng(4).normal(0.0, 0.1, (HEIGHT, WIDTH, 3)).mean(axis=2, keepdims=True)
    color = np.repeat(noise, 3, axis=2).astype(np.float32)
    found = without_negative(color, np.ones((HEIGHT, WIDTH), np.uint32))
    assert found.min() >= 0.0
    assert found.mean() < 1.25 * np.maximum(color, 0.0).mean()


def test_pixels_far_below_zero_take_the_light_of_other_frames(tmp_path):
    """One negative path made a black cross: all pixels around it of the same surface are below zero, too."""
    renderer = opened_scene(tmp_path, {"ball": MATERIALS["diffuse"]})
    cameras = tuple(front_camera(x=x) for x in np.linspace(0.0, 0.02, 3))
    walk, method = walk_of(CameraPath(cameras, (1, 2, 3), 24.0), renderer), Decoupled()
    results, here = run_passes(method, walk), TaskId("shading", 1)
    task = next(t for t in method.tasks(results.analysis) if t.id == TaskId(FRAMES, 1))
    before, shaded = results.colors[1], results.records[here]
    row, column = (size // 2 for size in shaded.provenance.shape)
    cross = np.s_[row - 1 : row + 2, column - 1 : column + 2]
    assert before[cross].min() > 0.0
    diffuse, deviation = shaded.diffuse.copy(), np.zeros_like(shaded.deviation)
    diffuse[cross] = -0.1
    diffuse[row, column], deviation[cross] = -1.0, 1.0
    results.records[here] = replace(shaded, diffuse=diffuse, deviation=deviation)
    found = method.run(task, results, walk).records[1].color
    assert np.all(found[cross] > 0.5 * before[cross])
    assert np.all(found[cross] < 1.1 * before[cross])
