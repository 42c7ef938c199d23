"""A run goes on with the code and the libraries that began it, or says what differs."""

import importlib.metadata
import shutil
from pathlib import Path

import pytest

import enfilade
from enfilade.errors import RunFolderError
from enfilade.pipeline import versions
from enfilade.store import Run
from scenes_analytic import room, room_walk
from small_runs import job_of, rendered


@pytest.fixture
def source(tmp_path, monkeypatch):
    """A copy of the package's source, in place of it."""
    shutil.copytree(Path(enfilade.__file__).parent, tmp_path / "enfilade")
    monkeypatch.setattr(versions.enfilade, "__file__", str(tmp_path / "enfilade" / "__init__.py"))
    versions.code_digest.cache_clear()
    yield tmp_path / "enfilade"
    versions.code_digest.cache_clear()


def change(file):
    file.write_text(file.read_text() + "\n# changed\n")
    versions.code_digest.cache_clear()


def test_a_checksum_of_the_code(source):
    before, made_by = versions.code_digest(), versions.makers()
    change(source / "report" / "page.py")
    assert versions.code_digest() != before
    assert versions.makers() == made_by
    change(source / "masks.py")
    after = versions.makers()
    assert [name for name in after if after[name] != made_by[name]] == ["code"]
    (source / "masks.py").rename(source / "masking.py")
    versions.code_digest.cache_clear()
    assert versions.makers()["code"] != after["code"]


def test_a_run_of_other_code_is_not_gone_on_with(source, tmp_path):
    job = job_of(tmp_path, room(), room_walk(4, size=(32, 24)))
    _, folder = rendered(tmp_path, job)
    rendered(tmp_path, job)
    change(source / "warp" / "forward.py")
    with pytest.raises(RunFolderError, match=r"another run:\n  versions\.code: \"\w+\" there, \"\w+\" now"):
        rendered(tmp_path, job)
    assert Run.existing(folder).identity["versions"]["code"] != versions.makers()["code"]


@pytest.mark.parametrize(("package", "is_all_lost"), [("numpy", True), ("av", False)])
def test_a_run_of_another_library(tmp_path, monkeypatch, package, is_all_lost):
    job = job_of(tmp_path, room(), room_walk(4, size=(32, 24)))
    rendered(tmp_path, job)
    really = importlib.metadata.version
    monkeypatch.setattr(versions, "version", lambda name: "0.1" if name == package else really(name))
    with pytest.raises(RunFolderError, match=rf"versions\.{package}: .* \"0\.1\" now") as said:
        rendered(tmp_path, job)
    assert ("everything but the video" in str(said.value)) != is_all_lost


def test_what_is_not_installed_has_no_version():
    assert list(versions.installed(["numpy", "no-such-package"])) == ["numpy"]
