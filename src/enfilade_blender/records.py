# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of what is exported: the selection of a file, views, and the evaluated scene."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from enfilade_blender.ply import Mesh


@dataclass(frozen=True)
class Selection:
    """What a job exports.

    Attributes
    ----------
    scene : bpy.types.Scene
    view_layer : bpy.types.ViewLayer
    frames : tuple of int
        First and last.
    size : tuple of int
        Width and height, pixels.
    """

    scene: Any
    view_layer: Any
    frames: tuple[int, int]
    size: tuple[int, int]

    @property
    def world(self) -> Any:
        """World of the scene; None where the view layer leaves it out, as Cycles does then."""
        return self.scene.world if self.view_layer.use_sky else None

    @property
    def colour_management(self) -> tuple[Any, Any]:
        """Settings of the view, and of the display: those of the output where it overrides the scene's."""
        output = self.scene.render.image_settings
        owner = output if output.color_management == "OVERRIDE" else self.scene
        return owner.view_settings, owner.display_settings

    def objects(self) -> list[Any]:
        """Objects whose collections renders show, those of background scenes included."""
        layers, scene = [self.view_layer], self.scene.background_set
        while scene is not None:
            layers.append(scene.view_layers[0])
            scene = scene.background_set
        return list(dict.fromkeys(obj for layer in layers for obj in _shown(layer.layer_collection)))


def _shown(layer: Any, *, is_hidden: bool = False) -> list[Any]:
    is_hidden |= layer.collection.hide_render
    own = [] if is_hidden or layer.exclude else layer.collection.objects
    return [*own, *(obj for child in layer.children for obj in _shown(child, is_hidden=is_hidden))]


def rendered_particles(obj: Any) -> list[Any]:
    """Particle systems of an object that renders show."""
    shown = [m for m in getattr(obj, "modifiers", ()) if m.type == "PARTICLE_SYSTEM" and m.show_render]
    return [modifier.particle_system for modifier in shown]


@dataclass(frozen=True, eq=False)
class View:
    """A camera at a frame.

    Attributes
    ----------
    name : str
    pose : (4, 4) float64
        Rigid, from camera to world.
    projection : (4, 4) float64
        OpenGL's.
    lens : dict
        Optional keys of the file.
    """

    name: str
    pose: np.ndarray
    projection: np.ndarray
    lens: dict[str, Any]

    @property
    def fov_deg(self) -> float:
        """Vertical field of view."""
        return math.degrees(2.0 * math.atan(1.0 / self.projection[1, 1]))

    def pixels(self, points: np.ndarray, size: tuple[int, int]) -> np.ndarray:
        """Pixel coordinates and depth of points (N, 3) of the world, (N, 3)."""
        local = (points - self.pose[:3, 3]) @ self.pose[:3, :3]
        depth = np.maximum(-local[:, 2], 1e-6)
        x = (self.projection[0, 0] * local[:, 0] / depth - self.projection[0, 2] + 1.0) * 0.5 * size[0]
        y = (1.0 - self.projection[1, 1] * local[:, 1] / depth + self.projection[1, 2]) * 0.5 * size[1]
        return np.stack([x, y, -local[:, 2]], axis=-1)


@dataclass(eq=False)
class Placed:
    """An object's mesh with the matrices of its copies.

    Attributes
    ----------
    name : str
        Of the object; of an instance, with that of its instancer.
    mesh
        Linked duplicates have the same.
    slots : tuple
        Materials (bpy) or None.
    matrices : list of (4, 4) float64
    colour : tuple of float
        RGBA of the object's viewport display, which materials may read.
    index : int
        Pass index of the object.
    names : tuple of str
        Of the copies; empty: all have the object's.
    is_seen : bool
        Whether Blender's camera sees it.
    has_shadow : bool
        Whether it casts shadows in Blender.
    """

    name: str
    mesh: Mesh
    slots: tuple[Any, ...]
    matrices: list[np.ndarray] = field(default_factory=list)
    colour: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)
    index: int = 0
    names: tuple[str, ...] = ()
    is_seen: bool = True
    has_shadow: bool = True


@dataclass(eq=False)
class Lamp:
    """A light of the scene: its data, its matrix (4, 4) float64, and the factor (RGB) of its nodes.

    `is_visible` says whether the camera sees its shape.
    """

    name: str
    data: Any
    matrix: np.ndarray
    factor: tuple[float, float, float] = (1.0, 1.0, 1.0)
    is_visible: bool = False


@dataclass(eq=False)
class Evaluated:
    """Objects and lights of a scene at one frame."""

    placed: list[Placed] = field(default_factory=list)
    lamps: list[Lamp] = field(default_factory=list)
    instances: int = 0
