"""Edges of glossy surfaces, against path tracing."""

from pathlib import Path

import numpy as np
import pytest

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera, look_at
from enfilade.kernels.tone import srgb_encode
from enfilade.methods.decoupled import Decoupled, specular_rays
from enfilade.methods.decoupled.adaptive_sampling import AdaptiveSampling
from enfilade.methods.decoupled.edges import dilated
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from enfilade.scene.mitsuba.renderer import MitsubaRenderer
from support.in_memory import run_passes, walk_of

SIZE = 64, 48
MIDDLE = 1  # frame
CAMERAS = tuple(Camera(look_at((x, 0.3, 4), (0, 0, 0)), 40, *SIZE) for x in (0.0, 0.05, 0.1))
PATH = CameraPath(CAMERAS, (1, 2, 3), 24.0)

pytestmark = pytest.mark.slow


METAL = (
    '<bsdf type="roughconductor"><string name="material" value="Al"/><float name="alpha" value="0.2"/></bsdf>'
)
PLASTIC = (
    '<bsdf type="roughplastic"><float name="alpha" value="0.2"/>'
    '<rgb name="diffuse_reflectance" value="0.2"/></bsdf>'
)


FINE_TEXTURE = (
    '<bsdf type="roughplastic"><float name="alpha" value="0.2"/><rgb name="diffuse_reflectance" value="0"/>'
    '<texture name="specular_reflectance" type="checkerboard"><rgb name="color0" value="0"/>'
    '<rgb name="color1" value="1"/><transform name="to_uv"><scale x="60" y="60"/></transform></texture>'
    "</bsdf>"
)


def blocks(folder: Path, bsdf: str, *, wall: float, sky: float) -> MitsubaRenderer:
    """Three blocks, one of them thin, before a diffuse wall."""
    shapes = "".join(
        f'<shape type="cube"><transform name="to_world"><scale x="{width}" y="0.5" z="0.2"/>'
        f'<rotate z="1" angle="{angle}"/><rotate y="1" angle="30"/><translate x="{x}"/></transform>'
        f"{bsdf}</shape>"
        for x, width, angle in [(-0.9, 0.3, 10), (0.0, 0.05, 20), (0.8, 0.25, 35)]
    )
    behind = (
        '<shape type="rectangle"><transform name="to_world"><scale value="4"/><translate z="-1"/></transform>'
        f'<bsdf type="diffuse"><rgb name="reflectance" value="{wall}"/></bsdf></shape>'
    )
    light = f'<emitter type="constant"><rgb name="radiance" value="{sky}"/></emitter>'
    file = folder / "scene.xml"
    file.write_text(f'<scene version="3.0.0"><integrator type="path"/>{shapes}{behind}{light}</scene>')
    return MitsubaRenderer(file)


def displayed(radiance: np.ndarray) -> np.ndarray:
    return srgb_encode(np.clip(radiance, 0.0, 1.0).astype(np.float32))


def edge_error(renderer: MitsubaRenderer) -> float:
    """RMS error of displayed values of the middle frame, at the edges of the blocks."""
    walk = walk_of(PATH, renderer)
    found = displayed(run_passes(Decoupled(), walk).colors[MIDDLE])
    key = RandomKey(1, MIDDLE, Purpose.REFERENCE)
    pixels = np.arange(SIZE[0] * SIZE[1], dtype=np.uint32)
    traced = renderer.trace(CAMERAS[MIDDLE], pixels, key, spp=1024, pixel_filter=PixelFilter.GAUSSIAN)
    expected = displayed(traced.color.reshape(found.shape))
    is_edge, is_thin = specular_rays.surface_edges(walk.view(MIDDLE).geometry)
    where = is_edge | is_thin
    assert 0.05 < where.mean() < 0.5
    return float(np.sqrt(np.square(found - expected)[where].mean()))


def test_edges_of_glossy_surfaces_are_those_of_path_tracing(tmp_path, monkeypatch):
    # Brushed metal before a black wall: all light is specular.
    renderer = blocks(tmp_path, METAL, wall=0.01, sky=0.7)
    error = edge_error(renderer)
    assert error < 0.06
    # The centres of pixels alone give aliased edges.
    monkeypatch.setattr(AdaptiveSampling, "has_visible_contrast", lambda *_: np.zeros(SIZE[::-1], bool))
    assert error < 0.5 * edge_error(renderer)


