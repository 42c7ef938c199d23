"""Shading and panning of textures, and the table of losses."""

import numpy as np
import pytest

from studies.observers import moving_texture
from studies.observers.mode import PAPER
from studies.observers.moving_texture import DISPLAYS, Condition, Losses, conditions, frames, shade
from studies.observers.tables import read_columns, read_textures


def texels(seed=1):
    return np.random.default_rng(seed).random((16, 32)).astype(np.float32)


def test_a_texture_moves_to_the_right_and_comes_in_again():
    np.testing.assert_array_equal(shade(texels(), 0.0, 1), texels())
    np.testing.assert_allclose(shade(texels(), 3.0, 1), np.roll(texels(), 3, axis=1), atol=1e-6)
    half = 0.5 * (texels() + np.roll(texels(), 1, axis=1))
    np.testing.assert_allclose(shade(texels(), 0.5, 1), half, atol=1e-6)
    texture = np.repeat(texels()[:, :1], 32, axis=1)  # bars that lie lose nothing
    np.testing.assert_allclose(shade(texture, 5.3, 2), shade(texture, 0.0, 2), atol=1e-6)


@pytest.mark.parametrize("columns", [2, 4])
def test_a_sample_fills_its_columns_which_stay_on_the_screen(columns):
    for shift_px in (0.0, 1.3, 2.7):
        screen = shade(texels(), shift_px, columns).reshape(16, -1, columns)
        assert (screen == screen[..., :1]).all()


@pytest.mark.parametrize("columns", [1, 2, 4])
def test_the_mean_light_stays(columns):
    texture = texels()
    assert shade(texture, 0.7, columns).mean() == pytest.approx(texture.mean(), abs=1e-3)


def test_textures_are_linear_and_the_grass_is_dark():
    textures = read_textures()
    assert set(textures) == moving_texture.TEXTURES
    assert {texture.shape for texture in textures.values()} == {(512, 512)}
    means = {name: float(texture.mean()) for name, texture in textures.items()}
    assert means.pop("grass") == pytest.approx(0.0187, abs=1e-4)
    assert list(means.values()) == pytest.approx([0.5] * 3, abs=1e-3)


def test_there_are_72_conditions_and_more_motion_hides_more():
    listed = conditions()
    assert len(set(listed)) == 72
    assert {c.columns_per_sample for c in listed} == {2, 4}
    _, observers = read_columns("moving_texture.csv", "jnd")
    loss = dict(zip(listed, -observers["jnd"], strict=True))
    assert loss[Condition("noise", 4, "pc", 0.0)] == pytest.approx(6.7868, abs=1e-4)
    for texture in ("checkerboard", "noise"):
        still, fast = (loss[Condition(texture, 2, "pc", speed)] for speed in (0.0, 30.0))
        assert still > 2.0 * fast


def test_frames_have_the_displays_luminance():
    for name, display in DISPLAYS.items():
        pairs = list(frames(Condition("noise", 2, name, 10.0), read_textures()["noise"]))
        assert len(pairs) == moving_texture.FRAMES
        for coarse, full in pairs:
            assert full.mean() == pytest.approx(display.mean_cd_m2, rel=0.01)
            assert coarse.mean() == pytest.approx(display.mean_cd_m2, rel=0.01)
            assert coarse.std() < full.std()


def test_ranks_are_correlated_over_the_chosen_conditions():
    listed = conditions()
    observers = np.arange(72.0)
    agreed = Losses(listed, observers, observers, observers, observers**3)
    assert agreed.spearman() == pytest.approx(1.0)
    is_grass = np.array([c.texture == "grass" for c in listed])
    wrong_on_grass = Losses(
        listed, observers, observers, observers, np.where(is_grass, -observers, observers)
    )
    assert wrong_on_grass.spearman() < 0.9
    assert wrong_on_grass.spearman(textures=moving_texture.TEXTURES - {"grass"}) == pytest.approx(1.0)


def test_a_coarser_shading_scores_worse():
    texture = read_textures()["noise"]
    half, quarter = (
        moving_texture.score(Condition("noise", columns, "pc", 10.0), texture, PAPER) for columns in (2, 4)
    )
    assert 0.0 < half < quarter
