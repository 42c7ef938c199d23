"""``python -m studies scene``."""

import json
from pathlib import Path

import pytest


def test_scene_says_what_to_type_next(run, tmp_path):
    folder = tmp_path / "a room"
    result = run("scene", "room", "--out", folder, "--preset", "small")
    assert result.exit_code == 0
    assert (folder / "scene.xml").exists()
    assert f"enfilade render '{folder}/scene.xml' --path '{folder}/camera_path.json'" in result.stdout


def test_scene_as_json(run, tmp_path):
    files = json.loads(run("scene", "room", "--out", tmp_path, "--preset", "small", "--json").stdout)
    assert all(Path(file).exists() for file in files.values())


@pytest.mark.parametrize("arguments", [("scene", "kitchen", "--out", "x"), ("scene", "room")])
def test_scene_refuses(run, arguments):
    assert run(*arguments).exit_code == 2
