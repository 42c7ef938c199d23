import json

import pytest


@pytest.fixture
def write(tmp_path):
    """Write a camera path's JSON, or text as it is."""

    def write_file(content):
        file = tmp_path / "walk.json"
        file.write_text(content if isinstance(content, str) else json.dumps(content))
        return file

    return write_file
