"""A scene of one element, beside a picture."""

import numpy as np
import pytest

from enfilade.images import write_exr


@pytest.fixture
def scene(tmp_path):
    """Write a scene of one element, in a folder with a picture; returns its file."""
    folder = tmp_path / "scene"
    folder.mkdir()
    write_exr(folder / "picture.exr", {"RGB": np.zeros((4, 8, 3), np.float32)})

    def write(body, head='<scene version="3.0.0">'):
        file = folder / "scene.xml"
        file.write_text(f"{head}{body}</scene>")
        return file

    return write
