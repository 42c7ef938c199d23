"""Filling the hash grid: how many paths, and which surfaces have estimates."""

import pytest

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.base import TaskId
from enfilade.methods.decoupled import Decoupled
from enfilade.methods.decoupled.hash_grid_fill import gather_spp
from enfilade.scene.mitsuba.renderer import MitsubaRenderer
from support.in_memory import InMemory, walk_of

ROOM = """<scene version="3.0.0"><integrator type="path"/>
<shape type="cube"><boolean name="flip_normals" value="true"/><bsdf type="diffuse"/></shape>
<shape type="rectangle"><transform name="to_world"><scale value="0.3"/><rotate x="1" angle="90"/>
<translate y="0.99"/></transform><emitter type="area"/></shape></scene>"""


@pytest.mark.parametrize(
    ("width", "height", "spp"), [(64, 36, 2), (320, 180, 2), (480, 270, 2), (640, 360, 1), (944, 528, 1)]
)
def test_larger_frames_have_fewer_gather_rays_a_pixel_and_no_pixel_has_none(width, height, spp):
    assert gather_spp(width * height) == spp


def test_gather_rays_estimate_what_other_keyframes_show(tmp_path):
    # Final gathers look up the hash grid before the prepass images of other keyframes. If surfaces that these
    # show had no estimates, entries at their borders would have the light of hidden places alone.
    (tmp_path / "scene.xml").write_text(ROOM)
    renderer = MitsubaRenderer(tmp_path / "scene.xml")

    def estimates(other):
        """Number of estimates from the first of two keyframes, by the view of the other one."""
        views = [look_at((0, 0, 0.5), (0, 0, -1)), other]
        walk = walk_of(CameraPath(tuple(Camera(view, 60, 48, 32) for view in views), (1, 2), 24.0), renderer)
        method, results = Decoupled(), InMemory(walk)
        for task in method.tasks(results.analysis):
            if task.pass_name in ("prepass", "hash_grid"):
                output = method.run(task, results, walk)
                results.task_metadata[task.id] = dict(output.metadata)
                results.records |= {TaskId(task.pass_name, f): of for f, of in output.records.items()}
        return results.record("hash_grid", 0).counts.sum()

    same, behind = estimates(look_at((0, 0, 0.5), (0, 0, -1))), estimates(look_at((0, 0, -0.9), (0, 0, 1)))
    assert same > 1000
    assert behind == same
