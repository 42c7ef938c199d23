"""Textures that colour metal stay sharp, against path tracing."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.decoupled import Decoupled
from enfilade.methods.decoupled.edges import dilated
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from enfilade.scene.mitsuba.renderer import MitsubaRenderer
from support.in_memory import run_passes, walk_of

SIZE = 64, 48
MIDDLE = 1  # frame
CAMERAS = tuple(Camera(look_at((x, 0, 4), (x, 0, 0)), 40, *SIZE) for x in (0.0, 0.05, 0.1))
PATH = CameraPath(CAMERAS, (1, 2, 3), 24.0)
TEXELS = 40  # the size of two pixels
METALS = {
    "principled": '<bsdf type="principled">{base_color}<float name="metallic" value="0.8"/>'
    '<float name="roughness" value="0.5"/></bsdf>',
    "roughconductor": '<bsdf type="roughconductor"><string name="material" value="Al"/>'
    '<float name="alpha" value="0.25"/>{specular_reflectance}</bsdf>',
}


def tiles(
    folder: Path, metal: str, levels: tuple[int, int] = (40, 256), placed: str = '<scale value="2.5"/>'
) -> MitsubaRenderer:
    """A wall of metal that faces the camera, its texture of a range of levels, with a lamp before it."""
    random = np.random.default_rng(3)
    Image.fromarray(random.integers(*levels, (TEXELS, TEXELS, 3), np.uint8)).save(folder / "tiles.png")
    textures = {
        name: f'<texture type="bitmap" name="{name}"><string name="filename" value="tiles.png"/>'
        '<string name="filter_type" value="nearest"/></texture>'
        for name in ("base_color", "specular_reflectance")
    }
    wall = (
        '<shape type="rectangle"><transform name="to_world">'
        f"{placed}</transform>{METALS[metal].format(**textures)}</shape>"
    )
    lamp = (
        '<shape type="sphere"><point name="center" x="1.5" y="1.5" z="3"/><float name="radius" value="0.7"/>'
        '<emitter type="area"><rgb name="radiance" value="3"/></emitter></shape>'
    )
    sky = '<emitter type="constant"><rgb name="radiance" value="0.3"/></emitter>'
    file = folder / "scene.xml"
    file.write_text(f'<scene version="3.0.0"><integrator type="path"/>{wall}{lamp}{sky}</scene>')
    return MitsubaRenderer(file)


def texture_error(renderer: MitsubaRenderer, *, is_of_border: bool = False) -> float:
    """RMS error of the middle frame, or of its wall's border, over the deviation of the reference."""
    walk = walk_of(PATH, renderer)
    found = run_passes(Decoupled(), walk).colors[MIDDLE]
    is_wall = walk.view(MIDDLE).geometry.shape_index == 1
    where = is_wall & dilated(dilated(~is_wall)) if is_of_border else is_wall
    key = RandomKey(1, MIDDLE, Purpose.REFERENCE)
    pixels = np.arange(SIZE[0] * SIZE[1], dtype=np.uint32)
    traced = renderer.trace(CAMERAS[MIDDLE], pixels, key, spp=1024, pixel_filter=PixelFilter.GAUSSIAN)
    expected = traced.color.reshape(found.shape)
    return float(np.sqrt(np.square(found - expected)[where].mean()) / expected.std())


@pytest.mark.slow
@pytest.mark.parametrize("metal", METALS)
def test_textures_of_metal_are_not_blurred(tmp_path, monkeypatch, metal):
    renderer = tiles(tmp_path, metal)
    error = texture_error(renderer)
    # Filtered together with light, the texture is blurred, and has the noise of few rays.
    monkeypatch.setattr(MitsubaRenderer, "has_specular_texture", lambda _: False)
    assert error < 0.75 * texture_error(renderer)


@pytest.mark.slow
def test_borders_of_dark_metal_are_not_bright(tmp_path, monkeypatch):
    # Rays of pixels within the border miss the metal, and meet nothing specular.
    renderer = tiles(tmp_path, "roughconductor", (20, 30), '<scale value="0.8"/><rotate z="1" angle="40"/>')
    error = texture_error(renderer, is_of_border=True)
    monkeypatch.setattr(MitsubaRenderer, "has_specular_texture", lambda _: False)
    assert error < 1.1 * texture_error(renderer, is_of_border=True)
