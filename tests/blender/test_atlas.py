"""BSDFs that differ in baked textures alone: the surfaces stay as they were, by Mitsuba."""

import itertools
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from PIL import Image

from enfilade.kernels.tone import srgb_decode
from enfilade_blender.image_files import srgb_from_linear, write_png
from enfilade_blender.materials import atlas
from enfilade_blender.materials.textures import FLIP, bitmap
from enfilade_blender.ply import Mesh, write_ply
from enfilade_blender.scene_xml import named, plugin, reference, write_scene

UNIT = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


class Files:
    """Textures of a folder, without Blender: PNG files by any name."""

    def __init__(self, folder: Path):
        self.folder = folder
        (folder / "textures").mkdir()

    def size(self, file):
        with Image.open(self.folder / file) as image:
            return image.size

    def stored(self, file, *, raw):
        with Image.open(self.folder / file) as image:
            values = np.asarray(image, np.float32) / 255.0
        return values if raw else srgb_decode(values)

    def write(self, name, image, *, raw, is_exact=False):
        file = f"textures/{name}.{'exr' if is_exact else 'png'}"
        write_png(self.folder / file, image if raw else srgb_from_linear(image))
        return file


class Tiles:
    """Unit squares in a row, each with a BSDF of its own, and a texture of random colours or a colour."""

    def __init__(self, folder, kinds, *, raw=False, is_exact=False):
        self.folder, self.textures, self.bsdfs, self.shapes = folder, Files(folder), [], []
        rng = np.random.default_rng(3)
        normals = np.broadcast_to(np.array([0, 0, 1], np.float32), (2, 3, 3))
        for number, kind in enumerate(kinds):
            colour = kind
            if isinstance(kind, int):
                image = rng.random((kind, kind, 3), np.float32)
                file = self.textures.write(f"tile {number}", image, raw=raw, is_exact=is_exact)
                colour = bitmap(file, raw=raw, wrap="repeat", matrix=FLIP)
            self.bsdfs.append(named(plugin("bsdf", "diffuse", reflectance=colour), f"tile {number}"))
            positions = UNIT + np.array([number, 0, 0], np.float32)
            uv = UNIT[TRIANGLES][..., :2]
            mesh = Mesh(positions, TRIANGLES, normals, {"UV": uv}, {}, np.zeros(2, np.int32), "UV")
            write_ply(folder / f"{number}.ply", mesh, "UV")
            shape = plugin("shape", "ply", reference(f"tile {number}"), filename=f"{number}.ply")
            self.shapes.append(named(shape, f"shape {number}"))

    def reflectance(self, bsdfs, inset=0.0):
        """Of points of all squares, (N, 3); near their borders too if there is no inset."""
        write_scene(self.folder / "scene.xml", [*bsdfs, *self.shapes])
        scene = mi.load_file(str(self.folder / "scene.xml"))
        x, y = np.random.default_rng(4).uniform(inset, 1.0 - inset, (2, 500)).astype(np.float32)
        x = (x + np.arange(len(self.shapes))[:, None]).astype(np.float32).ravel()
        y = np.tile(y, len(self.shapes))
        ray = mi.Ray3f(mi.Point3f(x, y, 1.0), mi.Vector3f(0.0, 0.0, -1.0))
        hit = scene.ray_intersect(ray)
        return np.array(hit.bsdf(ray).eval_diffuse_reflectance(hit)).T

    def shared(self, baked=None):
        baked = [one.get("id") for one in self.bsdfs] if baked is None else baked
        return atlas.share_bsdfs(self.bsdfs, self.shapes, baked, self.textures, self.folder)


@pytest.mark.parametrize("raw", [False, True])
def test_textures_of_one_material_are_packed_and_look_the_same(tmp_path, raw):
    tiles = Tiles(tmp_path, [8, 32, 8, 16, 16, 8], raw=raw)
    before = tiles.reflectance(tiles.bsdfs, inset=1 / 16)
    after = tiles.reflectance(shared := tiles.shared(), inset=1 / 16)
    assert len(shared) == 1
    assert {shape.find("ref").get("id") for shape in tiles.shapes} == {shared[0].get("id")}
    np.testing.assert_allclose(after, before, atol=0.01)
    assert before.std() > 0.1


def test_borders_do_not_show_the_neighbour_in_the_atlas(tmp_path):
    tiles = Tiles(tmp_path, [8, 8, 8, 8])
    white = np.ones((8, 8, 3), np.float32)
    for number in range(4):
        tiles.textures.write(f"tile {number}", white * (number % 2), raw=False)
    after = tiles.reflectance(tiles.shared())
    assert np.array_equal(np.unique(after.round(5)), [0.0, 1.0])


def test_an_atlas_of_exact_textures_is_exact(tmp_path):
    (shared,) = Tiles(tmp_path, [8, 8], is_exact=True).shared()
    assert shared.find(".//string[@name='filename']").get("value") == "textures/tile 0 atlas.exr"


def test_equal_bsdfs_are_one_and_others_stay(tmp_path):
    tiles = Tiles(tmp_path, [(0.2, 0.3, 0.4), (0.2, 0.3, 0.4), (0.2, 0.3, 0.5), 8, 8])
    before = tiles.reflectance(tiles.bsdfs)
    shared = tiles.shared(baked=[])
    assert [one.get("id") for one in shared] == ["tile 0", "tile 2", "tile 3", "tile 4"]
    np.testing.assert_array_equal(tiles.reflectance(shared), before)


def test_an_emitter_with_a_texture_keeps_its_own(tmp_path):
    tiles = Tiles(tmp_path, [8, 8, 8])
    file = tiles.textures.write("glow", np.ones((8, 8, 3), np.float32), raw=False)
    glow = bitmap(file, raw=False, wrap="repeat", matrix=FLIP)
    tiles.shapes[1].append(plugin("emitter", "area", radiance=glow))
    assert [one.get("id") for one in tiles.shared()] == ["tile 0", "tile 1"]


def test_squares_of_an_atlas_do_not_overlap_and_those_of_many_have_several(monkeypatch):
    monkeypatch.setattr(atlas, "LARGEST_PX", 100)
    sides = [60, 10, 33, 18, 18, 18, 50, 34, 66, 10, 10, 130]
    layouts = atlas._layouts(sides)
    assert sorted(number for numbers, _, _ in layouts for number in numbers) == list(range(len(sides)))
    assert len(layouts) > 1
    for numbers, corners, (height, width) in layouts:
        boxes = [(*corner, sides[number]) for number, corner in zip(numbers, corners, strict=True)]
        assert all(row + side <= height and column + side <= width for row, column, side in boxes)
        for (r, c, s), (row, column, side) in itertools.combinations(boxes, 2):
            assert r + s <= row or row + side <= r or c + s <= column or column + side <= c
