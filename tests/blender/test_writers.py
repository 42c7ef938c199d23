"""PLY, PNG, OpenEXR and XML files, read again by other libraries."""

import time
from dataclasses import replace

import mitsuba as mi
import numpy as np
import OpenEXR
import pytest
from PIL import Image

from enfilade_blender.image_files import srgb_from_linear, write_exr, write_png
from enfilade_blender.ply import Mesh, joined, write_ply
from enfilade_blender.scene_xml import Identifiers, colour, named, plugin, reference, write_scene

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)


def square():
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    normals = np.broadcast_to(np.array([0, 0, 1], np.float32), (2, 3, 3))
    uv = CORNERS[triangles][..., :2]
    return Mesh(
        CORNERS, triangles, normals, {"UV": uv}, {"paint": CORNERS[triangles]}, np.zeros(2, np.int32), "UV"
    )


@pytest.mark.parametrize("shape", [(1, 1), (16, 5), (37, 23)])
def test_openexr_reads_what_is_written(tmp_path, shape):
    image = np.random.default_rng(1).normal(size=(*shape, 3)).astype(np.float32) * 1e5
    image[: shape[0] // 2] = 0.25  # compresses
    write_exr(tmp_path / "a.exr", image)
    with OpenEXR.File(str(tmp_path / "a.exr")) as file:
        assert np.array_equal(file.channels()["RGB"].pixels, image)


@pytest.mark.parametrize("channels", [1, 3])
def test_pillow_reads_what_is_written(tmp_path, channels):
    image = np.random.default_rng(1).random((7, 5, channels), np.float32)
    write_png(tmp_path / "a.png", image)
    read = np.asarray(Image.open(tmp_path / "a.png"), np.float32).reshape(7, 5, channels) / 255.0
    assert np.abs(read - image).max() <= 0.5 / 255.0 + 1e-6


def test_the_srgb_curve():
    assert srgb_from_linear(np.array([0.0, 0.002, 0.21404114, 1.0, 2.0])) == pytest.approx(
        [0, 0.02584, 0.5, 1, 1], abs=1e-5
    )


def test_mitsuba_reads_a_mesh(tmp_path):
    write_ply(tmp_path / "a.ply", square(), "UV", "paint")
    mesh = mi.load_dict({"type": "ply", "filename": str(tmp_path / "a.ply")})
    assert (mesh.vertex_count(), mesh.face_count()) == (4, 2)  # equal corners are one vertex
    assert mesh.has_vertex_normals()
    assert mesh.has_vertex_texcoords()
    assert "vertex_color" in mi.traverse(mesh)
    positions = np.array(mi.traverse(mesh)["vertex_positions"]).reshape(-1, 3)
    uv = np.array(mi.traverse(mesh)["vertex_texcoords"]).reshape(-1, 2)
    assert np.array_equal(positions[:, :2], uv)


def test_a_reflection_turns_the_corners_and_keeps_normals_outside():
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    moved = square().transformed(mirror)
    a, b, c = moved.positions[moved.triangles[0]]
    assert np.cross(b - a, c - a) @ moved.normals[0, 0] > 0.0
    assert np.array_equal(moved.uvs["UV"][0], square().uvs["UV"][0][::-1])


def test_normals_stay_perpendicular_under_shear():
    shear = np.eye(4)
    shear[0, 2] = shear[2, 0] = 0.5
    moved = square().transformed(shear)
    corners = moved.positions[moved.triangles[0]]
    assert (corners[1] - corners[0]) @ moved.normals[0, 0] == pytest.approx(0.0, abs=1e-6)
    assert np.linalg.norm(moved.normals[0, 0]) == pytest.approx(1.0)


def test_a_flattened_mesh_has_the_normals_of_its_triangles():
    tilted = replace(square(), normals=np.full((2, 3, 3), 3**-0.5, np.float32))
    flat = tilted.transformed(np.diag([1.0, 1.0, 0.0, 1.0]))
    assert np.array_equal(flat.normals, square().normals)
    point = tilted.transformed(np.diag([0.0, 0.0, 0.0, 1.0]))
    assert np.linalg.norm(point.normals, axis=-1) == pytest.approx(1.0)


def test_a_square_is_flat_and_open_and_a_tetrahedron_closed():
    turned = square().transformed(
        np.array([[0.6, 0, 0.8, 900], [0, 1, 0, 0], [-0.8, 0, 0.6, 5], [0, 0, 0, 1]])
    )
    assert turned.is_flat()
    assert not square().is_closed()
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    triangles = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], np.int32)
    solid = Mesh(points, triangles, np.zeros((4, 3, 3), np.float32), {}, {}, np.zeros(4, np.int32))
    assert solid.is_closed()
    assert not solid.is_flat()


