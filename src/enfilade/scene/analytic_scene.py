"""Scenes of planes, parallelograms and spheres: what the ``analytic`` backend renders, and its JSON files.

A file ``NAME.analytic.json`` holds the fields of :class:`AnalyticScene` under their own names; shapes and
textures say what they are by ``kind``.
"""

from __future__ import annotations

import dataclasses
import json
import math
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

from enfilade.errors import SceneError
from enfilade.records import SurfaceClass

NAME = "analytic 1"  # of the renderer
SUFFIX = ".analytic.json"

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
    """What a shape does to light.

    Attributes
    ----------
    albedo
        Diffuse reflectance, 0..1; of a mirror or of glass, the tint of what is seen in it or through it.
    surface
        Diffuse and emissive materials look the same from everywhere. Glossy ones add a highlight, mirrors
        show one bounce, transparent ones what is straight behind.
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

    def __post_init__(self) -> None:
        _require(math.hypot(*self.normal) > 0.0, f"the normal of {self.name} is zero")


@dataclass(frozen=True)
class Quad:
    """A parallelogram: a corner and two edges that leave it."""

    corner: Vector
    edge_u: Vector
    edge_v: Vector
    material: Material = Material()
    name: str = "quad"

    def __post_init__(self) -> None:
        (a, b, c), (x, y, z) = self.edge_u, self.edge_v
        area = math.hypot(b * z - c * y, c * x - a * z, a * y - b * x)
        _require(area > 0.0, f"the edges of {self.name} are parallel")


@dataclass(frozen=True)
class Sphere:
    """A sphere, seen from outside and from inside."""

    centre: Vector
    radius: float
    material: Material = Material()
    name: str = "sphere"

    def __post_init__(self) -> None:
        _require(self.radius > 0.0, f"the radius of {self.name} must be above 0")


@dataclass(frozen=True)
class AnalyticScene:
    """Shapes, a light infinitely far away, a sky, and made-up noise.

    Attributes
    ----------
    shapes
        Shape n is the n-th of them, from 1.
    to_light : Vector
        Direction to the light; any length.
    light, ambient : Vector
        Radiance of a white diffuse surface that faces the light, and what is added everywhere. No shadows.
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

    def __post_init__(self) -> None:
        _require(math.hypot(*self.to_light) > 0.0, "to_light is zero")
        _require(0.0 <= self.noise <= 1.0, f"noise is {self.noise}; it must be 0 to 1")
        _require(0.0 <= self.nan_share <= 1.0, f"nan_share is {self.nan_share}; it must be 0 to 1")


KINDS: dict[str, Any] = {
    "plane": Plane,
    "quad": Quad,
    "sphere": Sphere,
    "checker": Checker,
    "waves": Waves,
}


def read_scene(file: Path) -> AnalyticScene:
    """Read a scene from JSON.

    Raises
    ------
    SceneError
        The file can't be read, is no JSON, or a field is unknown, missing or malformed.
    """
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise SceneError(f"can't read the scene {file}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise SceneError(f"the scene {file} is not valid JSON: {error}") from error
    try:
        scene: AnalyticScene = _build(AnalyticScene, content, "the scene")
    except SceneError as error:
        raise SceneError(f"{file}: {error}") from error
    return scene


def scene_text(scene: AnalyticScene) -> str:
    """JSON of a scene, as :func:`read_scene` reads it; the same scene has the same letters."""
    return json.dumps(_plain(scene), indent=1) + "\n"


def _plain(value: Any) -> Any:
    if isinstance(value, SurfaceClass):
        return value.name.lower()
    if is_dataclass(value):
        plain = {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
        kind = next((name for name, cls in KINDS.items() if cls is type(value)), None)
        return plain if kind is None else {"kind": kind} | plain
    if isinstance(value, tuple):
        return [_plain(v) for v in value]
    return value if isinstance(value, str) else float(value)


def _build(cls: Any, table: Any, where: str) -> Any:
    _require(isinstance(table, dict), f"{where} must be an object {{...}}")
    known = {f.name: f for f in fields(cls)}
    given = {key: value for key, value in table.items() if key != "kind"}
    for key in given:
        _require(key in known, f"unknown field {key!r} of {where}; known are: {', '.join(known)}")
    for key, f in known.items():
        is_needed = f.default is dataclasses.MISSING
        _require(key in given or not is_needed, f"{key} of {where} is missing")
    return cls(**{key: _value(key, value, f"{key} of {where}") for key, value in given.items()})


def _value(key: str, value: Any, where: str) -> Any:
    if key == "shapes":
        _require(isinstance(value, list) and len(value) > 0, f"{where} must be a list of shapes")
        return tuple(_kind(v, f"shape {i}", "plane", "quad", "sphere") for i, v in enumerate(value, 1))
    if key == "material":
        return _build(Material, value, where)
    if key == "surface":
        names = [c.name.lower() for c in SurfaceClass if c]
        _require(value in names, f"{where} is {value!r}; choose one of {', '.join(names)}")
        return SurfaceClass[value.upper()]
    if key == "name":
        _require(isinstance(value, str), f"{where} must be text")
        return value
    if isinstance(value, dict):
        return _kind(value, where, "checker", "waves")
    if key in {"radius", "period", "gloss", "shininess", "noise", "nan_share"}:
        return _number(value, where)
    _require(isinstance(value, list) and len(value) == 3, f"{where} must be a list of 3 numbers")
    return tuple(_number(v, where) for v in value)


def _kind(value: Any, where: str, *choices: str) -> Any:
    kind = value.get("kind") if isinstance(value, dict) else None
    _require(kind in choices, f"{where} has kind {kind!r}; choose one of {', '.join(choices)}")
    return _build(KINDS[str(kind)], value, f"{where} ({kind})")


def _number(value: Any, where: str) -> float:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    _require(is_number and abs(value) < 1e15, f"{where} must hold finite numbers, not {value!r}")
    return float(value)


def _require(holds: bool, problem: str) -> None:
    if not holds:
        raise SceneError(problem)
