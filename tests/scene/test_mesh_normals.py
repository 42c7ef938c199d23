"""Meshes whose vertices have no normals."""

import mitsuba as mi
import numpy as np
import pytest

from enfilade.device import active
from enfilade.errors import SceneError
from enfilade.scene.mitsuba.load import load_scene
from support.mitsuba_scene import opened, write_square


@pytest.fixture(autouse=True)
def variant():
    mi.set_variant(active().variant)


def normals_of(folder, third, flip):
    """Shading normals of a square, of which the third vertex has a given normal."""
    write_square(folder / "square.ply", ("nx", "ny", "nz"), ["0 0 1", "0 0 1", third, "0 0 1"])
    flipped = f'<boolean name="flip_normals" value="{str(flip).lower()}"/>'
    square = f'<shape type="ply"><string name="filename" value="square.ply"/>{flipped}</shape>'
    file = folder / "scene.xml"
    file.write_text(f'<scene version="3.0.0"><emitter type="constant"/>{square}</scene>')
    rays = mi.Ray3f(mi.Point3f([0.5, -0.5, 0.9], [0.2, 0.4, 0.9], 3.0), mi.Vector3f(0.0, 0.0, -1.0))
    return np.array(load_scene(file).ray_intersect(rays).sh_frame.n)


@pytest.mark.parametrize("flip", [False, True])
def test_vertices_without_a_normal_have_that_of_their_triangles(tmp_path, flip):
    whole = normals_of(tmp_path, "0 0 1", flip)
    np.testing.assert_allclose(normals_of(tmp_path, "0 0 0", flip), whole, atol=1e-6)
    assert any("1 of 4 vertices" in note for note in opened(tmp_path / "scene.xml").describe().notes)


def scaled_by_zero(folder, shape):
    flat = '<transform name="to_world"><scale x="1" y="1" z="0"/></transform>'
    shape = f'<shape type="{shape}" id="flat">{flat}</shape>'
    (folder / "scene.xml").write_text(f'<scene version="3.0.0"><emitter type="constant"/>{shape}</scene>')
    return folder / "scene.xml"


def test_a_flattened_mesh_has_the_normals_of_its_triangles(tmp_path):
    scene = load_scene(scaled_by_zero(tmp_path, "cube"))
    hit = scene.ray_intersect(mi.Ray3f(mi.Point3f(0.3, 0.2, 3.0), mi.Vector3f(0.0, 0.0, -1.0)))
    np.testing.assert_allclose(np.abs(hit.sh_frame.n).ravel(), [0.0, 0.0, 1.0], atol=1e-6)


def test_a_rectangle_that_is_scaled_by_zero_is_refused(tmp_path):
    with pytest.raises(SceneError, match=r"to_world of the shape flat .* scale by zero"):
        load_scene(scaled_by_zero(tmp_path, "rectangle"))
