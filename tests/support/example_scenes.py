"""Analytic scenes and paths that many tests share. Import after tests/conftest.py has chosen the device."""

from __future__ import annotations

import math

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera, look_at
from enfilade.records import SurfaceClass
from support.analytic_scene import AnalyticScene, Checker, Material, Plane, Quad, Sphere, Waves

WHITE = (0.8, 0.8, 0.8)
RED = (0.7, 0.2, 0.15)


def wall(**more) -> AnalyticScene:
    """A textured plane z = 0, seen from z > 0; smooth, so that resampling hardly changes it."""
    material = Material(Waves((0.2, 0.3, 0.5), (0.9, 0.7, 0.4), period=1.3))
    return AnalyticScene((Plane((0, 0, 0), (0, 0, 1), material, "wall"),), **more)


def ball(**more) -> AnalyticScene:
    """A sphere of radius 1 at the origin before a sky."""
    sky = {"horizon": (0.3, 0.3, 0.3), "zenith": (0.2, 0.4, 0.9)}
    return AnalyticScene((Sphere((0, 0, 0), 1.0, Material(RED), "ball"),), **(sky | more))


def room(*, specular: bool = False, **more) -> AnalyticScene:
    """A room of 4 x 3 x 6, open towards +z, with a ball and a pillar in front of its back wall.

    With `specular`, the ball is a mirror, the floor glossy, and a pane of glass stands beside the pillar.
    """
    floor = Material(Checker(WHITE, (0.25, 0.3, 0.35), period=1.0))
    shiny = Material(floor.albedo, SurfaceClass.GLOSSY, gloss=0.4, shininess=30)
    paint = Material(Waves(RED, WHITE, period=2.2))
    plaster = Material(Waves((0.5, 0.6, 0.4), (0.9, 0.85, 0.7), period=1.7))
    chrome = Material((0.9, 0.9, 0.9), SurfaceClass.MIRROR)
    shapes = [
        Quad((-2, 0, -3), (0, 0, 6), (4, 0, 0), shiny if specular else floor, "floor"),
        Quad((-2, 3, -3), (4, 0, 0), (0, 0, 6), Material(WHITE), "ceiling"),
        Quad((-2, 0, -3), (4, 0, 0), (0, 3, 0), paint, "back"),
        Quad((-2, 0, -3), (0, 3, 0), (0, 0, 6), plaster, "left"),
        Quad((2, 0, -3), (0, 0, 6), (0, 3, 0), plaster, "right"),
        Sphere((0.5, 0.6, -0.5), 0.6, chrome if specular else Material(Checker(RED, WHITE, 0.5)), "ball"),
        Quad((-1.2, 0, -1.0), (0.4, 0, 0), (0, 3, 0), Material((0.3, 0.5, 0.7)), "pillar"),
        Quad((-0.4, 2.2, 0.0), (0.6, 0, 0), (0, 0, 0.6), Material(surface=SurfaceClass.EMISSIVE,
             albedo=(0, 0, 0), emission=(4.0, 3.6, 3.0)), "lamp"),
    ]  # fmt: skip
    if specular:
        glass = Material((0.9, 0.95, 0.9), SurfaceClass.TRANSPARENT)
        shapes.append(Quad((-0.7, 0, -0.8), (0.8, 0, 0), (0, 1.8, 0), glass, "glass"))
    return AnalyticScene(tuple(shapes), **more)


def room_walk(
    count: int = 24, *, size: tuple[int, int] = (96, 72), fps: float = 30.0, turn_deg: float = 25.0
) -> CameraPath:
    """A walk along the room's front from left to right, looking at the back wall."""
    cameras = []
    for i in range(count):
        at = i / max(count - 1, 1)
        x = -0.8 + 1.6 * at
        yaw = math.radians(turn_deg) * (at - 0.5)
        target = (x + math.sin(yaw), 1.4, 3.5 - math.cos(yaw))
        cameras.append(Camera(look_at((x, 1.5, 3.5), target), 50.0, *size))
    return CameraPath(tuple(cameras), tuple(range(1, count + 1)), fps)


def slide(count: int = 5, *, step: float = 0.1, size: tuple[int, int] = (64, 48)) -> CameraPath:
    """A camera that looks along -z from z = 4 and moves to the right by `step` a frame."""
    cameras = tuple(Camera(look_at((step * i, 0, 4), (step * i, 0, 0)), 45.0, *size) for i in range(count))
    return CameraPath(cameras, tuple(range(1, count + 1)), 30.0)
