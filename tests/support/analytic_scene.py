"""Scenes of planes, parallelograms and spheres, for the analytic renderer, and their files."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from pathlib import Path

from enfilade.records import SurfaceClass

Vector = tuple[float, float, float]
BLACK: Vector = (0.0, 0.0, 0.0)
GREY: Vector = (0.5, 0.5, 0.5)


@dataclass(frozen=True)
class Checker:
    """A checkerboard in space: cubes of two colours, `period` being two cubes."""

    first: Vector
    second: Vector
    period: float = 1.0


@dataclass(frozen=True)
class Waves:
    """A smooth texture in space: the mean of sines along x, y and z of one period, between two colours."""

    first: Vector
    second: Vector
    period: float = 1.0


@dataclass(frozen=True)
class Material:
    """Reflectance and emission of a shape.

    Attributes
    ----------
    albedo
        Diffuse reflectance, 0..1; of a mirror or of glass, the tint of the mirrored or transmitted image.
    surface
        Diffuse and emissive materials look the same from everywhere. Glossy ones add a highlight, mirrors
        show one bounce, transparent ones transmit rays unbent.
    emission
        Radiance that leaves the surface in all directions.
    gloss, shininess
        Height and exponent of the highlight of a glossy material.
    """

    albedo: Vector | Checker | Waves = GREY
    surface: SurfaceClass = SurfaceClass.DIFFUSE
    emission: Vector = BLACK
    gloss: float = 0.5
    shininess: float = 20.0


@dataclass(frozen=True)
class Plane:
    """An infinite plane through a point."""

    point: Vector
    normal: Vector
    material: Material = Material()
    name: str = "plane"


@dataclass(frozen=True)
class Quad:
    """A parallelogram: a corner and two edges that leave it."""

    corner: Vector
    edge_u: Vector
    edge_v: Vector
    material: Material = Material()
    name: str = "quad"


@dataclass(frozen=True)
class Sphere:
    """A sphere, seen from outside and from inside."""

    centre: Vector
    radius: float
    material: Material = Material()
    name: str = "sphere"


@dataclass(frozen=True)
class AnalyticScene:
    """Shapes, a distant light without shadows, a sky, and noise of a known distribution.

    Attributes
    ----------
    shapes
        Shape n is the n-th of them, from 1.
    to_light : Vector
        Direction to the light; any length.
    light, ambient : Vector
        Radiance of a white diffuse surface that faces the light, and radiance added everywhere.
    horizon, zenith : Vector
        Radiance of the sky straight down and straight up (+y); between, linear in the height of the
        direction.
    noise : float
        Standard deviation of one path, relative to its radiance, 0..1: paths vary by 1 + noise (X - 1) with X
        distributed exponentially, which has mean 1 and is skewed as Monte Carlo noise is.
    nan_share : float
        Probability that a path's radiance is NaN, 0..1.
    """

    shapes: tuple[Plane | Quad | Sphere, ...]
    to_light: Vector = (0.4, 1.0, 0.6)
    light: Vector = (0.8, 0.8, 0.8)
    ambient: Vector = (0.2, 0.2, 0.2)
    horizon: Vector = BLACK
    zenith: Vector = BLACK
    noise: float = 0.0
    nan_share: float = 0.0


def write_scene(file: Path, scene: AnalyticScene) -> Path:
    """Write a scene for :func:`support.analytic.load`."""
    file.write_bytes(pickle.dumps(scene))
    return file


def read_scene(file: Path) -> AnalyticScene:
    """Read a scene of :func:`write_scene`."""
    scene: AnalyticScene = pickle.loads(file.read_bytes())  # noqa: S301  (written by the tests)
    return scene
