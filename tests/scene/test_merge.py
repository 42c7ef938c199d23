"""Merged meshes: the same surfaces, under the same names, in fewer shapes."""

from operator import attrgetter

import mitsuba as mi
import numpy as np
import pytest

from enfilade.camera.pinhole import Camera, look_at
from enfilade.device import active
from enfilade.errors import SceneError
from enfilade.gbuffer import find_geometry
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from enfilade.scene.mitsuba import merge
from enfilade.scene.mitsuba import renderer as module
from enfilade.scene.mitsuba.load import load_scene
from enfilade.scene.mitsuba.merge import MergedScene, merge_meshes
from enfilade.scene.opener import Scene
from enfilade.settings import Settings
from support.mitsuba_scene import placed

BOX = """<shape type="cube" id="{name}"><transform name="to_world"><scale value="0.3"/>
  <rotate y="1" angle="{angle}"/><translate x="{x}" y="{y}"/></transform><ref id="{material}"/></shape>"""
BOXES = [
    ("a", "red", -2, 0),
    ("b", "blue", -1, 0),
    ("c", "red", 0, 0),
    ("d", "red", 1, 1),
    ("e", "blue", 2, 1),
]
SCENE = f"""<scene version="3.0.0">
<bsdf type="diffuse" id="red"><rgb name="reflectance" value="0.7, 0.2, 0.1"/></bsdf>
<bsdf type="plastic" id="blue"><rgb name="diffuse_reflectance" value="0.1, 0.2, 0.7"/></bsdf>
{"".join(BOX.format(name=n, material=m, x=x, y=y, angle=20 * (x + 3)) for n, m, x, y in BOXES)}
<shape type="sphere" id="ball"><float name="radius" value="0.3"/><point name="center" x="0" y="1.2" z="0"/>
  <ref id="red"/></shape>
<shape type="rectangle" id="lamp">
  <transform name="to_world"><rotate x="1" angle="90"/><translate y="4"/></transform>
  <ref id="red"/><emitter type="area"><rgb name="radiance" value="9"/></emitter></shape>
<emitter type="constant"><rgb name="radiance" value="0.3"/></emitter>
</scene>"""
CAMERA = Camera(look_at((0.3, 1.5, 4.0), (0.0, 0.5, 0.0)), 60.0, 64, 48)


def opened(folder, text=SCENE):
    file = folder / "boxes.xml"
    file.write_text(text)
    return Scene(file).open(Settings())


@pytest.fixture
def unmerged(tmp_path, monkeypatch):
    def as_it_is(scene):
        names = tuple(shape.id() for shape in scene.shapes())
        return MergedScene(scene, names, tuple(np.array([i + 1], np.uint32) for i in range(len(names))))

    with monkeypatch.context() as patch:
        patch.setattr(module, "merge_meshes", as_it_is)
        return opened(tmp_path)


def test_meshes_of_one_material_become_one_shape(tmp_path):
    file = tmp_path / "boxes.xml"
    opened(tmp_path)
    merged = merge_meshes(load_scene(file))
    assert merged.names == ("a", "b", "c", "d", "e", "ball", "lamp")
    parts = [sorted(set(source.tolist())) for source in merged.sources]
    assert parts == [[1, 3, 4], [2, 5], [6], [7]]  # 12 triangles a box; the sphere is no mesh, the lamp emits
    assert [len(source) for source in merged.sources] == [36, 24, 1, 1]
    assert len(merged.scene.emitters()) == 2


def test_surfaces_are_those_of_the_file(tmp_path, unmerged):
    merged = opened(tmp_path)
    assert merged.describe() == unmerged.describe()
    found, wanted = (find_geometry(renderer, CAMERA) for renderer in (merged, unmerged))
    assert set(np.unique(wanted.shape_index)) >= {0, 1, 2, 3, 4, 5, 6}
    for name in ("shape_index", "depth", "normal", "albedo", "surface"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))
    np.testing.assert_array_equal(merged.emitters().shape_index, unmerged.emitters().shape_index)
    np.testing.assert_array_equal(merged.emitters().position, unmerged.emitters().position)


def test_path_traced_images_agree(tmp_path, unmerged):
    pixels = np.arange(64 * 48, dtype=np.uint32)
    images = [
        renderer.trace(
            CAMERA, pixels, RandomKey(seed, 0, Purpose.REFERENCE), spp=64, pixel_filter=PixelFilter.BOX
        )
        for seed, renderer in enumerate((opened(tmp_path), unmerged))
    ]
    difference = images[0].color.mean(axis=1) - images[1].color.mean(axis=1)
    deviation = np.sqrt(images[0].variance + images[1].variance + 1e-8)
    assert abs(difference.mean()) < 4.0 * np.sqrt(np.mean(deviation**2) / len(pixels))
    assert np.abs(difference / deviation).mean() < 1.2  # 0.8 for a normal distribution


