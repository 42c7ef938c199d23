"""Light in the corners of a room, against path tracing."""

import numpy as np
import pytest

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.decoupled import Decoupled
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from enfilade.scene.mitsuba.renderer import MitsubaRenderer
from support.in_memory import run_passes, walk_of

SIZE = 64, 36
MIDDLE = 1  # frame
CAMERAS = tuple(Camera(look_at((x, 1.4, 2.2), (0, 1.5, -3)), 70, *SIZE) for x in (0.0, 0.02, 0.04))
CORNERS = np.s_[[10, 11, 24, 25], 16:22]  # of the back wall with ceiling and floor, beside the lamp
# Prepass images of half this size, averaged across the corners, make them 15 % too bright.
TOO_BRIGHT = 0.1

pytestmark = pytest.mark.slow


def test_corners_are_as_dark_as_those_of_path_tracing(tmp_path):
    walls = [  # scale, rotation, translation
        ('x="3" y="3"', '<rotate x="1" angle="-90"/>', ""),
        ('x="3" y="3"', '<rotate x="1" angle="90"/>', 'y="3"'),
        ('x="3" y="1.5"', "", 'y="1.5" z="-3"'),
        ('x="3" y="1.5"', '<rotate y="1" angle="180"/>', 'y="1.5" z="3"'),
        ('x="3" y="1.5"', '<rotate y="1" angle="-90"/>', 'x="3" y="1.5"'),
        ('x="3" y="1.5"', '<rotate y="1" angle="90"/>', 'x="-3" y="1.5"'),
    ]
    white = '<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.75"/></bsdf></bsdf>'
    room = "".join(
        '<shape type="rectangle">'
        f'<transform name="to_world"><scale {scale}/>{turn}<translate {at}/></transform>{white}</shape>'
        for scale, turn, at in walls
    )
    lamp = (
        '<shape type="rectangle"><transform name="to_world"><scale value="0.4"/><rotate y="1" angle="90"/>'
        '<translate x="-2.9" y="1.5" z="-1.5"/></transform>'
        '<emitter type="area"><rgb name="radiance" value="30"/></emitter></shape>'
    )
    file = tmp_path / "scene.xml"
    file.write_text(f'<scene version="3.0.0"><integrator type="path"/>{room}{lamp}</scene>')
    renderer, path = MitsubaRenderer(file), CameraPath(CAMERAS, (1, 2, 3), 24.0)
    walks = [walk_of(path, renderer, trace={"seed": seed}) for seed in (0, 1)]
    found = np.mean([run_passes(Decoupled(), walk).colors[MIDDLE] for walk in walks], axis=0)
    key, pixels = RandomKey(1, MIDDLE, Purpose.REFERENCE), np.arange(SIZE[0] * SIZE[1], dtype=np.uint32)
    traced = renderer.trace(CAMERAS[MIDDLE], pixels, key, spp=1024, pixel_filter=PixelFilter.GAUSSIAN)
    expected = traced.color.reshape(found.shape)
    assert -0.02 < found[CORNERS].sum() / expected[CORNERS].sum() - 1.0 < TOO_BRIGHT
    assert found.sum() / expected.sum() == pytest.approx(1.0, abs=0.006)
