"""Solids, by trimesh and by geometry."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from studies.scenes.joinery import CORNICE, ring
from studies.scenes.shading import box_mapped, corner_normals, shaded_vertices
from studies.scenes.solids import Mesh, arch, block, extrude, join, lathe, span, sphere, surface
from studies.scenes.sweeps import frame, tube

CONE = [(0.0, 0.0), (1.0, 0.0), (0.0, 2.0)]
SQUARE = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]
HOLE = [(0.5, 0.5), (1.5, 0.5), (1.5, 1.5), (0.5, 1.5)]
# Chamfers cut twelve edges by half a square of the bevel each, less what corners share.
CUT = 4 * (0.4 + 0.3 + 0.2) * 0.01**2 / 2


def checked(mesh: Mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.positions, mesh.faces, process=False)


@pytest.mark.parametrize(
    ("mesh", "volume", "tolerance"),
    [
        (block((0.4, 0.3, 0.2), 0.01), 0.4 * 0.3 * 0.2 - CUT, 5e-4),
        (sphere(1.0, 96), 4 / 3 * np.pi, 5e-3),
        (lathe(CONE, 128), 2 / 3 * np.pi, 1e-3),
        (extrude(SQUARE, 0.1, [HOLE]), 0.3, 1e-6),
        (tube([(0, 0, 0), (0, 0, 1), (0, 0, 2)], 0.1, 64), 2 * np.pi * 0.01, 5e-3),
    ],
    ids=["block", "sphere", "lathe", "extrude", "tube"],
)
def test_solids_enclose_their_volume(mesh: Mesh, volume: float, tolerance: float) -> None:
    solid = checked(mesh)
    assert solid.is_winding_consistent
    assert solid.volume == pytest.approx(volume, rel=tolerance)


def test_bounds() -> None:
    solid = checked(block((0.4, 0.3, 0.2), 0.01))
    assert solid.is_watertight
    np.testing.assert_allclose(solid.bounds, [[-0.2, -0.15, 0.0], [0.2, 0.15, 0.2]])
    np.testing.assert_allclose(checked(span((1, 2, 3), (2, 4, 3.5))).bounds, [[1, 2, 3], [2, 4, 3.5]])
    outline = np.array(arch(2.0, 3.0, 1.0, 16))
    np.testing.assert_allclose([outline.min(axis=0), outline.max(axis=0)], [[-1, 0], [1, 3]])


def test_mouldings_face_outwards_and_cornices_into_the_room() -> None:
    bead = checked(frame(1.0, 0.6, [(0.05, 0.0), (0.05, 0.02), (0.0, 0.02), (0.0, 0.0)]))
    assert (bead.face_normals[bead.triangles_center[:, 2] > 0.019, 2] > 0.99).all()
    cornice = checked(ring(CORNICE, (0, 0), (4, 3), 2.5))
    inward = np.array([2.0, 1.5, 0.0]) - cornice.triangles_center
    towards = np.einsum("ij,ij->i", cornice.face_normals[:, :2], inward[:, :2])
    assert (towards > -1e-9).all()


def test_normals_round_a_sphere_and_keep_a_box_sharp() -> None:
    ball = sphere(1.0, 64)
    along = np.einsum("ij,ij->i", corner_normals(ball, 40.0), ball.positions[ball.faces].reshape(-1, 3))
    assert np.median(along) > 0.999
    slab = extrude([(0, 0), (1, 0), (1, 1), (0, 1)], 1.0)
    assert (np.abs(corner_normals(slab, 40.0)).max(axis=1) > 1 - 1e-9).all()


def test_degenerate_faces_are_left_out() -> None:
    rows, faces = shaded_vertices(lathe(CONE, 12), 40.0)
    assert rows.shape[1] == 8
    assert len(faces) == 24
    assert np.isfinite(rows).all()


def test_texture_coordinates() -> None:
    mapped = box_mapped(block((1.0, 1.0, 1.0), 0.0), 0.25)
    assert mapped.uvs is not None
    assert np.ptp(mapped.uvs[:, 0]) == pytest.approx(4.0)
    flat = surface(lambda u, v: (u, v, 0 * u), 1, 1)
    assert join([flat, flat]).uvs is not None
    assert join([flat, flat.bare()]).uvs is None
    with pytest.raises(ValueError, match="no texture"):
        flat.bare().tiled(2.0, 2.0)
