"""A Mitsuba scene beside a picture."""

import numpy as np
import pytest

from enfilade.images import write_exr

HEAD = '<scene version="3.0.0">'


@pytest.fixture
def scene(tmp_path):
    """Write a scene into a folder with a picture; returns its file."""
    folder = tmp_path / "scene"
    folder.mkdir()
    write_exr(folder / "picture.exr", {"RGB": np.zeros((4, 8, 3), np.float32)})

    def write(body, name="scene.xml"):
        file = folder / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(f"{HEAD}{body}</scene>")
        return file

    return write