def test_faint_edges_of_glossy_surfaces_are_antialiased(tmp_path, monkeypatch):
    # Highlights on plastic differ from face to face by some levels of 255.
    renderer = blocks(tmp_path, PLASTIC, wall=0.2, sky=0.25)
    error = edge_error(renderer)
    assert error < 0.0035
    # A threshold of twice the tolerance, that is contrasts of four times it, leaves them aliased.
    monkeypatch.setattr(specular_rays, "SPECULAR_CONTRAST", 2.0)
    assert error < 0.7 * edge_error(renderer)


def test_specular_rays_at_edges_cover_what_the_pixel_shows_of_its_surface(tmp_path, monkeypatch):
    # A texture finer than pixels: what a centre shows is not what its pixel shows.
    renderer = blocks(tmp_path, FINE_TEXTURE, wall=0.01, sky=20.0)
    error = edge_error(renderer)
    centre = np.zeros((*SIZE[::-1], 2), np.float32)
    monkeypatch.setattr(specular_rays, "own_sides", lambda _: (centre, centre))
    through_centres = edge_error(renderer)
    assert error < 0.5 * through_centres


def test_narrow_surfaces_may_have_more_rays(tmp_path, monkeypatch):
    renderer = blocks(tmp_path, METAL, wall=0.01, sky=0.7)
    walk = walk_of(PATH, renderer)
    chosen = []
    monkeypatch.setattr(AdaptiveSampling, "reduce_noise", lambda *given: chosen.append(given[3]))
    run_passes(Decoupled(), walk)
    assert len(chosen) == len(walk.path)
    found = chosen[MIDDLE]
    # Narrow parts of the blocks; of the wall, which has no specular lobe, pixels whose rays meet a block.
    geometry = walk.view(MIDDLE).geometry
    is_edge, is_thin = specular_rays.surface_edges(geometry)
    is_block = np.isin(geometry.shape_index, [1, 2, 3])
    expected = specular_rays.narrow_surfaces(is_edge, is_block) & ~is_thin
    assert expected.sum() > 50
    assert found[expected].all()
    assert not found[~dilated(dilated(is_block))].any()


@pytest.mark.parametrize("rods", [np.linspace(-1.1, 1.1, 12), [0.02]])
def test_metal_thinner_than_a_pixel_reflects(tmp_path, rods):
    """The centres of pixels meet some of many rods, and not the single one."""
    shapes = "".join(
        f'<shape type="cylinder"><point name="p0" x="{x}" y="-1" z="0"/>'
        f'<point name="p1" x="{x}" y="1" z="0"/><float name="radius" value="0.006"/>{METAL}</shape>'
        for x in rods
    )
    sky = '<emitter type="constant"><rgb name="radiance" value="0.7"/></emitter>'
    wall = (
        '<shape type="rectangle"><transform name="to_world"><scale value="4"/><translate z="-1"/></transform>'
        '<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf></shape>'
    )
    file = tmp_path / "scene.xml"
    file.write_text(f'<scene version="3.0.0"><integrator type="path"/>{shapes}{wall}{sky}</scene>')
    renderer = MitsubaRenderer(file)
    walk = walk_of(PATH, renderer)
    assert (walk.view(MIDDLE).geometry.shape_index <= len(rods)).any() == (len(rods) > 1)
    found = run_passes(Decoupled(), walk).colors[MIDDLE]
    key = RandomKey(1, MIDDLE, Purpose.REFERENCE)
    pixels = np.arange(SIZE[0] * SIZE[1], dtype=np.uint32)
    traced = renderer.trace(CAMERAS[MIDDLE], pixels, key, spp=256, pixel_filter=PixelFilter.GAUSSIAN)
    columns, expected = (of.reshape(*SIZE[::-1], 3).mean(axis=(0, 2)) for of in (found, traced.color))
    assert found.mean() == pytest.approx(traced.color.mean(), rel=0.15)
    assert np.abs(columns - expected).max() < 0.25 * expected.max()
