"""The analytic renderer's shading in closed form; its geometry is tested with the G-buffer."""

from __future__ import annotations

import math

import numpy as np
import pytest

from enfilade.arrays import Array3f
from enfilade.camera.pinhole import Camera, look_at
from enfilade.records import SurfaceClass
from enfilade.renderer import Purpose, RandomKey, Rays
from support.analytic import AnalyticRenderer
from support.analytic_scene import AnalyticScene, Checker, Material, Plane
from support.analytic_truth import ray_directions
from support.example_scenes import ball, slide

# A ray's direction, its products and quotients are each rounded to 24 bits: a handful of 6e-8.
ROUNDING = 1e-6


def one_ray(scene, origin, direction):
    return AnalyticRenderer(scene).surfaces(
        Rays(Array3f(*map(float, origin)), Array3f(*map(float, direction)))
    )


def traced(scene, camera):
    pixels = np.arange(camera.width * camera.height, dtype=np.uint32)
    return AnalyticRenderer(scene).trace(camera, pixels, RandomKey(7, 3, Purpose.FILL), spp=4)


@pytest.mark.parametrize(
    ("origin", "direction", "distance", "normal"),
    [
        ((0, 0, 5), (0, 0, -2), 2.0, (0, 0, 1)),  # in lengths of the direction
        ((0, 0, 0), (0, 0, -1), 1.0, (0, 0, 1)),  # from inside, the normal points inwards
        ((0, 0.5, 0), (0, 1, 0), 0.5, (0, -1, 0)),
    ],
)
def test_normals_are_on_the_side_of_the_ray(origin, direction, distance, normal):
    found = one_ray(ball(), origin, direction)
    assert found.distance[0] == pytest.approx(distance, rel=ROUNDING)
    np.testing.assert_allclose(np.array(found.normal).ravel(), normal, atol=ROUNDING)


def test_a_checkerboard_alternates():
    scene = AnalyticScene((Plane((0, 0, 0), (0, 0, 1), Material(Checker((1, 1, 1), (0, 0, 0), period=2.0))),))
    seen = [one_ray(scene, (x, 0.0, 1), (0, 0, -1)).albedo[0][0] for x in (0.1, 1.1, 2.1, -0.9)]
    assert seen[0] == seen[2] != seen[1] == seen[3]


def test_diffuse_light_is_the_closed_form():
    scene = AnalyticScene((Plane((0, 0, 0), (0, 0, 1), Material((0.5, 0.25, 1.0))),), to_light=(3, 0, 4))
    shading = traced(scene, slide(1, size=(3, 1)).cameras[0])
    expected = np.array([0.5, 0.25, 1.0]) * (0.2 + 0.8 * 4 / 5)
    np.testing.assert_allclose(shading.color, np.tile(expected, (3, 1)), rtol=ROUNDING)
    np.testing.assert_allclose(shading.variance, 0.0, atol=1e-6)  # what float32 leaves of E[x^2] - E[x]^2


def test_the_sky_is_a_gradient_of_direction():
    camera = Camera(look_at((0, 50, 0), (0, 50.1, -1)), 50.0, 9, 9)
    unit = ray_directions(camera) / np.linalg.norm(ray_directions(camera), axis=-1, keepdims=True)
    shading = traced(ball(horizon=(0, 0, 0), zenith=(1, 1, 1)), camera)
    np.testing.assert_allclose(shading.color[:, 0], (0.5 + 0.5 * unit[..., 1]).ravel(), rtol=1e-5)


def test_a_mirror_shows_the_reflected_sky_and_glass_what_is_behind():
    up = {"horizon": (0.0, 0.0, 0.0), "zenith": (1.0, 1.0, 1.0)}
    camera = Camera(look_at((0, 3, 3), (0, 0, 0)), 1.0, 1, 1)  # looks down at 45 degrees
    pane = {
        s: AnalyticScene((Plane((0, 0, 0), (0, 1, 0), Material((0.5, 0.5, 0.5), s)),), **up)
        for s in SurfaceClass
    }
    mirrored = traced(pane[SurfaceClass.MIRROR], camera).color[0, 0]
    through = traced(pane[SurfaceClass.TRANSPARENT], camera).color[0, 0]
    assert mirrored == pytest.approx(0.5 * (0.5 + 0.5 * math.sqrt(0.5)), rel=1e-4)
    assert through == pytest.approx(0.5 * (0.5 - 0.5 * math.sqrt(0.5)), rel=1e-4)


def test_only_specular_surfaces_depend_on_the_view():
    def colors(material):
        scene = AnalyticScene((Plane((0, 0, 0), (0, 0, 1), material),), to_light=(0, 0, 1))
        views = [Camera(look_at(eye, (0, 0, 0)), 1.0, 1, 1) for eye in ((0, 0, 4), (3, 0, 3))]
        return [traced(scene, view).color[0, 0] for view in views]

    straight, aslant = colors(Material((0.5, 0.5, 0.5)))
    assert straight == pytest.approx(aslant, rel=ROUNDING)
    straight, aslant = colors(Material((0.5, 0.5, 0.5), SurfaceClass.GLOSSY))
    assert straight > aslant + 0.1
