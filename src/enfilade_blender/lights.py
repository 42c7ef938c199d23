# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's lights as emitters of Mitsuba.

Cycles' lamps do not block light, and the camera sees those only that are made visible to it. enfilade's
camera does not see emitters whose BSDF has the id of lamps, either; shadow rays pass them, those to suns,
spots and points with volumetric path tracers alone. Visible ones are black surfaces that emit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from enfilade_blender.materials.mapping import spot_ramp
from enfilade_blender.notes import Notes
from enfilade_blender.records import Lamp
from enfilade_blender.scene_xml import LAMP, Element, Identifiers, plugin, reference

Colour = tuple[float, float, float]
FORWARD = np.diag([1.0, -1.0, -1.0, 1.0])  # Blender's lights shine along -z, Mitsuba's shapes along +z
TINY = 1e-5
LEAST_AREA = 1e-12  # of a lamp, square scene units
BLACK = (0.0, 0.0, 0.0)
SIZES = ("shadow_soft_size", "size", "size_y", "angle", "spot_size", "spot_blend")  # of lamps
DELTA = ("point", "spot", "directional")  # emitters that shadow rays alone reach


@dataclass(frozen=True)
class Sun:
    """A sun that is a disc of the environment.

    Attributes
    ----------
    name : str
    direction : (3,) float64
        Towards the sun.
    irradiance : tuple
        On a surface that faces it.
    angle : float
        Diameter, radians.
    """

    name: str
    direction: np.ndarray
    irradiance: Colour
    angle: float


def point_intensity(power: float) -> float:
    """Radiant intensity of a point or spot light of a power in Blender's watts."""
    return power / (4.0 * math.pi)


def sphere_radiance(power: float, radius: float) -> float:
    """Radiance of a point light with a radius."""
    return power / (4.0 * math.pi**2 * radius**2)


def area_radiance(power: float, area: float) -> float:
    """Radiance of an area light, Lambertian."""
    return power / (math.pi * area)


def lamp_colour(lamp: Lamp) -> Colour:
    """Colour times power (or strength), with temperature, exposure and the factor of nodes.

    A sun whose scale leaves it no direction is dark, as in Cycles.
    """
    data = lamp.data
    if data.type == "SUN" and not lamp.matrix[:3, 2].any():
        return 0.0, 0.0, 0.0
    scale = data.energy * 2.0 ** getattr(data, "exposure", 0.0) * _unnormalized(data)
    tint = data.temperature_color if getattr(data, "use_temperature", False) else (1.0, 1.0, 1.0)
    r, g, b = (float(c) * float(t) * n * scale for c, t, n in zip(data.color, tint, lamp.factor, strict=True))
    return r, g, b


def _unnormalized(data: Any) -> float:
    """What Cycles multiplies the power of a lamp by that is not normalized; an area's has its own factor."""
    if getattr(data, "normalize", True) or data.type == "AREA":
        return 1.0
    if data.type == "SUN":
        return math.pi * math.sin(0.5 * data.angle) ** 2 if data.angle > 0.0 else 1.0
    radius = float(data.shadow_soft_size)
    return 4.0 * math.pi * radius**2 if radius > 0.0 else 4.0


def is_portal(lamp: Lamp) -> bool:
    """Whether a lamp emits nothing: it tells Cycles where the world's light comes in."""
    return lamp.data.type == "AREA" and bool(lamp.data.cycles.is_portal)


def is_finite(lamp: Lamp, notes: Notes) -> bool:
    """Whether a lamp has numbers that 32 bits hold; that it is left out otherwise is noted."""
    numbers = [*lamp_colour(lamp), *(getattr(lamp.data, name, 0.0) for name in SIZES)]
    if np.all(np.abs(numbers) <= np.finfo(np.float32).max):
        return True
    what, effect = "a lamp whose light or size is NaN or infinite is left out", "it gives no light"
    notes.add("not-carried", lamp.name, "Light", what, effect)
    return False


def split_suns(lamps: list[Lamp], notes: Notes) -> tuple[list[Lamp], Sun | None]:
    """Lamps that are emitters of their own, and the brightest sun that has a disc."""
    soft = [
        lamp
        for lamp in lamps
        if lamp.data.type == "SUN" and lamp.data.angle > TINY and max(lamp_colour(lamp)) > 0
    ]
    if not soft:
        return lamps, None
    brightest = max(soft, key=lambda lamp: sum(lamp_colour(lamp)))
    for lamp in soft:
        if lamp is not brightest:
            what, effect = "a sun beside a brighter one has no disc", "its shadows have sharp edges"
            notes.add("approximated", lamp.name, "Angle", what, effect)
    _note_unusual(brightest, notes)
    direction, irradiance = _axis(brightest.matrix), _positive(brightest, notes)
    sun = Sun(brightest.name, direction, irradiance, float(brightest.data.angle))
    return [lamp for lamp in lamps if lamp is not brightest], sun


def note_glass(lamps: list[Lamp], notes: Notes) -> None:
    """Note lamps whose size is left out: shadow rays alone reach them, and glass stops these."""
    for lamp in lamps:
        size = {"SPOT": "shadow_soft_size", "SUN": "angle"}.get(lamp.data.type, "")
        if getattr(lamp.data, size, 0.0) > TINY and max(lamp_colour(lamp)) > 0.0:
            what, effect = "its light does not pass glass", "surfaces behind glass are darker"
            notes.add("approximated", lamp.name, "Glass", what, effect)


