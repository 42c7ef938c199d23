"""Pixels to degrees (§6), and what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest

from enfilade.errors import InputError
from enfilade.viewing import DISPLAYS, Viewing, display_named


def test_paper_conditions():
    # §6: half a metre from a 640x480 image of 0.25 m diagonal.
    viewing = Viewing(640, 480)
    assert viewing.pixels_per_degree == pytest.approx(27.93, abs=0.005)
    assert viewing.velocity_deg_s(0.14) == pytest.approx(0.15, abs=0.001)


def test_five_degrees_are_4_5_centimetres():
    # §6, footnote 2: 5.2 degrees at half a metre are a region of 4.5 cm.
    viewing = Viewing(640, 480)
    assert 5.2 * viewing.pixels_per_degree * viewing.pixel_pitch_m == pytest.approx(0.045, abs=5e-4)


def test_maps_of_flow_convert_whole():
    viewing = Viewing(640, 480)
    flow = np.array([[[1.0, -2.0]]], dtype=np.float32)
    velocity = viewing.velocity_deg_s(flow)
    assert velocity.dtype == np.float32
    np.testing.assert_allclose(velocity, flow * 30 / viewing.pixels_per_degree, rtol=1e-6)


def test_crop_keeps_the_pixels():
    viewing = Viewing(1920, 1080, diagonal_m=0.6, fps=24.0)
    crop = viewing.cropped(64, 48)
    assert (crop.width_px, crop.height_px, crop.fps) == (64, 48, 24.0)
    assert crop.pixels_per_degree == pytest.approx(viewing.pixels_per_degree)


@pytest.mark.parametrize(
    ("field", "number"),
    [
        ("width_px", 0),
        ("height_px", -3),
        ("width_px", 64.5),
        ("diagonal_m", 0.0),
        ("distance_m", math.nan),
        ("fps", math.inf),
        ("peak_cd_m2", -1.0),
        ("black_cd_m2", -0.1),
        ("black_cd_m2", 100.0),
        ("black_cd_m2", math.nan),
    ],
)
def test_out_of_range_is_refused_by_name(field, number):
    numbers = {"width_px": 640, "height_px": 480, field: number}
    with pytest.raises(InputError, match=field):
        Viewing(**numbers)


def test_distances_in_centimetres_are_refused():
    with pytest.raises(InputError, match=r"distance_m = 60 .* 9228 pixels in a degree.*metres"):
        Viewing(1920, 1080, distance_m=60.0)


@pytest.mark.parametrize("name", DISPLAYS)
def test_displays_show_pixel_for_pixel(name):
    whole = replace(display_named(name), fps=60.0)
    part = whole.cropped(100, 50)
    assert part.pixels_per_degree == pytest.approx(whole.pixels_per_degree)
    assert (part.width_px, part.height_px, part.fps) == (100, 50, 60.0)
    assert 25.0 < whole.pixels_per_degree < 120.0  # from the paper's screen to a phone held close
    assert whole.black_cd_m2 < whole.peak_cd_m2 / 400


def test_displays_by_name():
    # A tube: its pixels flash.
    assert display_named("paper") == Viewing(640, 480, persistence=0.05)
    with pytest.raises(InputError, match=r"unknown display 'tv'; known are: paper, .*tv-55-4k"):
        display_named("tv")
