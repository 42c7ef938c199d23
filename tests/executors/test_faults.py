"""The trial that kills commands: what it takes for a kill, and what for an error of the command."""

import random
import signal
import sys
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import pytest


@pytest.fixture
def faults(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "benchmarks")
    return import_module("faults")


@pytest.mark.parametrize(("code", "ends"), [(0, None), (-signal.SIGKILL, ""), (1, ", exit code 1")])
@pytest.mark.parametrize("kind", ["kill_at_point", "kill_all", "kill_worker", "kill_two"])
def test_a_command_that_fails_by_itself_is_no_kill_that_came_too_late(
    faults, monkeypatch, tmp_path, kind, code, ends
):
    text = f"import os; os._exit({code})" if code >= 0 else "import os; os.kill(os.getpid(), 9)"
    monkeypatch.setattr(faults, "command", lambda *_: [sys.executable, "-c", text])
    monkeypatch.setattr(faults.subprocess, "run", lambda *_, **__: SimpleNamespace(returncode=code))
    monkeypatch.setattr(faults.time, "sleep", lambda _: None)
    what = getattr(faults, kind)(SimpleNamespace(inputs=(), seconds=20.0), tmp_path / "run", random.Random(1))  # noqa: S311
    if ends is None:
        assert what is None
    elif kind in ("kill_worker", "kill_two"):
        assert what.endswith(f", exit code {code}")
    else:
        assert what.endswith(ends)
        assert ("exit code" in what) == bool(ends)
