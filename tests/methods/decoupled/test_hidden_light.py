"""A spot behind a partition lights a floor that the camera does not see: all light is indirect."""

import numpy as np

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.decoupled import Decoupled
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from support.in_memory import run_passes, walk_of
from support.mitsuba_scene import opened, rgb, write

SIZE = (64, 36)
CAMERAS = [Camera(look_at((x, 0.0, 3.2), (0, 0, 0)), 45.0, *SIZE) for x in (0.0, 0.05)]
TURNS = {
    "floor": '<rotate x="1" angle="-90"/><translate y="-1"/>',
    "ceiling": '<rotate x="1" angle="90"/><translate y="1"/>',
    "back": '<translate z="-1"/>',
    "left": '<rotate y="1" angle="90"/><translate x="-1"/>',
    "right": '<rotate y="1" angle="-90"/><translate x="1"/>',
    "partition": '<scale x="0.6" y="0.7"/><translate y="-0.3" z="0.3"/>',
}
GREY = f'<bsdf type="twosided"><bsdf type="diffuse">{rgb("reflectance", 0.7, 0.7, 0.7)}</bsdf></bsdf>'
WALLS = "".join(
    f'<shape type="rectangle" id="{name}"><transform name="to_world">{turn}</transform>{GREY}</shape>'
    for name, turn in TURNS.items()
)
SPOT = f"""<emitter type="spot"><transform name="to_world">
<lookat origin="0, 0.9, -0.3" target="0, -1, -0.3" up="0, 0, 1"/></transform>
<float name="cutoff_angle" value="15"/>{rgb("intensity", 10, 10, 10)}</emitter>"""


def test_the_room_is_as_bright_as_by_path_tracing(tmp_path):
    head = '<scene version="3.0.0"><integrator type="path"/>'
    renderer = opened(write(tmp_path, WALLS, SPOT, head=head, sky=""))
    walk = walk_of(CameraPath(tuple(CAMERAS), (1, 2), 24.0), renderer, decoupled={"quality": 60.0})
    ours = run_passes(Decoupled(), walk).colors[0]
    pixels, key = np.arange(SIZE[0] * SIZE[1], dtype=np.uint32), RandomKey(1, 0, Purpose.REFERENCE)
    traced = renderer.trace(CAMERAS[0], pixels, key, spp=256, pixel_filter=PixelFilter.GAUSSIAN)
    assert 0.93 < ours.mean() / traced.color.mean() < 1.15
