# SPDX-License-Identifier: GPL-3.0-or-later
"""Both sides of meshes: which are seen, and which emit light that reaches anything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from enfilade_blender.ply import Mesh
from enfilade_blender.records import Placed, View

SAMPLED_EYES = 16  # of which backs are looked for
BACK_OFFSET = 4e-5  # of a vertex' largest coordinate plus 1: rays begin at 9e-5, which pass the other side


class Sides:
    """Finds the sides of meshes in a scene.

    Parameters
    ----------
    views : list of View
        From which they are seen.
    placed : list of Placed
        All objects.
    """

    def __init__(self, views: Sequence[View], placed: Sequence[Placed]) -> None:
        self._eyes = np.array([view.pose[:3, 3] for view in views]).reshape(-1, 3)
        self._middles = np.concatenate([np.zeros((0, 3)), *map(_middles, placed)])
        self._owners = np.repeat([id(item) for item in placed], [len(item.matrices) for item in placed])

    def hides_its_back(self, mesh: Mesh, placed: Placed) -> bool:
        """Whether an emitter is closed, faces outward, and has neither a camera nor an object inside."""
        if not mesh.is_closed() or mesh.volume() <= 0.0:
            return False
        points = np.concatenate([self._eyes, self._middles[self._owners != id(placed)]])
        for matrix in placed.matrices:
            copy = mesh.transformed(matrix).positions
            if ((points > copy.min(axis=0)) & (points < copy.max(axis=0))).all(axis=1).any():
                return False
        return True

    def shows_its_back(self, mesh: Mesh, placed: Placed) -> bool:
        """Whether a mesh is open, and has triangles that face away from a camera."""
        if placed.mesh.is_closed():
            return False
        eyes = self._eyes[:: max(len(self._eyes) // SAMPLED_EYES, 1)]
        for matrix in placed.matrices:
            copy = mesh.transformed(matrix)
            corners = copy.positions[copy.triangles]
            fronts = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            if any((np.einsum("ij,ij->i", fronts, eye - corners[:, 0]) < 0.0).any() for eye in eyes):
                return True
        return False


def back_of(mesh: Mesh) -> Mesh:
    """The other side of an emitter, a little behind it."""
    back = mesh.reversed()
    corners = back.positions[back.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    offsets = np.zeros_like(back.positions)
    for corner in range(3):
        np.add.at(offsets, back.triangles[:, corner], normals)
    offsets /= np.maximum(np.linalg.norm(offsets, axis=1, keepdims=True), 1e-30)
    offsets *= BACK_OFFSET * (1.0 + np.abs(back.positions).max(axis=1, keepdims=True))
    return replace(back, positions=back.positions + offsets, normals=-back.normals)


def _middles(placed: Placed) -> np.ndarray:
    """Middles of the boxes of an object's copies, (N, 3)."""
    positions = placed.mesh.positions
    middle = 0.5 * (positions.min(axis=0) + positions.max(axis=0))
    return np.array([matrix[:3, :3] @ middle + matrix[:3, 3] for matrix in placed.matrices]).reshape(-1, 3)