GROUPS = """<shape type="shapegroup" id="table">
  <shape type="cube"><transform name="to_world"><scale x="0.5" y="0.1" z="0.5"/></transform>
    <ref id="blue"/></shape>
  <shape type="ply"><string name="filename" value="bowl.ply"/><ref id="tinted"/></shape></shape>
<shape type="shapegroup" id="single"><shape type="cube"><ref id="red"/></shape></shape>
<shape type="shapegroup" id="round"><shape type="sphere"/></shape>
<bsdf type="diffuse" id="tinted"><texture type="mesh_attribute" name="reflectance">
  <string name="name" value="vertex_color"/></texture></bsdf>"""


def instance(name, group, x, y, *, scale="0.4, 0.4, 0.4", angle=0):
    return f"""<shape type="instance" id="{name}"><ref id="{group}"/><transform name="to_world">
<scale value="{scale}"/><rotate x="0.6" z="0.8" angle="{angle}"/><translate x="{x}" y="{y}"/></transform>
</shape>"""


INSTANCES = [
    instance("plain", "table", -2.0, 1.5),
    instance("turned", "table", -1.0, 2.0, angle=70),
    instance("lone", "single", 0.2, 2.2, angle=-50),
    instance("stretched", "table", 1.2, 2.0, scale="0.3, 0.9, 0.5", angle=-50),
    instance("mirrored", "table", 2.2, 2.0, scale="-0.5, 0.6, 0.5", angle=-50),
    instance("round one", "round", -1.7, -1.0, scale="0.3, 0.3, 0.3"),
]


def direction(u, v):
    return np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)], axis=-1)


@pytest.fixture
def with_instances(tmp_path):
    """A file of instances, some of a bowl whose vertices have normals, texture coordinates and colours."""
    u, v = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 17), np.linspace(0.5, 2.5, 9))
    first = np.array([17 * row + column for row in range(8) for column in range(16)])[:, None]
    faces = np.concatenate([first + corners for corners in ((0, 17, 1), (1, 17, 18))])
    bowl = mi.Mesh("bowl", u.size, len(faces), has_vertex_normals=True, has_vertex_texcoords=True)
    parameters = mi.traverse(bowl)
    parameters["faces"] = mi.UInt32(faces.astype(np.uint32).ravel())
    parameters["vertex_positions"] = floats(0.4 * direction(u, v) + [0.0, 0.5, 0.0])
    parameters["vertex_normals"] = floats(direction(u, v))
    parameters["vertex_texcoords"] = floats(np.stack([u, v], axis=-1))
    parameters.update()
    bowl.add_attribute("vertex_color", 3, floats(0.5 + 0.4 * direction(u, v)))
    bowl.write_ply(str(tmp_path / "bowl.ply"))
    file = tmp_path / "instances.xml"
    file.write_text(SCENE.replace("</scene>", GROUPS + "".join(INSTANCES) + "</scene>"))
    return file


def floats(values):
    return mi.Float(values.astype(np.float32).ravel())


def members(merged):
    return sorted(sorted(set(source.tolist())) for source in merged.sources)


@pytest.fixture(autouse=True)
def _variant_and_limit(monkeypatch):
    mi.set_variant(active().variant)
    monkeypatch.setattr(merge, "FEW_INSTANCES", 0)


def test_few_instances_stay(with_instances, monkeypatch):
    monkeypatch.setattr(merge, "FEW_INSTANCES", 4)
    merged = merge_meshes(load_scene(with_instances))  # six: the smallest group is expanded, then another
    kinds = [s.class_name() for s in merged.scene.shapes()]
    assert kinds.count("Instance") == 1
    monkeypatch.setattr(merge, "FEW_INSTANCES", 5)
    kinds = [s.class_name() for s in merge_meshes(load_scene(with_instances)).scene.shapes()]
    assert kinds.count("Instance") == 5


def test_flat_instances_are_not_seen(with_instances):
    """As in Mitsuba."""
    file = with_instances
    file.write_text(file.read_text().replace('value="0.3, 0.9, 0.5"', 'value="0.3, 0.9, 0"'))
    merged = merge_meshes(load_scene(file))
    assert not any(11 in members_ for members_ in members(merged))
    for shape in merged.scene.shapes():
        if shape.is_mesh():
            assert np.isfinite(np.array(shape.vertex_normals_buffer())).all()


def test_instances_of_meshes_become_meshes(with_instances):
    merged = merge_meshes(load_scene(with_instances))
    names = ("plain", "turned", "lone", "stretched", "mirrored", "round one")
    assert merged.names == ("a", "b", "c", "d", "e", "ball", "lamp", *names)
    tables = [8, 9, 11, 12]
    assert members(merged) == [[1, 3, 4, 10], [2, 5, *tables], [6], [7], tables, [13]]
    assert [s.class_name() for s in merged.scene.shapes()].count("Instance") == 1  # of a sphere


