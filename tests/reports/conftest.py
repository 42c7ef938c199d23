"""A made-up run and its reference, and their page."""

import shutil

import pytest

from enfilade.reports.page import write_report
from support.synthetic_runs import synthetic_run


@pytest.fixture(scope="session")
def runs(tmp_path_factory):
    """Folder with the run folders ``run`` and ``reference``. Not to be written in."""
    folder = tmp_path_factory.mktemp("reported")
    synthetic_run(folder / "run", noise=0.05)
    synthetic_run(folder / "reference")
    return folder


@pytest.fixture
def copied(runs, tmp_path):
    """A copy of the run, to be damaged."""
    return shutil.copytree(runs / "run", tmp_path / "run")


@pytest.fixture(scope="session")
def page_file(runs, tmp_path_factory):
    """The page of the run with its reference."""
    out = tmp_path_factory.mktemp("page") / "report.html"
    return write_report(runs / "run", reference=runs / "reference", out=out)
