"""``enfilade doctor`` says what is there, and ends with 1 where something required is missing."""

import importlib.metadata
import json
import sys

from enfilade import installation
from enfilade.device import active
from enfilade.installation import Check, examine


def test_this_machine_is_ready(run):
    result = run("doctor", "--device", "auto")
    assert result.exit_code == 0, result.output
    assert "Ready to render." in result.stdout
    assert active().variant in result.stdout


def test_as_json(run):
    report = json.loads(run("doctor", "--json").stdout)
    found = {check["name"]: check for check in report["checks"]}
    assert report["is_ready"]
    assert found["mitsuba"]["found"] == importlib.metadata.version("mitsuba")
    assert found["codec h264"]["found"] == "libx264"
    assert any(name.startswith("LLVM") for name in found)


def test_a_missing_package_is_named_with_its_remedy(run, monkeypatch):
    version = importlib.metadata.version

    def without_mitsuba(name):
        if name in ("mitsuba", "opencolorio"):
            raise importlib.metadata.PackageNotFoundError(name)
        return version(name)

    monkeypatch.setattr(installation.importlib.metadata, "version", without_mitsuba)
    result = run("doctor")
    assert result.exit_code == 1
    assert "Missing: mitsuba." in result.stdout
    checks = {check.name: check for check in examine()}
    assert "mitsuba" in checks["mitsuba"].remedy
    extra = checks["opencolorio (extra ocio)"]
    assert (extra.is_required, extra.remedy) == (False, "pip install 'opencolorio>=2.4'")


def test_a_package_that_is_too_old_is_named_with_its_remedy(run, monkeypatch):
    version = importlib.metadata.version
    monkeypatch.setattr(
        installation.importlib.metadata, "version", lambda n: "3.5.0" if n == "mitsuba" else version(n)
    )
    result = run("doctor")
    assert result.exit_code == 1
    assert "mitsuba>=3.9" in {check.name: check for check in examine()}["mitsuba"].remedy.replace("<4,", "")


def test_a_missing_system_library_is_named(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "drjit", None)
    result = run("doctor")
    assert result.exit_code == 1
    assert "Missing: system libraries." in result.stdout
    assert "libatomic1" in result.stdout


def test_what_is_optional_does_not_fail(run, monkeypatch):
    checks = [Check("enfilade", "1"), Check("NVIDIA GPU", "", False, "a GPU")]
    monkeypatch.setattr(installation, "examine", lambda _: checks)
    assert run("doctor").exit_code == 0


def test_every_check_has_a_name_and_a_finding_or_a_remedy():
    for check in examine():
        assert check.name
        assert check.found or check.remedy


def test_blender_is_optional(run, monkeypatch, tmp_path, blender_path):
    checks = {check.name: check for check in examine()}
    assert checks["Blender"].found == f"4.5.1, {blender_path}/blender"
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.setattr("enfilade.scene.blender.find.environment_folder", lambda: tmp_path / "none")
    check = next(check for check in examine() if check.name == "Blender")
    assert (check.found, check.is_required) == ("", False)
    assert "--install-blender" in check.remedy


def test_blender_is_installed_first(run, monkeypatch):
    steps = []
    monkeypatch.setattr("enfilade.scene.blender.install.install", lambda _: steps.append("install"))
    monkeypatch.setattr(installation, "examine", lambda _: steps.append("examine") or [])
    assert run("doctor", "--install-blender").exit_code == 0
    assert steps == ["install", "examine"]
