"""Documents name files and flags that exist, and the script for Blender does what they say of it."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import click
import numpy as np
import pytest

from enfilade.camera import load_path
from enfilade.cli import main
from studies.__main__ import main as studies

ROOT = Path(__file__).parents[1]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
FLAG = re.compile(r"(?<![\w!-])--[a-z][a-z0-9-]*")
OTHERS = {  # flags of other programs that documents name
    "podman": "--cap-drop --memory --network --pids-limit --read-only --rm --security-opt --tmpfs --volume",
    "openjd": "--run-dependencies",
    "make bench": "--scenes --keep",
    "make case-studies": "--scenes --items",
    "benchmarks/faults.py": "--count --quick",
}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda d: d.name)
def test_files_that_a_document_names_exist(document: Path) -> None:
    named = re.findall(r"`((?:tests|docs|benchmarks|setup)/[\w/.-]*)`", document.read_text())
    missing = [name for name in named if not (ROOT / name).exists()]
    assert not missing


@pytest.fixture(scope="module")
def flags() -> set[str]:
    """Of all commands."""
    options = [option for command in (main, studies) for option in parameters(command)]
    own = {flag for option in options for flag in (*option.opts, *option.secondary_opts)}
    return own | {"--help"}


def parameters(command: click.Command) -> Iterator[click.Parameter]:
    yield from command.params
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            below = command.get_command(context, name)
            assert below is not None
            yield from parameters(below)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda d: d.name)
def test_flags_that_a_document_names_exist(document: Path, flags: set[str]) -> None:
    others = {flag for named in OTHERS.values() for flag in named.split()}
    assert not set(FLAG.findall(document.read_text())) - flags - others


def test_the_map_of_the_paper_names_modules_that_exist() -> None:
    rows = [line for line in (ROOT / "docs/paper.md").read_text().splitlines() if line.startswith("|")]
    named = {name for row in rows for name in re.findall(r"`([\w/]+(?:\.py|/))`", row)}
    assert len(named) > 30
    missing = [n for n in named if not any((root / n).exists() for root in (ROOT, ROOT / "src/enfilade"))]
    assert not missing


def test_links_between_documents_lead_somewhere() -> None:
    for document in DOCUMENTS:
        for target in re.findall(r"\]\(([^)#:]+)\)", document.read_text()):
            assert (document.parent / target).exists(), f"{document.name} links to {target}"


class Matrix(np.ndarray):
    """As much of Blender's as the script asks for."""

    @staticmethod
    def of(rows):
        return np.array(rows, np.float64).view(Matrix)

    @staticmethod
    def Translation(place):  # noqa: N802  (its name there)
        made = Matrix.of(np.eye(4))
        made[:3, 3] = place
        return made

    def decompose(self):
        return self[:3, 3], self[:3, :3], None

    def to_matrix(self):
        return self

    def to_4x4(self):
        made = Matrix.of(np.eye(4))
        made[:3, :3] = self
        return made


def test_the_script_for_blender_writes_a_camera_path(tmp_path, monkeypatch):
    # A level camera that walks along Blender's +y: in the turned world along -z, as it looks.
    camera = SimpleNamespace(calc_matrix_camera=lambda _, x, y: Matrix.of(np.diag([2.0 * y / x, 2.0, -1, 0])))

    def frame_set(number):
        camera.matrix_world = Matrix.of([[1, 0, 0, 2], [0, 0, -1, number], [0, 1, 0, 1.6], [0, 0, 0, 1]])

    size = {"resolution_x": 1282, "resolution_y": 963, "resolution_percentage": 50}
    render = SimpleNamespace(**size, fps=30, fps_base=1.001)
    scene = SimpleNamespace(render=render, camera=camera, frame_start=5, frame_end=8, frame_set=frame_set)
    for name, members in {
        "bpy": {
            "context": SimpleNamespace(scene=scene, evaluated_depsgraph_get=lambda: None),
            "path": SimpleNamespace(abspath=lambda name: name.replace("//", f"{tmp_path}/")),
        },
        "mathutils": {"Matrix": Matrix},
        "bpy_extras": {},
        "bpy_extras.io_utils": {  # what Blender 4.2 says of -Z and Y
            "axis_conversion": lambda **_: Matrix.of([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
        },
    }.items():
        monkeypatch.setitem(sys.modules, name, SimpleNamespace(**members))
    script = re.search(r"```python\n(.*?)```", (ROOT / "docs/camera-paths.md").read_text(), re.DOTALL)
    exec(script[1], {})  # noqa: S102
    path = load_path(tmp_path / "camera_path.json")
    assert (path.width, path.height, path.numbers) == (640, 480, (1, 2, 3, 4))
    assert path.fps == pytest.approx(29.97, abs=1e-3)
    for number, seen in enumerate(path.cameras, 5):
        assert np.allclose(seen.eye, (2, 1.6, -number))
        assert np.allclose(seen.world_from_camera[:3, :3], np.eye(3))
        assert seen.fov_deg == pytest.approx(2 * np.degrees(np.arctan(0.5)))
