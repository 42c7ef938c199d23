"""What `make setup` stands on: the scripts, and a lock file that fits pyproject.toml."""

import os
import re
import subprocess
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
SCRIPTS = [*sorted((ROOT / "setup").glob("*.sh")), ROOT / ".ci" / "run"]


def sh(*arguments, **environment):
    command = ["/bin/sh", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)  # noqa: S603


def wanted():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    extras = project["project"]["optional-dependencies"].values()
    lists = [project["project"]["dependencies"], *project["dependency-groups"].values(), *extras]
    return [Requirement(line) for lines in lists for line in lines]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda s: s.name)
def test_scripts_are_valid_sh_and_can_be_run(script):
    assert sh("-n", script).returncode == 0
    assert os.access(script, os.X_OK)


@pytest.mark.parametrize("requirement", wanted(), ids=lambda r: r.name)
def test_the_lock_holds_what_the_project_wants(requirement):
    pins = re.findall(r"^([\w.-]+)==(\S+)", (ROOT / "requirements.lock").read_text(), re.MULTILINE)
    versions = [
        version for name, version in pins if canonicalize_name(name) == canonicalize_name(requirement.name)
    ]
    assert versions, "run: make lock"
    assert all(requirement.specifier.contains(version) for version in versions)


def fake_python(folder, name, *, version_fits, has_venv):
    folder.mkdir(exist_ok=True)
    file = folder / name
    version = f"test {version_fits} = 1 && echo 3.11"
    body = f'case "$2" in *version_info*) {version} ;; *venv*) exit {1 - has_venv} ;; esac'
    file.write_text(f"#!/bin/sh\n{body}\n")
    file.chmod(0o755)


def test_a_python_that_fits_is_found(tmp_path):
    fake_python(tmp_path, "python3.11", version_fits=0, has_venv=1)
    fake_python(tmp_path, "python3.12", version_fits=1, has_venv=1)
    done = sh(ROOT / "setup" / "python.sh", PATH=str(tmp_path))
    assert (done.returncode, done.stdout) == (0, "python3.12\n")


def test_python_can_be_chosen(tmp_path):
    fake_python(tmp_path, "mine", version_fits=1, has_venv=1)
    done = sh(ROOT / "setup" / "python.sh", PATH=str(tmp_path), PYTHON=str(tmp_path / "mine"))
    assert done.stdout == f"{tmp_path}/mine\n"


def test_a_missing_venv_module_is_said(tmp_path):
    fake_python(tmp_path, "python3", version_fits=1, has_venv=0)
    done = sh(ROOT / "setup" / "python.sh", PATH=str(tmp_path))
    assert done.returncode == 2
    assert "sudo apt-get install python3.11-venv" in done.stderr


def test_a_missing_python_is_said(tmp_path):
    done = sh(ROOT / "setup" / "python.sh", PATH=str(tmp_path))
    assert done.returncode == 2
    assert "Python 3.11, 3.12 or 3.13 is needed" in done.stderr
