"""What contestants do, beside the race."""

from dataclasses import replace

import pytest

from enfilade.errors import SceneError
from enfilade.monitor import Silence
from enfilade.pipeline.job import Job
from enfilade.renderer import PixelFilter
from enfilade.settings import Settings
from scenes_analytic import room, room_walk
from small_runs import colors, job_of
from studies.bench.tasks import EveryFrame, Interpolated


@pytest.mark.parametrize("task", [lambda job: EveryFrame(job, PixelFilter.BOX), Interpolated])
def test_a_scene_that_reaches_for_other_files_is_refused_before_it_is_loaded(tmp_path, task):
    scene = tmp_path / "scene.xml"
    mesh = '<shape type="ply"><string name="filename" value="/elsewhere/mesh.ply"/></shape>'
    scene.write_text(f'<scene version="3.0.0">{mesh}</scene>')
    job = Job(scene, room_walk(2, size=(8, 6)), Settings(), "reference")
    with pytest.raises(SceneError, match="--allow /elsewhere"):
        task(job).run(tmp_path / "run", Silence())
    assert not (tmp_path / "run").exists()


def interpolated(folder, path, **tables):
    job = job_of(folder, room(), path, method="reference", **tables)
    Interpolated(job).run(folder / "run", Silence())
    return colors(folder / "run")


def test_minterpolate_knows_highlights_that_the_exposure_shows(tmp_path):
    lamp = interpolated(tmp_path, room_walk(5, size=(64, 48)), viewing={"exposure_ev": -2.0})[2].max()
    assert lamp > 1.3  # its in-betweens are not cut off at white before they are exposed


def test_minterpolate_rests_where_the_camera_does(tmp_path):
    walk = room_walk(10, size=(64, 48))
    cameras = [*walk.cameras[:4], *[walk.cameras[3]] * 6, *walk.cameras[4:]]
    path = replace(walk, cameras=tuple(cameras), numbers=tuple(range(1, 17)))
    found = interpolated(tmp_path, path)
    assert all((found[frame] == found[3]).all() for frame in range(4, 10))
    assert (found[10] != found[3]).any()
