"""Blender is the given program, else that on PATH, else the environment of the module bpy."""

import sys

import pytest

from enfilade.errors import SceneError
from enfilade.scene.blender import find
from enfilade.scene.blender.find import find_blender


def answering(file, answer):
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(f"#!/bin/sh\necho '{answer}'\n")
    file.chmod(0o755)
    return file


@pytest.fixture(autouse=True)
def nothing_installed(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path / "path"))
    monkeypatch.setattr(find, "PACKAGES", tmp_path / "site-packages")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))


def test_a_given_program_wins(tmp_path):
    answering(tmp_path / "path" / "blender", "Blender 4.3.0")
    given = answering(tmp_path / "blender-4.5.1" / "blender", "Blender 4.5.1 LTS")
    for place in (given, given.parent):
        found = find_blender(str(place))
        assert (found.program, found.version, found.is_module) == (given, "4.5.1", False)
    assert found.command(tmp_path / "s.py", tmp_path / "j.json")[1:5] == [
        "--background", "--factory-startup", "--disable-autoexec", "--python-exit-code",
    ]  # fmt: skip


def test_a_given_name_is_looked_for_on_path(tmp_path, monkeypatch):
    on_path = answering(tmp_path / "path" / "blender-4.5", "Blender 4.5.1 LTS")
    assert find_blender("blender-4.5").program == on_path
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    answering(tmp_path / "here" / "blender-4.5" / "blender", "Blender 4.5.3 LTS")
    assert find_blender("blender-4.5").version == "4.5.3"


def test_blender_on_path_comes_before_the_environment(tmp_path):
    on_path = answering(tmp_path / "path" / "blender", "Blender 4.2.0")
    answering(tmp_path / "data" / "enfilade" / "blender" / "bin" / "python", "Blender 4.5.1")
    assert find_blender().program == on_path


def test_an_old_blender_on_path_is_passed_over(tmp_path):
    """Debian 12 has Blender 3.4."""
    answering(tmp_path / "path" / "blender", "Blender 3.4.1")
    module = tmp_path / "data" / "enfilade" / "blender" / "bin" / "python"
    with pytest.raises(SceneError, match=r"it is Blender 3\.4\.1, older than 4\.2\); install it"):
        find_blender()
    answering(module, "Blender 4.5.1")
    found = find_blender()
    assert found.program == module
    assert "blender is not used: it is Blender 3.4.1, older than 4.2" in found.note


def test_a_checkout_has_its_own_environment(tmp_path, monkeypatch):
    monkeypatch.setattr(find, "PACKAGES", tmp_path / "src")
    assert find.environment_folder() == tmp_path / "data" / "enfilade" / "blender"
    (tmp_path / "pyproject.toml").touch()
    assert find.environment_folder() == tmp_path / ".venv-blender"


def test_without_blender_the_message_says_how_to_get_it():
    with pytest.raises(SceneError, match=r"found no Blender .*blender\.program=.*--install-blender"):
        find_blender()


@pytest.mark.parametrize(("answer", "words"), [("hello", "--version"), ("Blender 2.93.0", "older than 4.2")])
def test_a_given_program_must_work(tmp_path, answer, words):
    with pytest.raises(SceneError, match=words):
        find_blender(str(answering(tmp_path / "other", answer)))


def test_a_python_must_have_the_module(tmp_path):
    with pytest.raises(SceneError, match="it has no module bpy"):
        find_blender(sys.executable)
    with pytest.raises(SceneError, match="--version"):
        find_blender(str(tmp_path / "gone"))
