"""A made-up run and its reference, their page, and a browser."""

import os
import shutil

import pytest
from playwright.sync_api import sync_playwright

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


@pytest.fixture(scope="module")
def browser():
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    assert program, "the tests of the page need Chromium; install it: sudo apt-get install chromium"
    sandbox = ["--no-sandbox"] if os.geteuid() == 0 else []  # which Chromium refuses to root
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=program, args=sandbox)
        yield opened
        opened.close()


@pytest.fixture
def open_page(browser, page_file):
    """Opens the page; in the end there must have been no request to a network, and no message."""
    contexts, complaints = [], []

    def request(found):
        if not found.url.startswith("data:") and found.url != page_file.as_uri():
            complaints.append(found.url)

    def opened(**terms):
        contexts.append(browser.new_context(**{"viewport": {"width": 1440, "height": 900}, **terms}))
        page = contexts[-1].new_page()
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", request)
        page.goto(page_file.as_uri())
        page.wait_for_selector("[data-shown]")
        return page

    yield opened
    for context in contexts:
        context.close()
    assert complaints == []
