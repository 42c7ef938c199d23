import json
import sys
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from enfilade.cli import main
from made_up_runs import made_up_summary


@pytest.fixture
def run():
    def invoke(*arguments):
        return CliRunner().invoke(main, [str(a) for a in arguments], prog_name="enfilade")

    return invoke


@pytest.fixture
def camera_path(tmp_path):
    """Three frames of nerfstudio's format, 64x48."""
    identity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    cameras = [{"camera_to_world": identity, "fov": 50, "aspect": 4 / 3} for _ in range(3)]
    file = tmp_path / "camera_path.json"
    values = {"render_width": 64, "render_height": 48, "fps": 24, "camera_type": "perspective"}
    file.write_text(json.dumps({**values, "seconds": 0.125, "camera_path": cameras}))
    return file


@pytest.fixture
def jobs(monkeypatch):
    """Stands for the pipeline: takes the jobs that the command line makes, and does what it is told."""
    told = SimpleNamespace(seen=[], answer=made_up_summary(), error=None)

    def take(job):
        told.seen.append(job)
        if told.error is not None:
            raise told.error
        return told.answer

    def render(job, folder, monitor, crew, *, is_verified, is_tried):
        told.crew, told.is_verified = crew, is_verified
        answer = take(job)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "summary.json").write_text(json.dumps(answer))
        return answer

    def prepare(job, folder, *, is_tried):
        take(job)

    def plan(job, monitor, *, is_tried):
        answer = take(job)
        return SimpleNamespace(to_dict=lambda: answer)

    def fake(name, **members):
        monkeypatch.setitem(sys.modules, f"enfilade.pipeline.{name}", SimpleNamespace(**members))

    fake("job", Job=SimpleNamespace)
    fake("walkthrough", render=render, prepare=prepare)
    fake("plan", plan=plan)
    return told
