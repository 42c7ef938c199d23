import json
import os

import pytest
from click.testing import CliRunner

from enfilade.cli import main
from support.fake_blender import write_program

SCENE = """<scene version="3.0.0">
  <integrator type="path"/>
  <shape type="sphere"><point name="center" x="0" y="0" z="-4"/></shape>
  <emitter type="constant"/>
</scene>"""


@pytest.fixture
def run():
    def invoke(*arguments):
        return CliRunner().invoke(main, [str(a) for a in arguments], prog_name="enfilade")

    return invoke


@pytest.fixture
def camera_path(tmp_path):
    """Three frames of nerfstudio's format, 64x48, that move sideways."""
    cameras = [
        {"camera_to_world": [1, 0, 0, 0.02 * x, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], "fov": 50}
        for x in range(3)
    ]
    file = tmp_path / "camera_path.json"
    values = {"render_width": 64, "render_height": 48, "fps": 24, "camera_type": "perspective"}
    file.write_text(json.dumps({**values, "seconds": 0.125, "camera_path": cameras}))
    return file


@pytest.fixture
def scene(tmp_path):
    """A white sphere under a white sky."""
    file = tmp_path / "scene.xml"
    file.write_text(SCENE)
    return file


@pytest.fixture
def blender_path(tmp_path, monkeypatch):
    """A program on PATH that stands for Blender, and does what its file says."""
    folder = tmp_path / "programs"
    folder.mkdir()
    write_program(folder / "blender")
    monkeypatch.setenv("PATH", str(folder), prepend=os.pathsep)
    return folder


@pytest.fixture
def line(scene, camera_path, tmp_path):
    """A quick `enfilade render` command."""
    size = ("--size", "16x12", "--method", "reference", "--spp", "2", "--device", "auto", "--quiet")
    return ("render", scene, "--path", camera_path, "--out", tmp_path / "run", *size)


@pytest.fixture
def jobs(monkeypatch):
    """Jobs that `render` and `plan` are called with, in place of the work; `jobs.error` is raised."""
    from enfilade.runs import plan, render

    class Jobs(list):
        error = None
        workers = None

    seen = Jobs()

    def take(job, *arguments, **options):
        seen.append(job)
        seen.workers = arguments[2] if len(arguments) > 2 else None
        if seen.error is not None:
            raise seen.error
        raise SystemExit(0)

    monkeypatch.setattr(render, "render", take)
    monkeypatch.setattr(plan, "plan", take)
    return seen