def test_instances_of_few_triangles_are_expanded_first(with_instances, monkeypatch):
    monkeypatch.setattr(merge, "EXPANDED_TRIANGLES", 4 * (12 + 256))  # those of the tables alone
    merged = merge_meshes(load_scene(with_instances))
    assert members(merged) == [[1, 3, 4, 10], [2, 5], [6], [7], [8], [9], [11], [12], [13]]


def test_expanded_instances_are_as_mitsuba_shows_them(with_instances):
    scenes = [load_scene(with_instances), merge_meshes(load_scene(with_instances)).scene]
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(-3.0, 3.0, 300), np.linspace(-2.0, 3.0, 250)))
    rays = mi.Ray3f(mi.Point3f(mi.Float(x), mi.Float(y), 5.0), mi.Vector3f(0.05, 0.02, -1.0))
    wanted, found = (scene.ray_intersect(rays) for scene in scenes)
    is_hit = np.array(wanted.is_valid())
    assert is_hit.sum() > 10_000
    np.testing.assert_array_equal(found.is_valid(), is_hit)
    for value in ("t", "n", "uv", "sh_frame.n"):
        a, b = (np.array(attrgetter(value)(si)).reshape(-1, len(x))[:, is_hit] for si in (found, wanted))
        np.testing.assert_allclose(a, b, atol=3e-4, err_msg=value)

    # Mitsuba itself reads the colours of an instance's vertices at wrong places.
    colour = np.array(found.shape.eval_attribute("vertex_color", found, found.is_valid()))
    is_bowl = (colour > 0.0).any(axis=0)
    assert is_bowl.sum() > 500
    expected = 0.5 + 0.4 * direction(*np.array(found.uv)[:, is_bowl])
    np.testing.assert_allclose(colour[:, is_bowl], expected.T, atol=0.02)


SHARED = f"""<scene version="3.0.0"><shape type="cube" id="part"/><emitter type="constant"/>
<shape type="shapegroup" id="first"><ref id="part"/></shape>
<shape type="shapegroup" id="second"><ref id="part"/></shape>
{instance("left", "first", -4, 0)}{instance("right", "second", 4, 0)}</scene>"""


def test_instances_of_a_mesh_that_several_groups_share_are_not_lost(tmp_path):
    file = tmp_path / "shared.xml"
    file.write_text(SHARED)
    merged = merge_meshes(load_scene(file))
    rays = mi.Ray3f(mi.Point3f([-4.0, 0.0, 4.0], 0.1, 5.0), mi.Vector3f(0.0, 0.0, -1.0))
    assert np.array(merged.scene.ray_intersect(rays).is_valid()).all()


def test_textures_of_a_shape_stay_its_own(tmp_path):
    tinted = """<shape type="cube" id="{}"><texture type="checkerboard" name="vertex_tint"/>
<ref id="red"/></shape>"""
    file = tmp_path / "boxes.xml"
    file.write_text(SCENE.replace("</scene>", tinted.format("f") + tinted.format("g") + "</scene>"))
    assert members(merge_meshes(load_scene(file))) == [[1, 3, 4], [2, 5], [6], [7], [8], [9]]


@pytest.mark.parametrize("is_instanced", [False, True])
def test_a_mesh_without_triangles_is_refused(tmp_path, is_instanced):
    vertices = "element vertex 0\nproperty float x\nproperty float y\nproperty float z\n"
    faces = "element face 0\nproperty list uchar int vertex_indices\n"
    (tmp_path / "empty.ply").write_text(f"ply\nformat ascii 1.0\n{vertices}{faces}end_header\n")
    empty = '<shape type="ply" id="void"><string name="filename" value="empty.ply"/>'
    empty += '<boolean name="face_normals" value="true"/></shape>'
    if is_instanced:
        empty = f'<shape type="shapegroup" id="g">{empty}</shape><shape type="instance"><ref id="g"/></shape>'
    file = tmp_path / "scene.xml"
    file.write_text(f'<scene version="3.0.0">{empty}</scene>')
    with pytest.raises(SceneError, match="the mesh void has no triangles"):
        load_scene(file)


def test_meshes_of_equal_materials_become_one_shape(tmp_path):
    """However often the material is written; not where the id of one has a meaning."""
    paint = '<bsdf type="twosided"><bsdf type="roughplastic"/></bsdf>'

    def shapes(more=""):
        cubes = "".join(placed("cube", f"cube {i}", (i, 0, 0), paint) for i in range(5))
        renderer = opened(tmp_path, f'<scene version="3.0.0">{cubes}{more}<emitter type="constant"/></scene>')
        return len(renderer._scene.shapes()), renderer.describe().shapes

    assert shapes() == (1, tuple(f"cube {i}" for i in range(5)))
    assert (
        shapes(placed("cube", "lid", (9, 0, 0), '<bsdf type="diffuse" id="hidden from the camera"/>'))[0] == 6
    )
