"""Solids against what trimesh and geometry say of them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from studies.scenes.joinery import CORNICE, ring
from studies.scenes.shading import box_mapped, corner_normals, shaded_vertices
from studies.scenes.solids import Mesh, arch, block, extrude, join, lathe, span, sphere, surface
from studies.scenes.sweeps import frame, tube


def checked(mesh: Mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.positions, mesh.faces, process=False)


def test_block_is_closed_and_faces_outwards() -> None:
    solid = checked(block((0.4, 0.3, 0.2), 0.01))
    assert solid.is_watertight
    assert solid.is_winding_consistent
    # Chamfers cut twelve edges by half a square of the bevel each, less what corners share.
    cut = 4 * (0.4 + 0.3 + 0.2) * 0.01**2 / 2
    assert solid.volume == pytest.approx(0.4 * 0.3 * 0.2 - cut, abs=1e-5)
    np.testing.assert_allclose(solid.bounds, [[-0.2, -0.15, 0.0], [0.2, 0.15, 0.2]])


def test_span_fills_its_corners() -> None:
    np.testing.assert_allclose(checked(span((1, 2, 3), (2, 4, 3.5))).bounds, [[1, 2, 3], [2, 4, 3.5]])


def test_sphere_and_lathe_enclose_their_volume() -> None:
    assert checked(sphere(1.0, 96)).volume == pytest.approx(4 / 3 * np.pi, rel=5e-3)
    cone = lathe([(0.0, 0.0), (1.0, 0.0), (0.0, 2.0)], 128)
    assert checked(cone).volume == pytest.approx(2 / 3 * np.pi, rel=1e-3)


def test_extrusion_with_a_hole_has_the_area_between() -> None:
    square = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]
    hole = [(0.5, 0.5), (1.5, 0.5), (1.5, 1.5), (0.5, 1.5)]
    assert checked(extrude(square, 0.1, [hole])).volume == pytest.approx(0.3)


def test_arch_reaches_its_height() -> None:
    outline = np.array(arch(2.0, 3.0, 1.0, 16))
    np.testing.assert_allclose([outline.min(axis=0), outline.max(axis=0)], [[-1, 0], [1, 3]])


def test_tube_is_closed_and_faces_outwards() -> None:
    rod = checked(tube([(0, 0, 0), (0, 0, 1), (0, 0, 2)], 0.1, 64))
    assert rod.is_watertight
    assert rod.volume == pytest.approx(2 * np.pi * 0.01, rel=5e-3)


def test_frame_faces_outwards() -> None:
    bead = frame(1.0, 0.6, [(0.05, 0.0), (0.05, 0.02), (0.0, 0.02), (0.0, 0.0)])
    normals = checked(bead).face_normals
    middle = checked(bead).triangles_center
    top = middle[:, 2] > 0.019
    assert (normals[top, 2] > 0.99).all()


def test_cornice_faces_into_the_room() -> None:
    moulding = checked(ring(CORNICE, (0, 0), (4, 3), 2.5))
    inward = np.array([2.0, 1.5, 0.0]) - moulding.triangles_center
    towards = np.einsum("ij,ij->i", moulding.face_normals[:, :2], inward[:, :2])
    assert (towards > -1e-9).all()


def test_normals_round_a_sphere_and_keep_a_box_sharp() -> None:
    ball = sphere(1.0, 64)
    normals = corner_normals(ball, 40.0)
    along = np.einsum("ij,ij->i", normals, ball.positions[ball.faces].reshape(-1, 3))
    assert np.median(along) > 0.999
    slab = extrude([(0, 0), (1, 0), (1, 1), (0, 1)], 1.0)
    assert (np.abs(corner_normals(slab, 40.0)).max(axis=1) > 1 - 1e-9).all()


def test_degenerate_faces_are_left_out() -> None:
    cone = lathe([(0.0, 0.0), (1.0, 0.0), (0.0, 2.0)], 12)
    rows, faces = shaded_vertices(cone, 40.0)
    assert rows.shape[1] == 8
    assert len(faces) == 24
    assert np.isfinite(rows).all()


def test_box_mapping_measures_in_tiles() -> None:
    mapped = box_mapped(block((1.0, 1.0, 1.0), 0.0), 0.25)
    assert mapped.uvs is not None
    assert np.ptp(mapped.uvs[:, 0]) == pytest.approx(4.0)


def test_join_keeps_texture_only_if_all_have_it() -> None:
    flat = surface(lambda u, v: (u, v, 0 * u), 1, 1)
    assert join([flat, flat]).uvs is not None
    assert join([flat, flat.bare()]).uvs is None
    with pytest.raises(ValueError, match="no texture"):
        flat.bare().tiled(2.0, 2.0)