def cube(*, sides=6, gap=0.0):
    """Some sides of a cube; the first is moved by a gap."""
    axes = np.eye(3)[[0, 1, 2, 0, 1, 2]]
    meshes = []
    for side, (normal, sign) in enumerate(zip(axes, (1, 1, 1, -1, -1, -1), strict=True)):
        right = np.roll(normal, 1)
        corners = [sign * normal + u * right + sign * v * np.cross(normal, right) for u, v in QUAD]
        points = np.array(corners) + gap * normal * (side == 0)
        meshes.append(replace(square(), positions=points.astype(np.float32)))
    return joined(meshes[:sides])


APART = np.array([[3.0, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
QUAD = ((-1, -1), (1, -1), (1, 1), (-1, 1))


@pytest.mark.parametrize(
    ("mesh", "share"),
    [
        (square(), 1 / 2),
        (joined([square(), square().transformed(APART).reversed()]), 1 / 2),
        (cube(), 0.0),
        (cube(sides=5), 1 / 6),
        (cube(gap=5e-5), 0.0),
    ],
    ids=["a square", "two squares", "a cube", "an open cube", "a cube with a crack"],
)
def test_openness_is_the_share_of_holes(mesh, share):
    assert mesh.openness() == pytest.approx(share, abs=1e-3)


def test_joined_copies_keep_their_corners():
    both = joined([square(), square().transformed(np.diag([2.0, 2.0, 2.0, 1.0]))])
    assert len(both) == 4
    assert both.positions[both.triangles[3]].max() == 2.0


def test_selected_triangles_keep_only_their_positions():
    one = square().select(np.array([False, True]))
    assert len(one.positions) == 3
    assert np.array_equal(one.positions[one.triangles[0]], CORNERS[[0, 2, 3]])


def test_many_equal_names_are_numbered_at_once():
    identifiers, start = Identifiers(), time.process_time()
    assert [identifiers.unique("grass") for _ in range(20_000)][-1] == "grass 20000"
    assert time.process_time() - start < 5.0  # of 0.02; by trying all numbers it is 50


def test_ids_are_unique_and_without_reserved_characters():
    identifiers = Identifiers()
    assert [identifiers.unique(name) for name in ("a.001", "a_001", "", "é/<b>")] == [
        "a_001",
        "a_001 2",
        "unnamed",
        "é_<b>",
    ]


def test_scalars_of_numpy_are_no_properties():
    for value in (np.bool_(True), np.float32(1.0), np.int64(1)):
        with pytest.raises(TypeError, match="raw is a"):
            plugin("texture", "bitmap", raw=value)


def test_mitsuba_loads_what_is_written(tmp_path):
    metal = plugin(
        "bsdf", "roughconductor", material="none", alpha=0.1, specular_reflectance=colour((1.5, 1.0, 0.2))
    )
    shape = plugin("shape", "sphere", reference("Grün & <weiß>"), radius=2.0)
    write_scene(
        tmp_path / "scene.xml",
        [named(plugin("bsdf", "twosided", metal), "Grün & <weiß>"), named(shape, "Kugel é")],
    )
    scene = mi.load_file(str(tmp_path / "scene.xml"))
    assert scene.shapes()[0].id() == "Kugel é"
    assert "1.5" in str(scene.shapes()[0].bsdf())
