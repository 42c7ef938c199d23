"""Files for a program that stands for Blender, and does what they say."""

import json
import sys

import pytest

from support import fake_blender

PROGRAM = fake_blender.__file__


@pytest.fixture
def program(tmp_path):
    """Its path: a script that starts it with this Python."""
    file = tmp_path / "blender"
    file.write_text(f'#!/bin/sh\nexec "{sys.executable}" -I "{PROGRAM}" "$@"\n')
    file.chmod(0o755)
    return file


@pytest.fixture
def shot(tmp_path):
    """Write a file that says what becomes of it."""

    def write(name="shot.blend", **wish):
        file = tmp_path / name
        file.write_text(json.dumps(wish))
        return file

    return write
