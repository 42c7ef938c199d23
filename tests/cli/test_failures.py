"""Exit codes and messages: 1 for failures, 2 for wrong input, 130 when interrupted."""

import sys

import pytest

from enfilade.errors import DeviceError, EnfiladeError, RunFolderError, SceneError


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
        (MemoryError(), 1, "limits.paths_in_flight"),
    ],
)
def test_errors_of_a_run(render, jobs, error, code, words):
    jobs.error = error
    result = render()
    assert result.exit_code == code
    assert result.stdout == ""
    assert result.stderr.count("Error: ") == 1
    assert words in result.stderr


def test_a_missing_system_library_is_a_failure_with_a_remedy(render, jobs, monkeypatch):
    monkeypatch.setitem(sys.modules, "drjit", None)
    result = render()
    assert result.exit_code == 1
    assert "sudo apt-get install" in result.stderr
    assert not jobs


def test_debug_shows_the_traceback(render, jobs):
    jobs.error = SceneError("no such plugin")
    assert render("--debug").exception is jobs.error


def test_bugs_are_not_hidden(render, jobs):
    jobs.error = ZeroDivisionError()
    assert render().exception is jobs.error


def test_an_interrupted_run_tells_how_to_continue(render, run, jobs, camera_path):
    jobs.error = KeyboardInterrupt()
    result = render("--seed", "4")
    assert result.exit_code == 130
    assert f"enfilade render s.xml --path {camera_path} --out 'my run' --seed 4\n" in result.stderr
    plan = run("plan", "s.xml", "--path", camera_path)
    assert (plan.exit_code, plan.stderr.strip()) == (130, "Interrupted.")


@pytest.mark.parametrize("arguments", [("render",), ("plan", "s.xml"), ("nonsense",)])
def test_incomplete_commands_are_wrong_input(run, arguments):
    result = run(*arguments)
    assert result.exit_code == 2
    assert "enfilade" in result.stderr


def test_a_missing_camera_path(run, jobs, tmp_path):
    result = run("render", "s.xml", "--path", tmp_path / "gone.json", "--out", "run")
    assert result.exit_code == 2
    assert "gone.json" in result.stderr
