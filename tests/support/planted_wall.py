"""A noisy wall that changes half way along a walk: known reasons to split a segment."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera
from enfilade.records import Shading, SurfaceClass
from enfilade.renderer import Rays, SceneDescription, Surfaces
from support.analytic import AnalyticRenderer
from support.analytic_scene import AnalyticScene, Checker, Material, Plane, Quad
from support.example_scenes import slide

CHANGES = ("none", "shadow", "highlight", "texture")
FRAMES, MIDDLE_X, SIZE = 9, 0.4, (128, 96)
PLASTER = Material((0.6, 0.6, 0.6))


class PlantedWall:
    """A diffuse wall. Cameras beyond the middle of the path see the change.

    Parameters
    ----------
    change
        Of `CHANGES`: a square without half of the light, a highlight, or squares of another colour. G-buffers
        know of the last alone.
    noise
        Standard deviation of a path, relative to its radiance.
    """

    def __init__(self, change: str, noise: float) -> None:
        plain = _wall(PLASTER)
        square = Quad((-0.4, -0.9, 0.001), (1.6, 0, 0), (0, 1.8, 0), _darker(0.5))
        light = {
            "none": plain,
            "shadow": replace(plain, shapes=(*plain.shapes, square)),
            "highlight": _wall(Material(PLASTER.albedo, SurfaceClass.GLOSSY, gloss=0.6, shininess=60)),
            "texture": _wall(Material(Checker((0.66, 0.66, 0.66), (0.54, 0.54, 0.54), 0.7))),
        }[change]
        seen = light if change == "texture" else plain
        self._light = [AnalyticRenderer(replace(s, noise=noise)) for s in (plain, light)]
        self._seen = [AnalyticRenderer(s) for s in (plain, seen)]

    def describe(self) -> SceneDescription:
        return self._seen[0].describe()

    def surfaces(self, rays: Rays) -> Surfaces:
        return self._seen[_is_beyond(rays.origin.x[0])].surfaces(rays)

    def trace(self, camera: Camera, *pixels_and_random: Any, **terms: Any) -> Shading:
        by_side = self._light[_is_beyond(camera.eye[0])]
        return by_side.trace(camera, *pixels_and_random, **terms)


def planted_path() -> CameraPath:
    """A camera that slides along the wall."""
    return slide(FRAMES, step=2.0 * MIDDLE_X / (FRAMES - 1), size=SIZE)


def _is_beyond(x: Any) -> bool:
    return float(x) > MIDDLE_X + 1e-3


def _wall(material: Material) -> AnalyticScene:
    return AnalyticScene((Plane((0, 0, 0), (0, 0, 1), material, "wall"),), to_light=(0.2, 0.2, 1.0))


def _darker(share: float) -> Material:
    return Material(tuple(share * value for value in PLASTER.albedo))
