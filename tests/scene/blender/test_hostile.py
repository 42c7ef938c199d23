"""Files that would do harm are refused with a message, or imported without it."""

import subprocess
from pathlib import Path

import pytest

import enfilade
from enfilade.errors import SceneError
from enfilade.scene.blender.find import environment_folder

pytestmark = [pytest.mark.blender, pytest.mark.slow]
PYTHON = environment_folder() / "bin" / "python"
MAKER = Path(__file__).with_name("hostile_files.py")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    if not PYTHON.exists():
        pytest.skip(f"there is no {PYTHON}: make blender")
    made = tmp_path_factory.mktemp("hostile")
    line = [str(PYTHON), "-I", str(MAKER), str(made), str(made / "mark")]
    done = subprocess.run(line, capture_output=True, text=True, check=False, timeout=300)  # noqa: S603
    assert done.returncode == 0, done.stderr
    (made / "mark").unlink(missing_ok=True)  # the maker itself may have evaluated the driver
    return made


def imported(source, out, **limits):
    settings = {"blender": {"program": str(PYTHON)}, "limits": limits}
    return enfilade.import_scene(source, out, settings=settings)


def test_scripts_are_not_run(folder, tmp_path):
    made = imported(folder / "scripts.blend", tmp_path / "scene")
    assert made.counts["objects"] >= 1
    assert not (folder / "mark").exists()


@pytest.mark.parametrize("name", ["plain_cut", "plain_start", "compressed_cut", "compressed_start"])
def test_files_that_are_cut_off(folder, tmp_path, name):
    with pytest.raises(SceneError, match=f"{name}.blend by Blender") as error:
        imported(folder / f"{name}.blend", tmp_path / "scene")
    assert "without a result" not in str(error.value)
    assert list(tmp_path.iterdir()) == []


def test_a_library_outside_of_the_folder(folder, tmp_path):
    source = folder / "inside" / "linked.blend"
    with pytest.raises(SceneError, match=r"links the library .*outside/library\.blend, outside the allowed"):
        imported(source, tmp_path / "scene")
    assert imported(source, tmp_path / "scene", allow=str(folder / "outside")).counts["objects"] == 2


@pytest.mark.parametrize(
    ("name", "words"),
    [("instances", "instances"), ("scattered", "instances"), ("subdivided", "triangles")],
)
def test_scenes_that_are_too_large(folder, tmp_path, name, words):
    with pytest.raises(SceneError, match=rf"{name}\.blend by Blender .*{words}"):
        imported(folder / f"{name}.blend", tmp_path / "scene")
    assert list(tmp_path.iterdir()) == []


def test_the_limit_of_memory_holds(folder, tmp_path):
    """Blender itself takes more than a gigabyte of addresses."""
    limits = {"import_mb": 2048, "import_instances": 10**9, "import_triangles": 10**12, "import_s": 120.0}
    with pytest.raises(SceneError, match=r"without a result|memory"):
        imported(folder / "subdivided.blend", tmp_path / "scene", **limits)
