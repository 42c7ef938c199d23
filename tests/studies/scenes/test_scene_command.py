"""``python -m studies scene``."""

import json
from pathlib import Path

import pytest


def test_scene_prints_its_files_and_the_next_commands(run, tmp_path):
    folder = tmp_path / "a room"
    result = run("scene", "room", "--out", folder, "--preset", "small")
    assert result.exit_code == 0
    assert (folder / "scene.xml").exists()
    assert f"enfilade render '{folder}/scene.xml' --path '{folder}/camera_path.json'" in result.stdout
    files = json.loads(run("scene", "room", "--out", tmp_path, "--preset", "small", "--json").stdout)
    assert all(Path(file).exists() for file in files.values())


@pytest.mark.parametrize("arguments", [("scene", "cellar", "--out", "x"), ("scene", "room")])
def test_scene_refuses(run, arguments):
    assert run(*arguments).exit_code == 2
