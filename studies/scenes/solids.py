"""Solid shapes as triangle meshes: blocks, turned and extruded pieces, parametric surfaces.

All lengths are metres, the z axis points up, and faces wind counter-clockwise seen from outside.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import numpy.typing as npt
import shapely
import trimesh

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Vector = tuple[float, float, float]
Point2 = tuple[float, float]


@dataclass(frozen=True)
class Mesh:
    """Triangles that share vertices.

    Attributes
    ----------
    positions
        (n, 3), metres.
    faces
        (m, 3), indices of vertices.
    uvs
        (n, 2) texture coordinates, or None where the surface bears no texture.
    """

    positions: Floats
    faces: Ints
    uvs: Floats | None = None

    def at(self, x: float, y: float, z: float = 0.0) -> Mesh:
        """Return the mesh moved by (x, y, z) metres."""
        return replace(self, positions=self.positions + np.array([x, y, z]))

    def turned(self, degrees: float, axis: str = "z") -> Mesh:
        """Return the mesh turned about a coordinate axis, counter-clockwise."""
        i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
        cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        turned = self.positions.copy()
        turned[:, i] = cosine * self.positions[:, i] - sine * self.positions[:, j]
        turned[:, j] = sine * self.positions[:, i] + cosine * self.positions[:, j]
        return replace(self, positions=turned)

    def bare(self) -> Mesh:
        """Return the mesh without texture coordinates."""
        return replace(self, uvs=None)

    def tiled(self, across: float, along: float, shift: Point2 = (0.0, 0.0)) -> Mesh:
        """Return the mesh with its texture repeated, then shifted by parts of one repeat.

        Raises
        ------
        ValueError
            The mesh has no texture coordinates.
        """
        if self.uvs is None:
            raise ValueError("the mesh has no texture coordinates to tile")
        return replace(self, uvs=self.uvs * np.array([across, along]) + np.array(shift))

    def flipped(self) -> Mesh:
        """Return the mesh with inside and outside exchanged."""
        return replace(self, faces=self.faces[:, ::-1])


def join(meshes: Iterable[Mesh]) -> Mesh:
    """Return one mesh of several; texture coordinates stay only if every part has them."""
    parts = list(meshes)
    offsets = np.cumsum([0] + [len(part.positions) for part in parts[:-1]])
    uvs = [part.uvs for part in parts if part.uvs is not None]
    return Mesh(
        positions=np.concatenate([part.positions for part in parts]),
        faces=np.concatenate([part.faces + o for part, o in zip(parts, offsets, strict=True)]),
        uvs=np.concatenate(uvs) if len(uvs) == len(parts) else None,
    )


def block(size: Vector, bevel: float = 0.004) -> Mesh:
    """Return a box with chamfered edges that stands on z = 0, centred in x and y."""
    half = np.array(size) / 2.0
    bevel = min(bevel, 0.45 * float(half.min()))
    signs = list(product((-1, 1), repeat=3))
    # Three vertices a corner, each flush with the face of one axis: index 3 * corner + axis.
    positions = np.array(
        [[s[k] * (half[k] - (0.0 if k == a else bevel)) for k in range(3)] for s in signs for a in range(3)]
    )
    corner = {s: i for i, s in enumerate(signs)}
    polygons: list[list[int]] = [[3 * i, 3 * i + 1, 3 * i + 2] for i in range(8)]
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        ring = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
        for sign in (-1, 1):

            def vertex(
                pair: Point2, flush: int, axis: int = axis, sign: int = sign, others: list[int] = others
            ) -> int:
                s = [0, 0, 0]
                s[axis], s[others[0]], s[others[1]] = sign, int(pair[0]), int(pair[1])
                return 3 * corner[(s[0], s[1], s[2])] + flush

            polygons.append([vertex(pair, axis) for pair in ring])
        for pair in ring:
            ends = []
            for sign in (-1, 1):
                s = [0, 0, 0]
                s[axis], s[others[0]], s[others[1]] = sign, pair[0], pair[1]
                ends.append(3 * corner[(s[0], s[1], s[2])])
            polygons.append(
                [ends[0] + others[0], ends[0] + others[1], ends[1] + others[1], ends[1] + others[0]]
            )
    faces = np.array([[p[0], p[k], p[k + 1]] for p in polygons for k in range(1, len(p) - 1)])
    # The solid is convex about its centre, so outward is away from the origin.
    corners = positions[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("ij,ij->i", normals, corners.mean(axis=1)) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return Mesh(positions + np.array([0.0, 0.0, half[2]]), faces.astype(np.int64))


def span(low: Vector, high: Vector, bevel: float = 0.004) -> Mesh:
    """Return a chamfered box between two opposite corners."""
    size = (high[0] - low[0], high[1] - low[1], high[2] - low[2])
    return block(size, bevel).at((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2])


def surface(
    shape: Callable[[Floats, Floats], tuple[Floats, Floats, Floats]], columns: int, rows: int
) -> Mesh:
    """Return the grid of a parametric surface (u, v) -> (x, y, z), u and v in 0..1."""
    u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    xyz = np.stack([np.broadcast_to(c, u.shape) for c in shape(u, v)], axis=-1)
    index = np.arange(u.size).reshape(u.shape)
    a, b, c, d = (q.ravel() for q in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Mesh(xyz.reshape(-1, 3), faces, np.stack([u.ravel(), v.ravel()], axis=1))


def lathe(profile: Sequence[Point2], segments: int) -> Mesh:
    """Return the solid turned from a profile of (radius, z) points, listed from the bottom up."""
    radii, heights = np.array(profile, dtype=float).T
    rows = len(profile) - 1

    def turn(u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        radius = np.interp(v * rows, np.arange(rows + 1), radii)
        height = np.interp(v * rows, np.arange(rows + 1), heights)
        return radius * np.cos(2 * np.pi * u), radius * np.sin(2 * np.pi * u), height

    return surface(turn, segments, rows)


def extrude(outline: Sequence[Point2], depth: float, holes: Sequence[Sequence[Point2]] = ()) -> Mesh:
    """Return a plate of an outline in the xy plane, z from 0 to `depth`."""
    return extrude_parts(shapely.Polygon(outline, holes), depth)


def extrude_parts(area: shapely.Geometry, depth: float) -> Mesh:
    """Return the plates of all polygons of an area of the xy plane, z from 0 to `depth`."""
    plates = [
        trimesh.creation.extrude_polygon(part, depth) for part in shapely.get_parts(area) if part.area > 1e-6
    ]
    return join(
        Mesh(np.asarray(p.vertices, dtype=float), np.asarray(p.faces, dtype=np.int64)) for p in plates
    )


def upright(mesh: Mesh) -> Mesh:
    """Return a plate of the xy plane stood up in the xz plane, its depth towards -y."""
    return mesh.turned(90.0, "x")


def cushion(size: Vector, segments: int, squareness: float = 0.35) -> Mesh:
    """Return a pillow that lies on z = 0: a superellipsoid, textured from above."""

    def power(x: Floats, exponent: float) -> Floats:
        return np.asarray(np.sign(x) * np.abs(x) ** exponent)

    def pillow(u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        around, up = 2 * np.pi * u, np.pi * (v - 0.5)
        rim = power(np.cos(up), 0.6)
        return (
            size[0] / 2 * rim * power(np.cos(around), squareness),
            size[1] / 2 * rim * power(np.sin(around), squareness),
            size[2] / 2 * (1 + power(np.sin(up), 0.9)),
        )

    mesh = surface(pillow, segments, max(6, segments // 2))
    return replace(mesh, uvs=mesh.positions[:, :2] / np.array(size[:2]) + 0.5)


def sphere(radius: float, segments: int) -> Mesh:
    """Return a ball about the origin."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, segments // 2 + 1)
    return lathe([(radius * max(np.cos(a), 0.0), radius * np.sin(a)) for a in angles], segments)


def arch(width: float, height: float, rise: float, segments: int) -> list[Point2]:
    """Return the outline of an opening with an arched head, its foot centred on (0, 0)."""
    angles = np.linspace(0.0, np.pi, segments + 1)
    head = [(width / 2 * float(np.cos(a)), height - rise + rise * float(np.sin(a))) for a in angles]
    return [(-width / 2, 0.0), (width / 2, 0.0), *head]
