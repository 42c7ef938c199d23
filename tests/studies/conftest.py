import json

import pytest
from click.testing import CliRunner

from studies.__main__ import main


@pytest.fixture
def run():
    def invoke(*arguments):
        return CliRunner().invoke(main, [str(a) for a in arguments], prog_name="python -m studies")

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
