"""Exit codes and messages: 1 for failures, 2 for wrong input, 130 when interrupted."""

import json
import sys

import pytest

from enfilade.errors import CameraPathError, DeviceError, EnfiladeError, RunFolderError, SceneError


@pytest.fixture
def render(run, camera_path):
    def go(*flags):
        return run("render", "s.xml", "--path", camera_path, "--out", "my run", *flags)

    return go


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (SceneError("s.xml: line 3: no such plugin"), 2, "no such plugin"),
        (RunFolderError("my run holds another run"), 2, "another run"),
        (DeviceError("LLVM 14 is too old"), 1, "too old"),
        (EnfiladeError("it broke"), 1, "it broke"),
        (OSError(28, "No space left on device", "my run/frames/0001.exr"), 1, "0001.exr: No space left"),
        (PermissionError(13, "Permission denied"), 1, "Permission denied"),
        (MemoryError(), 1, "--trace-chunk"),
    ],
)
def test_errors_of_a_run(render, jobs, error, code, words):
    jobs.error = error
    result = render()
    assert result.exit_code == code
    assert result.stdout == ""
    assert result.stderr.count("Error: ") == 1
    assert words in result.stderr


def test_a_library_that_dr_jit_misses_is_a_failure_with_a_remedy(render, jobs, monkeypatch):
    monkeypatch.setitem(sys.modules, "drjit", None)
    result = render()
    assert result.exit_code == 1
    assert "sudo apt-get install" in result.stderr
    assert jobs.seen == []


def test_debug_shows_the_traceback(render, jobs):
    jobs.error = SceneError("no such plugin")
    result = render("--debug")
    assert result.exception is jobs.error
    assert result.exit_code == 1


def test_a_bug_is_not_hidden(render, jobs):
    jobs.error = ZeroDivisionError()
    assert render().exception is jobs.error


def test_interrupted_says_how_to_continue(render, jobs, camera_path):
    jobs.error = KeyboardInterrupt()
    result = render("--seed", "4")
    assert result.exit_code == 130
    assert f"enfilade render s.xml --path {camera_path} --out 'my run' --seed 4\n" in result.stderr
    assert "stays in the run folder" in result.stderr


def test_an_interrupted_plan_has_nothing_to_continue(run, jobs, camera_path):
    jobs.error = KeyboardInterrupt()
    result = run("plan", "s.xml", "--path", camera_path)
    assert result.exit_code == 130
    assert result.stderr.strip() == "Interrupted."


def test_a_missing_camera_path(run, jobs, tmp_path):
    result = run("render", "s.xml", "--path", tmp_path / "gone.json", "--out", "run")
    assert result.exit_code == 2
    assert "gone.json" in result.stderr


def test_a_path_with_a_nan(run, jobs, camera_path):
    values = json.loads(camera_path.read_text())
    values["camera_path"][1]["camera_to_world"][3] = float("nan")
    camera_path.write_text(json.dumps(values))
    result = run("render", "s.xml", "--path", camera_path, "--out", "run")
    assert result.exit_code == 2
    assert jobs.seen == []
    assert issubclass(CameraPathError, ValueError)


@pytest.mark.parametrize("arguments", [("render",), ("plan", "s.xml"), ("scene", "room"), ("nonsense",)])
def test_incomplete_commands_are_wrong_input(run, arguments):
    result = run(*arguments)
    assert result.exit_code == 2
    assert "enfilade" in result.stderr
