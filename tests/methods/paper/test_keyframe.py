"""Keyframes: two independent, denoised halves, and their guides."""

import numpy as np
import pytest
import scipy.ndimage

from enfilade.methods.paper.keyframe import find_guides, trace_keyframe
from enfilade.renderer import PixelFilter, Purpose
from support.analytic import AnalyticRenderer
from support.analytic_scene import AnalyticScene, Checker, Material, Plane
from support.example_scenes import room, room_walk, slide
from support.in_memory import walk_of

SIZE = (48, 36)


@pytest.fixture(scope="module")
def walk():
    return walk_of(room_walk(3, size=SIZE), AnalyticRenderer(room(noise=1.0)), sampling={"spp": 16})


def test_the_halves_have_independent_errors_and_little_noise(walk):
    clean = walk_of(walk.path, AnalyticRenderer(room()))
    settings = {"spp": 256, "pixel_filter": PixelFilter.BOX}
    truth = clean.trace(1, Purpose.REFERENCE, **settings).color
    noisy = walk.trace(1, Purpose.FILL, spp=8, pixel_filter=PixelFilter.BOX).color
    got = trace_keyframe(walk, 1)
    errors = np.stack([half - truth for half in (got.first, got.second)])
    assert np.sqrt((errors**2).mean()) < 0.5 * np.sqrt(((noisy - truth) ** 2).mean())
    # The denoiser blurs both halves alike; errors by noise agree in sign as often as not.
    is_flat = np.abs(errors.mean(axis=0)) < 0.02
    agreement = np.corrcoef(*(error[is_flat] for error in errors))[0, 1]
    assert agreement < 0.5
    np.testing.assert_array_equal(got.color, (got.first + got.second) / 2)


def test_the_halves_have_guides_of_their_own():
    # Squares of a third of a pixel: their mean over a pixel is known as well as its rays tell.
    fine = Checker((0.8, 0.8, 0.8), (0.1, 0.1, 0.1), period=0.02)
    scene = AnalyticScene((Plane((0, 0, 0), (0.2, 0.1, 1), Material(fine)),), noise=0.5)
    walk = walk_of(slide(2), AnalyticRenderer(scene), sampling={"spp": 64})
    first, second = (trace_keyframe(walk, frame) for frame in (0, 1))
    differences = [
        (a - b - scipy.ndimage.uniform_filter(a - b, (9, 9, 0)))[8:-8, 8:-8].ravel()
        for a, b in ((first.first, second.first), (first.second, second.second))
    ]
    assert abs(np.corrcoef(*differences)[0, 1]) < 0.1


def test_guides_are_means_over_the_pixels(walk):
    albedo, normal = find_guides(walk, 1, Purpose.GUIDE, spp=4)
    geometry = walk.view(1).geometry
    assert np.median(np.abs(albedo - geometry.albedo)) < 0.02
    assert np.linalg.norm(normal, axis=2).max() < 1.0 + 1e-5
    centre_values = np.unique(geometry.albedo[geometry.shape_index == 1].round(3), axis=0)
    mean_values = np.unique(albedo[geometry.shape_index == 1].round(3), axis=0)
    assert len(centre_values) == 2  # the squares of the floor
    assert len(mean_values) > 10  # mixed at their borders
