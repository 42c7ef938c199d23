"""Pieces that scenes share: flat sheets, poses and pictures."""

from __future__ import annotations

import numpy as np

from studies.scenes import joinery
from studies.scenes.solids import Floats, Mesh, surface
from studies.scenes.sweeps import frame
from studies.scenes.writer import SceneWriter


def flat(width: float, height: float, uv: tuple[float, float] = (1.0, 1.0)) -> Mesh:
    """Return a rectangle face up in the xy plane, textured `uv` times, upright in its own frame."""
    mesh = surface(lambda u, v: (width * (u - 0.5), height * (v - 0.5), 0.0 * u), 1, 1)
    return mesh.tiled(*uv)


def pose(x: float, y: float, turn: float) -> Floats:
    """Return a (4, 4) matrix that turns about z and moves on the floor."""
    matrix = np.eye(4)
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    matrix[:2, :2] = [[c, -s], [s, c]]
    matrix[:2, 3] = x, y
    return matrix


def hang_picture(
    writer: SceneWriter,
    name: str,
    painting: str,
    size: tuple[float, float],
    where: tuple[float, float, float],
    on_wall: float,
) -> None:
    """Hang a framed and mounted painting, centred on a point of a wall."""
    width, height = size
    gilt = frame(width + 0.1, height + 0.1, joinery.GILT)
    writer.mesh(f"{name}-frame", joinery.hung(gilt, *where, on_wall), "gilt")
    canvas = flat(width, height).at(0, 0, 0.006)
    writer.mesh(name, joinery.hung(canvas, *where, on_wall), painting)
