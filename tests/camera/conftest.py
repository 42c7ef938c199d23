import json
from pathlib import Path
from typing import Any, Protocol

import pytest


class Write(Protocol):
    def __call__(self, content: Any) -> Path: ...


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write a camera path's JSON, or text as it is."""

    def write_file(content: Any) -> Path:
        file = tmp_path / "walk.json"
        file.write_text(content if isinstance(content, str) else json.dumps(content))
        return file

    return write_file
