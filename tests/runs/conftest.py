"""Toy runs without pauses between attempts."""

from __future__ import annotations

import pytest

from enfilade.monitor import Silence
from enfilade.runs.render import render
from support.toys import digest, toy_job


@pytest.fixture(autouse=True)
def _no_pauses(monkeypatch):
    monkeypatch.setattr("enfilade.runs.scheduler.DELAYS_S", (0.0, 0.0))
    monkeypatch.setattr("enfilade.runs.folder.LATE_S", 0.0)


@pytest.fixture(scope="session")
def whole(tmp_path_factory):
    """Digest of an undisturbed run of four frames, in process."""
    folder = tmp_path_factory.mktemp("whole")
    render(toy_job(folder), folder / "run", Silence())
    return digest(folder / "run")
