"""Objects of two renderers' images: differences are found, noise is not taken for one."""

import numpy as np
import pytest

from enfilade.comparison.objects import compare_objects

NAMES = ("floor", "wall", "speck", "hidden")
SIZE = (40, 60)


@pytest.fixture
def index():
    """The floor below, the wall above, and a speck of nine pixels."""
    made = np.full(SIZE, 2, np.uint32)
    made[20:] = 1
    made[:3, :3] = 3
    return made


def noisy(image, seed, noise=0.5):
    """Two halves, with an exponential factor of mean 1 as noise."""
    rng = np.random.default_rng(seed)
    factors = 1.0 - noise + noise * rng.exponential(size=(2, *image.shape))
    return tuple((image * factor).astype(np.float32) for factor in factors)


def compared(reference, test, index, noise=0.5, noise_of_test=None):
    frames = (np.broadcast_to(of, (4, *of.shape)) for of in (reference, test))
    sizes = noise, noise if noise_of_test is None else noise_of_test
    halves = (noisy(of, seed, size) for seed, (of, size) in enumerate(zip(frames, sizes, strict=True)))
    return compare_objects(*halves, np.broadcast_to(index, (4, *SIZE)), NAMES)


def textured(level=0.5):
    stripes = np.where(np.arange(SIZE[1]) % 10 < 5, 0.6, 1.4)
    return np.broadcast_to((level * stripes)[:, None], (*SIZE, 3)).copy()


def test_noise_is_no_difference(index):
    everything, *objects = compared(textured(), textured(), index, noise=0.2)
    assert (everything.name, everything.pixel_percent) == ("everything", 100.0)
    assert {of.name for of in objects} == {"floor", "wall"}  # the speck is too small, the last one hidden
    for of in (everything, *objects):
        assert of.color_percent < 1.5 * of.noise_percent
        assert abs(of.contrast_percent) < 3.0
        assert abs(of.highlight_percent) < 10.0


def test_unequal_noise_makes_no_highlights(index):
    grain = 0.5 * np.exp(0.2 * np.random.default_rng(9).standard_normal((*SIZE, 1))) * np.ones(3)
    everything, *_ = compared(grain, grain, index, noise=0.3, noise_of_test=0.1)
    assert abs(everything.highlight_percent) < 8.0


def test_each_kind_of_difference_is_found(index):
    test = textured()
    test[20:] = test[20:] * (1.1, 1.0, 1.0)
    flat = textured()
    flat[:20] = flat[:20].mean()
    _, floor, wall = compared(textured(), test, index, noise=0.2)
    assert (floor.name, wall.name) == ("floor", "wall")
    assert floor.color_percent == pytest.approx(10.0 / 3.0, abs=1.0)
    assert floor.brightness_percent == pytest.approx(2.126, abs=1.0)
    by_name = {of.name: of for of in compared(textured(), flat, index, noise=0.2)}
    assert by_name["wall"].contrast_percent == pytest.approx(-40.0, abs=2.0)
    assert by_name["wall"].color_percent < 1.5
    assert by_name["wall"].highlight_percent == pytest.approx(-40.0, abs=8.0)
    assert abs(by_name["floor"].contrast_percent) < 2.0


def test_a_highlight_that_is_lost(index):
    shiny = textured()
    shiny[25:27, 30:36] = 8.0
    floor = next(of for of in compared(shiny, textured(), index, noise=0.2) if of.name == "floor")
    expected = 100.0 * (0.7 - (12 * 8.0 + 12 * 0.7) / 24) / shiny[20:].mean()  # 2 % of 1200 pixels are 24
    assert floor.highlight_percent == pytest.approx(expected, rel=0.1)


def test_dark_objects_do_not_divide_by_nothing(index):
    dark = textured()
    dark[20:] = 0.0
    slightly = dark.copy()
    slightly[20:] = 1e-5
    floor = next(of for of in compared(dark, slightly, index) if of.name == "floor")
    assert floor.color_percent < 1.0
