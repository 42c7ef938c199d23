"""Spatial and temporal support of the filter: the numbers of §5.2."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.paper.support import PAPER_PIXELS_PER_DEGREE, spatial_support_px, temporal_limits
from enfilade.records import Geometry, SurfaceClass
from enfilade.settings import AntialiasSettings
from enfilade.viewing import Viewing

SETTINGS = AntialiasSettings(support_fast_px=9.0, support_beyond_px=11.0)
CAMERA = Camera(look_at((0, 0, 1), (0, 0, 0)), 50.0, 1, 1)


def support(speed_deg_s, settings=SETTINGS, density=PAPER_PIXELS_PER_DEGREE):
    return float(spatial_support_px(np.full((1, 1), speed_deg_s, np.float32), density, settings)[0, 0])


def limits(speed_deg_s, surface=SurfaceClass.DIFFUSE, settings=SETTINGS):
    """Frames to either side: the most, and the least before a slow trajectory may end."""
    zeros = np.zeros((1, 1, 3), np.float32)
    one = np.ones((1, 1))
    geometry = Geometry(
        CAMERA,
        one.astype(np.float32),
        zeros,
        zeros,
        one.astype(np.uint32),
        np.full((1, 1), surface, np.uint8),
    )
    got = temporal_limits(np.full((1, 1), speed_deg_s, np.float32), geometry, settings)
    return float(got.reach[0, 0]), float(got.least[0, 0])


@pytest.mark.parametrize(
    ("speed_deg_s", "pixels"), [(0, 3), (8, 6), (16, 9), (16.01, 11), (40, 11), (4, 4.5), (1e6, 11)]
)
def test_spatial_support(speed_deg_s, pixels):
    assert support(speed_deg_s) == pytest.approx(pixels, rel=1e-6)


@given(st.floats(0, 100), st.floats(0, 100))
def test_spatial_support_rises_with_velocity(a, b):
    slow, fast = sorted((a, b))
    assert 3.0 <= support(slow) <= support(fast) <= 11.0


def test_paths_over_the_pixel_need_no_more_at_any_velocity():
    assert [support(v, AntialiasSettings()) for v in (0, 8, 16, 40)] == [3.0] * 4


def test_spatial_support_follows_the_settings():
    settings = AntialiasSettings(
        support_still_px=1.0, support_fast_px=5.0, support_beyond_px=7.0, fast_deg_s=8.0
    )
    assert [support(v, settings) for v in (0, 4, 8, 9)] == [1.0, 3.0, 5.0, 7.0]


def test_blur_is_given_in_pixels_of_the_papers_display():
    assert Viewing(640, 480).pixels_per_degree == pytest.approx(PAPER_PIXELS_PER_DEGREE, abs=1e-3)
    finer = 2 * PAPER_PIXELS_PER_DEGREE
    assert [support(v, density=finer) for v in (0, 8, 16, 17)] == pytest.approx([3, 9, 15, 19])


def test_spatial_support_is_at_least_one_pixel():
    shrinking = AntialiasSettings(support_still_px=3.0, support_fast_px=1.0, support_beyond_px=1.0)
    assert support(16, shrinking, density=160.0) == 1.0
    assert support(99, shrinking, density=160.0) == 1.0


@pytest.mark.parametrize(
    ("speed_deg_s", "frames_each_side"),
    [(10.0, (5, 5)), (0.15, (5, 5)), (0.149, (7, 5)), (0.0, (7, 5))],
)
def test_temporal_support(speed_deg_s, frames_each_side):
    assert limits(speed_deg_s) == frames_each_side  # 11 frames, up to 15 below 0.15 deg/s


@pytest.mark.parametrize("surface", [SurfaceClass.GLOSSY, SurfaceClass.MIRROR, SurfaceClass.TRANSPARENT])
@pytest.mark.parametrize("speed_deg_s", [0.0, 0.1, 5.0])
def test_specular_surfaces_have_a_short_temporal_support(surface, speed_deg_s):
    assert limits(speed_deg_s, surface) == (1, 1)


@pytest.mark.parametrize("surface", [SurfaceClass.NONE, SurfaceClass.DIFFUSE, SurfaceClass.EMISSIVE])
def test_other_surfaces_have_the_full_temporal_support(surface):
    assert limits(5.0, surface) == (5, 5)


def test_temporal_support_follows_the_settings():
    settings = AntialiasSettings(frames=1, slow_frames=1, specular_frames=1)
    assert limits(5.0, settings=settings) == (0, 0)
    assert limits(0.0, settings=AntialiasSettings(frames=9, slow_frames=3)) == (
        4,
        4,
    )  # slow pixels never have less
    assert limits(5.0, SurfaceClass.MIRROR, AntialiasSettings(frames=3, specular_frames=9)) == (1, 1)
