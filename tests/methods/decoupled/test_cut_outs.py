"""Cut-outs and sheer surfaces before a wall: the light behind them, and the cached irradiance on them."""

import drjit as dr
import numpy as np
import pytest
from PIL import Image

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.decoupled import Decoupled, specular_rays
from enfilade.methods.decoupled.path_kernels import PathKernels
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from enfilade.scene.mitsuba.renderer import MitsubaRenderer
from support.in_memory import run_passes, walk_of

SIZE = 96, 72
MIDDLE = 1  # frame
CAMERAS = tuple(Camera(look_at((x, 0.0, 4), (0, 0, 0)), 40, *SIZE) for x in (0.0, 0.02, 0.04))
PATH = CameraPath(CAMERAS, (1, 2, 3), 24.0)

pytestmark = pytest.mark.slow


def opened(folder, opacity: str) -> MitsubaRenderer:
    """A dark card of an opacity before a bright wall."""
    card = (
        '<shape type="rectangle" id="card"><transform name="to_world"><scale value="1.2"/></transform>'
        f'<bsdf type="mask">{opacity}<bsdf type="twosided"><bsdf type="diffuse">'
        '<rgb name="reflectance" value="0.1"/></bsdf></bsdf></bsdf></shape>'
    )
    wall = (
        '<shape type="rectangle"><transform name="to_world"><scale value="6"/><translate z="-2"/></transform>'
        '<bsdf type="diffuse"><rgb name="reflectance" value="0.8"/></bsdf></shape>'
    )
    sky = '<emitter type="constant"><rgb name="radiance" value="0.8"/></emitter>'
    file = folder / "scene.xml"
    file.write_text(f'<scene version="3.0.0"><integrator type="path"/>{card}{wall}{sky}</scene>')
    return MitsubaRenderer(file)


@pytest.mark.parametrize("texels", [4, 12])
def test_contours_of_cut_outs_are_those_of_path_tracing(tmp_path, texels):
    """Squares whose opacity is interpolated over one texel: two pixels, or less than one."""
    squares = np.kron(np.indices((4, 4)).sum(axis=0) % 2, np.ones((texels, texels))) * 255
    Image.fromarray(squares.astype(np.uint8)).save(tmp_path / "squares.png")
    renderer = opened(
        tmp_path,
        '<texture type="bitmap" name="opacity"><string name="filename" value="squares.png"/>'
        '<boolean name="raw" value="true"/></texture>',
    )
    found = run_passes(Decoupled(), walk_of(PATH, renderer)).colors[MIDDLE].sum(axis=2)
    pixels, key = np.arange(SIZE[0] * SIZE[1], dtype=np.uint32), RandomKey(1, MIDDLE, Purpose.REFERENCE)
    traced = renderer.trace(CAMERAS[MIDDLE], pixels, key, spp=256, pixel_filter=PixelFilter.GAUSSIAN)
    expected = traced.color.reshape(SIZE[1], SIZE[0], 3).sum(axis=2)
    wall, card = np.percentile(expected, (98, 2))
    is_contour = (expected > card + 0.1 * (wall - card)) & (expected < wall - 0.1 * (wall - card))
    assert 0.1 < is_contour.mean() < 0.4
    assert found[is_contour].sum() == pytest.approx(expected[is_contour].sum(), rel=0.02)
    assert np.sqrt(np.square(found - expected)[is_contour].mean()) < 0.045 * wall


def test_irradiance_on_sheer_surfaces_is_cached(tmp_path, monkeypatch):
    estimated, begin = [], PathKernels.__init__

    def counted(kernels, renderer):
        begin(kernels, renderer)
        estimate = kernels.estimate

        def estimate_and_count(guide, depth_weights, path):
            estimated.append(int(dr.count(path.is_active)[0]))
            return estimate(guide, depth_weights, path)

        kernels.estimate = estimate_and_count

    monkeypatch.setattr(PathKernels, "__init__", counted)
    method, walk = Decoupled(), walk_of(PATH, opened(tmp_path, '<float name="opacity" value="0.3"/>'))
    run, counts = method.run, {"hash_grid": [], "shading": []}

    def run_and_count(task, *context):
        estimated.clear()
        output = run(task, *context)
        counts.setdefault(task.pass_name, []).append(sum(estimated))
        return output

    monkeypatch.setattr(method, "run", run_and_count)
    rays = run_passes(method, walk).metadata("shading", MIDDLE)["rays"]["camera"]
    assert max(counts["shading"]) < 0.02 * rays
    assert min(counts["hash_grid"]) > 0


def test_a_sheer_surface_is_filtered(tmp_path, monkeypatch):
    """The G-buffer shows the wall behind it; that does not make it thinner than a pixel."""
    sampled, own = [], specular_rays.filter_spatially
    monkeypatch.setattr(
        specular_rays,
        "filter_spatially",
        lambda virtual, aovs, where, **given: sampled.append(where) or own(virtual, aovs, where, **given),
    )
    renderer = opened(tmp_path, '<float name="opacity" value="0.3"/>')
    run_passes(Decoupled(), walk_of(PATH, renderer))
    height, width = SIZE[1], SIZE[0]
    assert len(sampled) == len(PATH)
    assert sampled[MIDDLE][height // 4 : -height // 4, width // 4 : -width // 4].all()