def needs_passing(made: list[Element], sun: Sun | None) -> bool:
    """Whether the shapes of lamps may be in the way of light that only shadow rays find."""
    has_shapes = any(element.tag == "shape" for element in made)
    return has_shapes and (sun is not None or any(element.get("type") in DELTA for element in made))


def emitters(lamp: Lamp, identifiers: Identifiers, notes: Notes) -> list[Element]:
    """Elements of one lamp; none for one that is dark, or takes light away."""
    data, colour = lamp.data, _positive(lamp, notes)
    if max(colour) <= 0.0:
        return []
    _note_unusual(lamp, notes)
    if data.type == "SUN":
        sun = plugin("emitter", "directional", irradiance=colour)
        sun.append(_vector("direction", -_axis(lamp.matrix)))
        return [sun]
    if data.type == "AREA":
        return _area(lamp, colour, identifiers, notes)
    if data.type == "SPOT":
        return [_spot(lamp, colour, notes)]
    radius = float(data.shadow_soft_size)
    place = lamp.matrix[:3, 3]
    if radius <= TINY:
        emitter = plugin("emitter", "point", intensity=_scaled(colour, point_intensity(1.0)))
        emitter.append(_vector("position", place, tag="point"))
        return [emitter]
    light = plugin("emitter", "area", radiance=_scaled(colour, sphere_radiance(1.0, radius)))
    shape = plugin("shape", "sphere", light, _surface(lamp), radius=radius)
    shape.append(_vector("center", place, tag="point"))
    shape.set("id", identifiers.unique(lamp.name))
    return [shape]


def _positive(lamp: Lamp, notes: Notes) -> Colour:
    """The colour of a lamp; negative light is left out, with a note."""
    r, g, b = lamp_colour(lamp)
    if min(r, g, b) < 0.0:
        what, effect = "its negative light is left out", "surfaces are brighter: Blender takes light away"
        notes.add("not-carried", lamp.name, "Power", what, effect)
    return max(r, 0.0), max(g, 0.0), max(b, 0.0)


def _area(lamp: Lamp, colour: Colour, identifiers: Identifiers, notes: Notes) -> list[Element]:
    data = lamp.data
    is_round = data.shape in ("DISK", "ELLIPSE")
    width, height = _area_size(data)
    axes = lamp.matrix @ np.diag([0.5 * width, 0.5 * height, 1.0, 1.0])
    area = float(np.linalg.norm(np.cross(axes[:3, 0], axes[:3, 1]))) * (math.pi if is_round else 4.0)
    if area < LEAST_AREA:
        what, effect = "a lamp without area is left out", "it gives no light"
        notes.add("not-carried", lamp.name, "Size", what, effect)
        return []
    radiance = _scaled(colour, area_radiance(1.0, area))
    if not getattr(data, "normalize", True):
        radiance = _scaled(radiance, area)
    matrix = axes @ FORWARD
    matrix[:3, 2] /= max(np.linalg.norm(matrix[:3, 2]), 1e-12)
    light = plugin("emitter", "area", radiance=radiance)
    shape = plugin("shape", "disk" if is_round else "rectangle", light, _surface(lamp), to_world=matrix)
    shape.set("id", identifiers.unique(lamp.name))
    return [shape]


def _surface(lamp: Lamp) -> Element:
    """The BSDF of a lamp's shape."""
    return plugin("bsdf", "diffuse", reflectance=BLACK) if lamp.is_visible else reference(LAMP)


def _area_size(data: Any) -> tuple[float, float]:
    width = float(data.size)
    return width, width if data.shape in ("SQUARE", "DISK") else float(data.size_y)


def _spot(lamp: Lamp, colour: Colour, notes: Notes) -> Element:
    data = lamp.data
    outer, inner = spot_ramp(0.5 * float(data.spot_size), float(data.spot_blend))
    if data.shadow_soft_size > TINY:
        what, effect = f"its radius of {data.shadow_soft_size:.3g} is left out", "shadows have sharp edges"
        notes.add("approximated", lamp.name, "Radius", what, effect)
    return plugin(
        "emitter", "spot", intensity=_scaled(colour, point_intensity(1.0)), to_world=lamp.matrix @ FORWARD,
        cutoff_angle=math.degrees(outer), beam_width=math.degrees(inner),
    )  # fmt: skip


def _note_unusual(lamp: Lamp, notes: Notes) -> None:
    data = lamp.data
    if lamp.is_visible and (data.type == "AREA" or (data.type == "POINT" and data.shadow_soft_size > TINY)):
        what, effect = "a lamp that the camera sees is an emitting surface", "it casts shadows"
        notes.add("approximated", lamp.name, "Ray visibility", what, effect)
    elif lamp.is_visible and data.type == "SPOT":
        notes.add("not-carried", lamp.name, "Ray visibility", "it has no shape", "the camera does not see it")
    if data.type == "AREA" and getattr(data, "spread", math.pi) < math.pi - 1e-3:
        what, effect = "its spread is left out", "light reaches all directions"
        notes.add("not-carried", lamp.name, "Spread", what, effect)
    if not data.use_shadow:
        notes.add(
            "not-carried", lamp.name, "Shadow", "it casts shadows", "shadows are where Blender has none"
        )


def _axis(matrix: np.ndarray) -> np.ndarray:
    axis: np.ndarray = matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
    return axis


def _scaled(colour: Colour, scale: float) -> Colour:
    return colour[0] * scale, colour[1] * scale, colour[2] * scale


def _vector(name: str, values: np.ndarray, tag: str = "vector") -> Element:
    x, y, z = (f"{value:.9g}" for value in values)
    return Element(tag, name=name, x=x, y=y, z=z)
