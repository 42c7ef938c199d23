"""Merged meshes: the same surfaces, under the same names, in fewer shapes."""

import numpy as np
import pytest

from enfilade.camera.pinhole import Camera, look_at
from enfilade.gbuffer import find_geometry
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from enfilade.scene.mitsuba import renderer as module
from enfilade.scene.mitsuba.load import load_scene
from enfilade.scene.mitsuba.merge import MergedScene, merge_meshes
from enfilade.scene.opener import Scene
from enfilade.settings import Settings

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
    np.testing.assert_array_equal(merged.emitters.shape_index, unmerged.emitters.shape_index)
    np.testing.assert_array_equal(merged.emitters.position, unmerged.emitters.position)


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


def test_a_scene_with_instances_stays_as_it_is(tmp_path):
    group = """<shape type="shapegroup" id="group"><shape type="cube"/></shape>
<shape type="instance" id="copy"><ref id="group"/>
  <transform name="to_world"><translate z="-4"/></transform></shape>
</scene>"""
    renderer = opened(tmp_path, SCENE.replace("</scene>", group))
    assert renderer.describe().shapes == ("a", "b", "c", "d", "e", "ball", "lamp", "copy")
    merged = merge_meshes(load_scene(tmp_path / "boxes.xml"))
    assert [source.tolist() for source in merged.sources] == [[i] for i in range(1, 9)]
