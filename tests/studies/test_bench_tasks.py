"""What contestants do before they load a scene."""

import pytest

from enfilade.errors import SceneError
from enfilade.monitor import Silence
from enfilade.pipeline.job import Job
from enfilade.renderer import PixelFilter
from enfilade.settings import Settings
from enfilade.studies.bench.tasks import EveryFrame, Interpolated
from scenes_analytic import room_walk


@pytest.mark.parametrize("task", [lambda job: EveryFrame(job, PixelFilter.BOX), Interpolated])
def test_a_scene_that_reaches_for_other_files_is_refused_before_it_is_loaded(tmp_path, task):
    scene = tmp_path / "scene.xml"
    mesh = '<shape type="ply"><string name="filename" value="/elsewhere/mesh.ply"/></shape>'
    scene.write_text(f'<scene version="3.0.0">{mesh}</scene>')
    job = Job(scene, room_walk(2, size=(8, 6)), Settings(), "reference")
    with pytest.raises(SceneError, match="--allow /elsewhere"):
        task(job).run(tmp_path / "run", Silence())
    assert not (tmp_path / "run").exists()
