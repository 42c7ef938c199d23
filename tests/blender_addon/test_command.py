"""The command as the add-on runs it, and the add-on in Blender."""

import importlib.util
import json
import os
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pytest

from enfilade.cli.options import ALL_FLAGS
from enfilade.scene.blender.find import environment_folder
from enfilade.settings import BlenderSettings

ROOT = Path(__file__).parents[2]
PYTHON = environment_folder() / "bin" / "python"


@pytest.fixture(scope="module")
def command():
    """The module without Blender, which the package imports."""
    spec = importlib.util.spec_from_file_location("addon_command", ROOT / "blender_addon" / "command.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look there
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


@pytest.fixture
def program(tmp_path):
    """A program that stands for enfilade: notes its arguments, writes progress and ends as told."""

    def write(body):
        file = tmp_path / "enfilade"
        file.write_text(f'#!/bin/sh\nprintf "%s\\n" "$@" > "{tmp_path}/arguments"\n{body}\n')
        file.chmod(0o755)
        return file

    return write


def ended(process, seconds=60.0):
    end = time.monotonic() + seconds
    while process.code is None:
        assert time.monotonic() < end
        time.sleep(0.02)
        process.poll()
    return process


def test_an_order_is_an_enfilade_command(command):
    order = command.Order("enfilade", Path("/a b.blend"), Path("/run"), 12.5, 'My "scene" 🎬', "/opt/blender")
    line = order.line()
    assert line[:6] == ["enfilade", "render", "/a b.blend", "--out", "/run", "--quality"]
    assert "--quality" in ALL_FLAGS
    names = [part.partition("=") for part in line[7:] if part != "--set"]
    tables = {name.removeprefix("blender."): tomllib.loads(f"v = {value}")["v"] for name, _, value in names}
    assert BlenderSettings.from_table(tables) == BlenderSettings(
        scene='My "scene" 🎬', program="/opt/blender"
    )


def test_progress_is_followed_to_the_end(command, program):
    file = program("echo 'import: 100 to do' >&2; echo 'shading: 3/24, 0:12 passed' >&2; echo video x.mp4")
    process = ended(command.Process([str(file), "render"]))
    assert (process.code, process.stage, process.fraction) == (0, "shading", 0.125)
    assert process.last[-1] == "video x.mp4"


def test_a_failure_has_the_message_of_the_command(command, program):
    lines = "echo 'Error: retried'; echo 'Error: a run of another file'; echo '  choose another --out' >&2"
    process = ended(command.Process([str(program(f"{lines}; exit 2"))]))
    assert (process.code, process.message) == (2, "a run of another file\n  choose another --out")
    assert command.wrapped(process.message, 20) == ["a run of another", "file", "  choose another", "--out"]
    with pytest.raises(FileNotFoundError):
        command.Process(["/nowhere/enfilade"])


def test_a_new_run_has_a_folder_of_its_own(command, tmp_path):
    assert command.next_run(tmp_path / "run") == tmp_path / "run"
    for name in ("run", "run 2"):
        (tmp_path / name).mkdir()
        assert command.next_run(tmp_path / name) == tmp_path / f"run {int(name[4:] or 1) + 1}"


def test_it_is_ended(command, program):
    process = command.Process([str(program("trap 'exit 7' TERM; echo ready; while :; do sleep 0.1; done"))])
    while "ready" not in process.last:
        time.sleep(0.02)
        process.poll()
    process.end()
    assert ended(process).code == 7


def test_the_manifest_is_complete():
    manifest = tomllib.loads((ROOT / "blender_addon" / "blender_manifest.toml").read_text())
    required = {
        "schema_version",
        "id",
        "version",
        "name",
        "tagline",
        "maintainer",
        "type",
        "blender_version_min",
    }
    assert required < manifest.keys()
    assert manifest["license"] == ["SPDX:GPL-3.0-or-later"]
    assert len(manifest["tagline"]) <= 64
    assert not manifest["tagline"].endswith(".")
    assert len(manifest["permissions"]["files"]) <= 64


SESSION = """
import json, os, sys, time
from types import SimpleNamespace as Record
sys.path.insert(0, sys.argv[1])
import bpy, blender_addon
folder, program = sys.argv[2:]
blender_addon.register()
own = blender_addon.command_of
blender_addon.command_of = lambda context: program
said = []
settings = bpy.context.scene.enfilade
settings.run, settings.quality = "//run/", 5.0
def call(**settings):
    try:
        return list(bpy.ops.enfilade.render(**settings))
    except RuntimeError as error:
        return str(error)
said.append(call())
bpy.ops.wm.save_as_mainfile(filepath=os.path.join(folder, "shot.blend"))
given = Record(preferences=Record(command="//../bin/enfilade"))
said.append(own(Record(preferences=Record(addons={"blender_addon": given}))))
os.mkdir(os.path.join(folder, "run"))
said.append(call(is_new=True))
said.append(bpy.ops.enfilade.render.poll())
bpy.ops.wm.read_homefile()
said.append(bpy.app.timers.is_registered(blender_addon.watch))
while blender_addon.watch() is not None:
    time.sleep(0.05)
said += [blender_addon.EnfiladePanel.message, bpy.ops.enfilade.render.poll()]
blender_addon.unregister()
said.append(hasattr(bpy.types.Scene, "enfilade"))
print("said", json.dumps(said))
sys.stdout.flush()
os._exit(0)
"""


@pytest.mark.blender
def test_the_panel_runs_the_command_in_blender(program, tmp_path):
    if not PYTHON.exists():
        pytest.skip(f"there is no {PYTHON}: make blender")
    file = program("echo 'shading: 1/2'; sleep 0.3; echo 'Error: no camera'; exit 2")
    line = [str(PYTHON), "-I", "-c", SESSION, str(ROOT), str(tmp_path), str(file)]
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(  # noqa: S603
        line, capture_output=True, text=True, check=False, timeout=120, env=environment
    )
    said = json.loads(next(row for row in done.stdout.splitlines() if row.startswith("said"))[5:])
    assert "Save the file first" in said[0]
    assert said.pop(1) == f"{tmp_path}/../bin/enfilade"
    assert said[1:] == [["FINISHED"], False, True, "no camera", True, False], done.stderr
    arguments = (tmp_path / "arguments").read_text().splitlines()
    assert arguments[:6] == [
        "render",
        f"{tmp_path}/shot.blend",
        "--out",
        f"{tmp_path}/run 2",
        "--quality",
        "5",
    ]
