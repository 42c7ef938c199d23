# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangle meshes, and binary PLY files of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
FLAT = 1e-4  # extent of a mesh across its plane, relative to that along it
NEAR = 1e-4  # distance of vertices that meet, relative to the extent
UNIT = 1e-2  # deviation of a normal's length from 1


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with values at their corners.

    Attributes
    ----------
    positions : (V, 3) float32
    triangles : (N, 3) int32
        Indices of positions.
    normals : (N, 3, 3) float32
        Unit normals of corners.
    uvs : dict of (N, 3, 2) float32
        Texture coordinates of corners by the name of the UV map; v points up.
    colours : dict of (N, 3, 4) float32
        Attributes of corners by name: linear colours and alpha, or numbers and vectors.
    materials : (N,) int32
        Slots.
    active_uv : str
        UV map of nodes that name none; empty where there is none.
    active_colour : str
        Attribute of nodes that name none; empty where there is none.
    generated : (N, 3, 3) float32 or None
        Generated coordinates of corners; None where they are the place within the bounds.
    """

    positions: F32
    triangles: I32
    normals: F32
    uvs: dict[str, F32]
    colours: dict[str, F32]
    materials: I32
    active_uv: str = ""
    active_colour: str = ""
    generated: F32 | None = None

    def __len__(self) -> int:
        return len(self.triangles)

    def select(self, keep: npt.NDArray[np.bool_]) -> Mesh:
        """The triangles of a mask (N,); positions that none of them uses are left out."""
        used, triangles = np.unique(self.triangles[keep], return_inverse=True)
        return replace(
            self,
            positions=self.positions[used],
            triangles=triangles.reshape(-1, 3).astype(np.int32),
            normals=self.normals[keep],
            uvs={name: uv[keep] for name, uv in self.uvs.items()},
            colours={name: colour[keep] for name, colour in self.colours.items()},
            materials=self.materials[keep],
            generated=None if self.generated is None else self.generated[keep],
        )

    def transformed(self, matrix: npt.NDArray[np.float64]) -> Mesh:
        """The mesh under an affine map (4, 4). A reflection turns the order of corners, too."""
        linear = matrix[:3, :3]
        positions = self.positions @ linear.T + matrix[:3, 3]
        cofactors = np.stack([np.cross(linear[(i + 1) % 3], linear[(i + 2) % 3]) for i in range(3)])
        mirror = -1.0 if np.linalg.det(linear) < 0.0 else 1.0
        normals = self.normals @ (mirror * cofactors).T
        normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-30)
        moved = replace(self, positions=positions.astype(np.float32), normals=normals.astype(np.float32))
        return (moved.reversed() if mirror < 0.0 else moved).with_normals()

    def with_normals(self) -> Mesh:
        """The mesh; normals without a direction, as a flattened one has, are those of triangles.

        Those of triangles without an area are +z: Mitsuba makes NaN of zeros.
        """
        is_void = ~(np.abs(np.linalg.norm(self.normals, axis=-1) - 1.0) < UNIT)
        if not is_void.any():
            return self
        edges = np.diff(self.positions[self.triangles].astype(np.float64), axis=1)
        flat = np.cross(edges[:, 0], edges[:, 1])
        length = np.linalg.norm(flat, axis=-1, keepdims=True)
        flat = np.where(length > 0.0, flat / np.where(length > 0.0, length, 1.0), (0.0, 0.0, 1.0))
        normals = np.where(is_void[..., None], flat[:, None], self.normals)
        return replace(self, normals=normals.astype(np.float32))

    def reversed(self) -> Mesh:
        """The same corners in opposite order; normals stay."""
        return replace(
            self,
            triangles=self.triangles[:, ::-1],
            normals=self.normals[:, ::-1],
            uvs={name: uv[:, ::-1] for name, uv in self.uvs.items()},
            colours={name: colour[:, ::-1] for name, colour in self.colours.items()},
            generated=None if self.generated is None else self.generated[:, ::-1],
        )

    def area(self) -> float:
        """Surface area, of single precision as Mitsuba's: of tiny triangles it is 0."""
        edges = np.diff(self.positions[self.triangles], axis=1)
        return float(0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=-1).sum())

    def uv_area(self, uv: str) -> float:
        """Area in a UV map, of triangles that overlap each by itself."""
        edges = np.diff(self.uvs[uv], axis=1)
        return float(0.5 * np.abs(np.linalg.det(edges)).sum())

    def mirrored(self, uv: str) -> npt.NDArray[np.bool_]:
        """Triangles (N,) on which a UV map is mirrored, as seen from where the normals point."""
        edges = np.diff(self.positions[self.triangles], axis=1)
        along, across = np.moveaxis(np.diff(self.uvs[uv], axis=1), 1, 0)
        area = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
        front = np.einsum("ij,ij->i", np.cross(edges[:, 0], edges[:, 1]), self.normals.sum(axis=1))
        is_mirrored: npt.NDArray[np.bool_] = area * front < 0.0
        return is_mirrored

    def is_closed(self) -> bool:
        """Whether every edge has two triangles, by positions."""
        return bool((self.edges()[1] == 2).all())

    def openness(self) -> float:
        """Share that the holes have of the area of the mesh and them: of a plane 1/2, of a closed mesh 0.

        A hole is what lies between connected edges of one triangle each, after vertices that nearly meet are
        merged. Its area is that of its projection along its mean normal.
        """
        if not len(self):
            return 0.0
        step = NEAR * max(float(np.ptp(self.positions, axis=0).max()), 1e-30)
        near = replace(self, positions=np.round(self.positions / step).astype(np.float32))
        missing = float(np.linalg.norm(_holes(near), axis=-1).sum())
        return missing / max(missing + near.area(), 1e-30)

    def merged(self) -> tuple[F32, npt.NDArray[np.int64]]:
        """Distinct positions (V, 3), and those of the vertices."""
        places, merged = np.unique(self.positions, axis=0, return_inverse=True)
        return places, merged.reshape(-1).astype(np.int64)

    def edges(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Edges (E, 2) along triangles, as distinct positions, and of each how many triangles share it."""
        corners = self.merged()[1][self.triangles]
        edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
        keys = edges.min(axis=1) * (len(self.positions) + 1) + edges.max(axis=1)
        _, which, counts = np.unique(keys, return_inverse=True, return_counts=True)
        return edges, counts[which.reshape(-1)]

    def is_flat(self) -> bool:
        """Whether all vertices lie in a plane."""
        centred = self.positions.astype(np.float64) - self.positions.mean(axis=0)
        smallest, _, largest = np.linalg.eigvalsh(centred.T @ centred)
        return bool(smallest <= FLAT**2 * largest)

    def volume(self) -> float:
        """Volume inside a closed mesh; negative where its triangles face inward."""
        a, b, c = (self.positions[self.triangles[:, corner]].astype(np.float64) for corner in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


def _holes(mesh: Mesh) -> npt.NDArray[np.float64]:
    """Areas times normals of holes, (V, 3), at one vertex of each."""
    edges, counts = mesh.edges()
    starts, ends = edges[counts == 1].T
    hole = np.arange(edges.max() + 1)  # of a vertex: the least that it is known to be connected to
    while not np.array_equal(hole[starts], hole[ends]):
        least = np.minimum(hole[starts], hole[ends])
        for vertices in (hole[starts], hole[ends], starts, ends):
            np.minimum.at(hole, vertices, least)
        hole = hole[hole]
    places = mesh.merged()[0].astype(np.float64)
    places -= places.mean(axis=0)
    areas = np.zeros((len(hole), 3))
    np.add.at(areas, hole[starts], 0.5 * np.cross(places[starts], places[ends]))
    return areas


def joined(meshes: list[Mesh]) -> Mesh:
    """One mesh of copies with the same maps."""
    first = meshes[0]
    bases = np.cumsum([0, *(len(mesh.positions) for mesh in meshes[:-1])])
    return replace(
        first,
        positions=np.concatenate([mesh.positions for mesh in meshes]),
        triangles=np.concatenate([m.triangles + base for m, base in zip(meshes, bases, strict=True)]).astype(
            np.int32
        ),
        normals=np.concatenate([mesh.normals for mesh in meshes]),
        uvs={name: np.concatenate([mesh.uvs[name] for mesh in meshes]) for name in first.uvs},
        colours={name: np.concatenate([mesh.colours[name] for mesh in meshes]) for name in first.colours},
        materials=np.concatenate([mesh.materials for mesh in meshes]),
        generated=None
        if first.generated is None
        else np.concatenate([mesh.generated for mesh in meshes if mesh.generated is not None]),
    )


def write_ply(file: Path, mesh: Mesh, uv: str | None = None, colour: str | None = None) -> None:
    """Write a mesh with normals, and one UV map and one colour attribute where they are named.

    Corners of equal position, normal, coordinates and colour become one vertex.
    """
    columns = [mesh.positions[mesh.triangles].reshape(-1, 3), mesh.normals.reshape(-1, 3)]
    names = ["x", "y", "z", "nx", "ny", "nz"]
    if uv is not None:
        columns.append(mesh.uvs[uv].reshape(-1, 2))
        names += ["u", "v"]
    if colour is not None:
        columns.append(mesh.colours[colour][..., :3].reshape(-1, 3))
        names += ["r", "g", "b"]
    corners = np.ascontiguousarray(np.concatenate(columns, axis=1), "<f4") + np.float32(0.0)  # no -0
    first, index = _distinct_rows(corners)
    faces = np.empty(len(mesh), np.dtype([("count", "u1"), ("index", "<i4", 3)]))
    faces["count"], faces["index"] = 3, index.reshape(-1, 3)
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(first)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    with file.open("wb") as stream:
        stream.write("\n".join(header).encode())
        stream.write(corners[first].tobytes())
        stream.write(faces.tobytes())


def map_uv(file: Path, scale: tuple[float, float], offset: tuple[float, float]) -> None:
    """Scale and move the texture coordinates in a file of :func:`write_ply`."""
    data = bytearray(file.read_bytes())
    begin = data.index(b"end_header\n") + len(b"end_header\n")
    header = data[:begin].decode().splitlines()
    count = next(int(line.split()[2]) for line in header if line.startswith("element vertex"))
    names = [line.split()[2] for line in header if line.startswith("property float")]
    vertices = np.frombuffer(data, "<f4", count * len(names), begin).reshape(count, len(names))
    at = names.index("u")
    vertices[:, at : at + 2] = vertices[:, at : at + 2] * np.float32(scale) + np.float32(offset)
    file.write_bytes(data)


def _distinct_rows(rows: F32) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Places of distinct rows of 32-bit numbers, and for each row the number of its equal among them.

    Rows are sorted by a hash, which is checked: sorting the rows themselves takes ten times as long.
    """
    multipliers = np.random.default_rng(0).integers(0, 2**63, rows.shape[1], np.uint64) * 2 + 1
    hashes = (rows.view(np.uint32).astype(np.uint64) * multipliers).sum(axis=1, dtype=np.uint64)
    _, first, index = np.unique(hashes, return_index=True, return_inverse=True)
    if not np.array_equal(rows[first][index.reshape(-1)], rows):  # two rows of one hash
        _, first, index = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return first, index.reshape(-1)
