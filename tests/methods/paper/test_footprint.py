"""Outlines, and two warps at a common footprint."""

import dataclasses

import numpy as np
import pytest

from enfilade.methods.paper.disparity import outline_pixels
from enfilade.methods.paper.footprint import shown_alike
from enfilade.methods.paper.warp import warp_keyframe
from enfilade.records import Halves
from enfilade.settings import WarpSettings
from support.analytic_scene import AnalyticScene, Material, Plane, Sphere
from support.analytic_truth import geometry_of, keyframe_of
from support.example_scenes import slide

TOLERANCE = WarpSettings().depth_tolerance
FLOOR = Plane((0, -1, 0), (0, 1, 0), Material())


def test_outlines_are_pixels_beside_another_surface():
    geometry = geometry_of(AnalyticScene((Sphere((0, 0, 0), 0.8, Material()),)), slide(1).cameras[0])
    inside = geometry.shape_index > 0
    is_outline = outline_pixels(geometry, TOLERANCE)
    assert not is_outline[24, 32]
    assert not is_outline[0, 0]
    left = int(np.flatnonzero(inside[24])[0])
    assert is_outline[24, left - 1 : left + 1].all()
    assert not is_outline[24, : left - 1].any()


def test_a_leaning_plane_has_no_outlines():
    geometry = geometry_of(AnalyticScene((FLOOR,)), slide(1).cameras[0])
    is_far = outline_pixels(geometry, TOLERANCE)
    horizon = int(np.flatnonzero(geometry.shape_index[:, 0])[0])
    assert not is_far[horizon + 3 :].any()


def warped(scene, eye_frame, target):
    path = slide(3, step=0.2)
    return warp_keyframe(keyframe_of(scene, path.cameras[eye_frame]), path.cameras[target], WarpSettings())


@pytest.fixture(scope="module")
def pair():
    scene = AnalyticScene((Plane((0, 0, 0), (0, 0, 1), Material()),))
    return warped(scene, 0, 1), warped(scene, 2, 1)


def colored(one, color):
    return dataclasses.replace(one, shading=Halves(color, color))


def test_pixels_that_are_not_compared_bring_no_difference(pair):
    rng = np.random.default_rng(1)
    is_compared = np.zeros((48, 64), bool)
    is_compared[10:40, 20:40] = True
    equal = rng.random((48, 64, 3), np.float32)
    images = [np.where(is_compared[..., None], equal, rng.random((48, 64, 3), np.float32)) for _ in range(2)]
    support = np.full((48, 64), 6.0, np.float32)
    shown = shown_alike(*map(colored, pair, images), is_compared, support)
    difference = np.abs(shown[0].color - shown[1].color)
    assert difference[is_compared].max() < 1e-6
    everywhere = shown_alike(*map(colored, pair, images), np.ones_like(is_compared), support)
    assert np.abs(everywhere[0].color - everywhere[1].color)[is_compared].max() > 0.01


def test_stretched_pixels_are_filtered_less(pair):
    impulse = np.zeros((48, 64, 3), np.float32)
    impulse[24, 32] = 1.0
    support = np.full((48, 64), 6.0, np.float32)
    peaks = []
    for magnification in (1.0, 2.0, 9.0):
        one = dataclasses.replace(
            colored(pair[0], impulse), footprint=np.full((48, 64), 0.25 * magnification, np.float32)
        )
        peaks.append(shown_alike(one, one, np.ones((48, 64), bool), support)[0].color[24, 32, 0])
    # Variance 1 of the filter and 1/3 of an interpolated pixel, less the footprint.
    assert peaks[0] == pytest.approx(1 / (2 * np.pi * (4 / 3 - 1 / 4)), rel=0.02)
    assert peaks[1] == pytest.approx(1 / (2 * np.pi * (4 / 3 - 1 / 2)), rel=0.02)
    assert peaks[2] == 1.0


def test_different_footprints_bring_no_difference_of_equal_colors(pair):
    is_compared = np.zeros((48, 64), bool)
    is_compared[10:40, 20:40] = True
    color = np.where(is_compared[..., None], np.float32(0.5), np.float32(0.05)) * np.ones(3, np.float32)
    sharp, stretched = (
        dataclasses.replace(colored(one, color), footprint=np.full((48, 64), footprint, np.float32))
        for one, footprint in zip(pair, (0.1, 0.75), strict=True)
    )
    shown = shown_alike(sharp, stretched, is_compared, np.full((48, 64), 3.0, np.float32))
    assert np.abs(shown[0].color - shown[1].color)[is_compared].max() < 1e-6
