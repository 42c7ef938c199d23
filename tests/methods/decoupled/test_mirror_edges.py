"""Edges seen in a mirror: thin bars before a bright sky, against path tracing."""

import numpy as np
import pytest

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera, look_at
from enfilade.kernels.tone import srgb_encode
from enfilade.methods.decoupled import Decoupled
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from enfilade.scene.mitsuba.renderer import MitsubaRenderer
from support.in_memory import run_passes, walk_of

SIZE = 64, 48
MIDDLE = 2  # frame
CAMERAS = tuple(Camera(look_at((x, 0.1, 3), (0, 0, 0)), 40, *SIZE) for x in np.linspace(0.0, 0.2, 5))
PATH = CameraPath(CAMERAS, tuple(range(1, 6)), 24.0)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def renderer(tmp_path_factory) -> MitsubaRenderer:
    # A pixel is 0.1 wide where the bars are seen.
    bars = "".join(
        f'<shape type="cube" id="bar {k}"><transform name="to_world"><scale x="{width / 2}" y="4" z="0.02"/>'
        f'<rotate z="1" angle="{angle}"/><translate x="{x}" z="5"/></transform><bsdf type="diffuse">'
        '<rgb name="reflectance" value="0.01"/></bsdf></shape>'
        for k, (x, width, angle) in enumerate(
            [(-1.5, 0.2, 0), (-0.4, 0.3, 20), (0.6, 0.4, 70), (1.6, 0.4, 5)]
        )
    )
    mirror = (
        '<shape type="rectangle"><transform name="to_world"><scale value="3"/></transform>'
        '<bsdf type="conductor"/></shape>'
    )
    sky = '<emitter type="constant"><rgb name="radiance" value="16"/></emitter>'
    file = tmp_path_factory.mktemp("bars") / "scene.xml"
    file.write_text(f'<scene version="3.0.0"><integrator type="path"/>{bars}{mirror}{sky}</scene>')
    return MitsubaRenderer(file)


def displayed(radiance: np.ndarray) -> np.ndarray:
    return srgb_encode(np.clip(radiance, 0.0, 1.0).astype(np.float32))


def error(renderer: MitsubaRenderer) -> float:
    """RMS error of displayed values of the middle frame, where bars are seen."""
    walk = walk_of(PATH, renderer, keyframes={"spacing": 4})
    found = displayed(run_passes(Decoupled(), walk).colors[MIDDLE])
    key = RandomKey(1, MIDDLE, Purpose.REFERENCE)
    pixels = np.arange(SIZE[0] * SIZE[1], dtype=np.uint32)
    traced = renderer.trace(CAMERAS[MIDDLE], pixels, key, spp=2048, pixel_filter=PixelFilter.GAUSSIAN)
    expected = displayed(traced.color.reshape(found.shape))
    beside = (expected < 0.98).any(axis=2)
    assert 0.04 < beside.mean() < 0.4
    return float(np.sqrt(np.square(found - expected)[beside].mean()))


def test_edges_in_a_mirror_are_those_of_path_tracing(renderer):
    # 0.26 with four rays a pixel, as everywhere else.
    assert error(renderer) < 0.11
