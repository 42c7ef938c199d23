"""``enfilade report``: where the page goes, and what is refused."""

import pytest

from enfilade.reports.page import Wishes


@pytest.fixture
def pages(monkeypatch):
    """Stands for the page's writer: takes what the command line asks for."""
    seen = []

    def write(folder, file, wishes, monitor):
        seen.append((folder, file, wishes))
        return ["frame 3 is left out"]

    monkeypatch.setattr("enfilade.reports.page.write_page", write)
    return seen


def test_the_page_goes_into_the_run_folder(run, pages, tmp_path):
    result = run("report", tmp_path, "--quiet")
    assert result.exit_code == 0, result.output
    assert pages == [(tmp_path, tmp_path / "report.html", Wishes())]
    assert result.stdout == f"report  {tmp_path / 'report.html'}\n"
    assert result.stderr == "note    frame 3 is left out\n"


def test_choices(run, pages, tmp_path):
    out, other = tmp_path / "page.html", tmp_path / "reference"
    flags = ("--reference", other, "--no-metric", "--frames", "1-5:2", "--max-mb", "12", "--out", out)
    assert run("report", tmp_path, *flags).exit_code == 0
    assert pages == [(tmp_path, out, Wishes(other, (1, 3, 5), 12.0, has_metric=False))]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("none",), "there is no folder none"),
        ((".",), "no run folder"),
        ((".", "--frames", "5-1"), "5-1"),
        ((".", "--max-mb", "2"), "give 8 or more"),
    ],
)
def test_what_is_refused(run, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    result = run("report", *arguments)
    assert result.exit_code == 2
    assert words in result.stderr
    assert not list(tmp_path.iterdir())
