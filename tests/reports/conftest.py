"""A small walkthrough and its reference, rendered once for all tests of the page."""

import shutil

import pytest

import scenes_analytic
from enfilade.monitor import Silence
from enfilade.reports.page import Wishes, write_page
from small_runs import job_of, rendered

FRAMES = 10


@pytest.fixture(scope="session")
def runs(tmp_path_factory):
    """Folder with the run folders ``paper`` and ``reference``. Not to be written in."""
    folder = tmp_path_factory.mktemp("reported")
    scene, path = scenes_analytic.room(specular=True), scenes_analytic.room_walk(FRAMES)
    for method in ("paper", "reference"):
        rendered(folder, job_of(folder, scene, path, method=method), method)
    return folder


@pytest.fixture
def copied(runs, tmp_path):
    """A copy of the run ``paper``, to be damaged."""
    return shutil.copytree(runs / "paper", tmp_path / "run")


@pytest.fixture(scope="session")
def page_file(runs, tmp_path_factory):
    """The page of ``paper`` beside its reference."""
    file = tmp_path_factory.mktemp("page") / "report.html"
    write_page(runs / "paper", file, Wishes(reference=runs / "reference"), Silence())
    return file
