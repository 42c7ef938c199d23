"""Files for a program that stands for Blender, and does what they say."""

import json

import pytest

from support.fake_blender import write_program


@pytest.fixture
def program(tmp_path):
    """Its path."""
    return write_program(tmp_path / "blender")


@pytest.fixture
def shot(tmp_path):
    """Write a file that says what becomes of it."""

    def write(name="shot.blend", **wish):
        file = tmp_path / name
        file.write_text(json.dumps(wish))
        return file

    return write
