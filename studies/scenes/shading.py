"""Shading normals and texture coordinates of meshes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studies.scenes.solids import Floats, Ints, Mesh


def corner_normals(mesh: Mesh, crease_deg: float) -> Floats:
    """Return the normal at each corner of each face, (3 * faces, 3).

    A corner averages, weighted by area, the faces around its point that bend away from its own
    face by less than `crease_deg`: bevels look round and sharp edges stay sharp.
    """
    corners = mesh.positions[mesh.faces]
    weighted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    weighted = np.repeat(weighted, 3, axis=0)
    unit = weighted / np.maximum(np.linalg.norm(weighted, axis=1, keepdims=True), 1e-30)
    # Sort the corners by the point they lie on, then pair each with all of its group.
    _, point = np.unique(np.round(mesh.positions, 6), axis=0, return_inverse=True)
    point = point.reshape(-1)[mesh.faces].ravel()
    order = np.argsort(point, kind="stable")
    _, starts, counts = np.unique(point[order], return_index=True, return_counts=True)
    start, count = np.repeat(starts, counts), np.repeat(counts, counts)
    first = np.cumsum(count) - count
    left = np.repeat(np.arange(len(order)), count)
    right = np.repeat(start, count) + np.arange(len(left)) - np.repeat(first, count)
    left, right = order[left], order[right]
    near = np.einsum("ij,ij->i", unit[left], unit[right]) > np.cos(np.radians(crease_deg))
    sums = np.add.reduceat(np.where(near[:, None], weighted[right], 0.0), first, axis=0)
    normals = np.empty_like(unit)
    normals[order] = sums
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > 0.0, normals / np.maximum(length, 1e-30), [0.0, 0.0, 1.0])


def shaded_vertices(mesh: Mesh, crease_deg: float) -> tuple[npt.NDArray[np.float32], Ints]:
    """Return vertex rows (x, y, z, nx, ny, nz[, u, v]), float32, and faces that index them."""
    corners = mesh.positions[mesh.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    kept = Mesh(mesh.positions, mesh.faces[area > 1e-12], mesh.uvs)
    flat = kept.faces.ravel()
    columns = [kept.positions[flat], corner_normals(kept, crease_deg)]
    if kept.uvs is not None:
        columns.append(kept.uvs[flat])
    rows = np.concatenate(columns, axis=1).astype("<f4")
    shared, index = np.unique(rows, axis=0, return_inverse=True)
    return shared, index.reshape(-1, 3).astype(np.int64)


def box_mapped(mesh: Mesh, tile: float | tuple[float, float], *, grain: str = "") -> Mesh:
    """Return the mesh with each face textured along the axis it faces.

    Parameters
    ----------
    mesh
        Its own texture coordinates are dropped.
    tile
        Metres that one copy of the texture covers, across and along.
    grain
        The axis ("x", "y" or "z") that the texture's v follows where a face contains it.
    """
    corners = mesh.positions[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = np.argmax(np.abs(normals), axis=1)
    across, along = np.array([1, 0, 0])[facing], np.array([2, 2, 1])[facing]
    if grain:
        swap = across == "xyz".index(grain)
        across, along = np.where(swap, along, across), np.where(swap, across, along)
    u = np.take_along_axis(corners, across[:, None, None], axis=2)[..., 0]
    v = np.take_along_axis(corners, along[:, None, None], axis=2)[..., 0]
    uvs = np.stack([u, v], axis=2).reshape(-1, 2) / np.asarray(tile)
    return Mesh(corners.reshape(-1, 3), np.arange(len(uvs)).reshape(-1, 3), uvs)
