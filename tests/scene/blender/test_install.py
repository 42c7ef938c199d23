"""The environment of the module bpy is made once; what is not finished is made again."""

import pytest

from enfilade.errors import EnfiladeError, SceneError
from enfilade.scene.blender import find, install

VENV = """#!/bin/sh
# stands for Python: `-m venv --clear FOLDER` makes an environment whose Python answers as one with bpy
echo "$@" >> "{log}"
mkdir -p "$4/bin"
cp "{inner}" "$4/bin/python"
"""
INNER = """#!/bin/sh
case "$*" in
  --version) echo "Python 9.9.1" ;;
  *importlib*) echo "Blender {version}" ;;
  *pip*) echo "$@" >> "{log}"; exit {code} ;;
esac
"""


@pytest.fixture
def python(tmp_path, monkeypatch):
    """Put a Python 9.9 on PATH; returns the file in which it notes its calls."""
    log = tmp_path / "log"

    def write(code=0, version="4.5.15"):
        (tmp_path / "path").mkdir(exist_ok=True)
        inner, outer = tmp_path / "inner", tmp_path / "path" / "python9.9"
        inner.write_text(INNER.format(log=log, code=code, version=version))
        outer.write_text(VENV.format(log=log, inner=inner))
        inner.chmod(0o755)
        outer.chmod(0o755)
        return log

    monkeypatch.setattr(install, "RECIPES", {"9.8": ("none",), "9.9": ("bpy==4.5.*", "numpy<2")})
    monkeypatch.setenv("PATH", str(tmp_path / "path"), prepend=":")
    monkeypatch.setattr(find, "PACKAGES", tmp_path / "site-packages")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    return write


def test_an_environment_is_made_once(python, tmp_path):
    log, said = python(), []
    folder = tmp_path / "data" / "enfilade" / "blender"
    for _ in range(2):
        assert install.install(said.append).program == folder / "bin" / "python"
    calls = log.read_text().splitlines()
    assert calls[0] == f"-m venv --clear {folder}"
    assert calls[1].endswith("bpy==4.5.* numpy<2")
    assert len(calls) == 2
    assert "374 MB" in said[0]
    assert said[-1] == f"Blender is installed in {folder}"
    assert find.find_blender().version == "4.5.15"


def test_a_failure_is_made_good_by_the_next_call(python, tmp_path):
    log = python(code=1)
    with pytest.raises(EnfiladeError, match=r"pip install .* failed with exit code 1"):
        install.install(str)
    python(version="2.79")
    with pytest.raises(SceneError, match=r"older than 4\.2"):
        install.install(str)
    python()
    assert install.install(str).version == "4.5.15"
    assert log.read_text().count("--clear") == 3


def test_a_missing_python_is_said(python, monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(EnfiladeError, match=r"needs Python 9\.8 or 9\.9, .*apt-get install.*blender\.org"):
        install.install(str)
