"""The live report: on loopback, behind its token, following the run."""

import errno
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request

import pytest
from click.testing import CliRunner

from enfilade.cli import main
from enfilade.errors import RunFolderError
from enfilade.reports import live
from enfilade.reports.live import Live
from enfilade.reports.page import Wishes
from enfilade.store.lock import Lock, sign_workers


@pytest.fixture
def copied(runs, tmp_path):
    return shutil.copytree(runs / "paper", tmp_path / "run")


def get(address, name="", **headers):
    request = urllib.request.Request(address + name, headers=headers)  # noqa: S310
    with urllib.request.urlopen(request, timeout=60) as answer:  # noqa: S310
        return answer.read().decode(), answer.headers


def status(address, name="", **headers):
    with pytest.raises(urllib.error.HTTPError) as error:
        get(address, name, **headers)
    with error.value as answer:
        return answer.code


def test_who_knows_the_token_sees_the_report(copied):
    with Live(copied, Wishes(has_metric=False)) as served:
        assert served.address.startswith("http://127.0.0.1:")
        page, headers = get(served.address, "page")
        assert "<title>" in page
        assert headers["Cache-Control"] == "no-store"
        assert 'src="page?1"' in get(served.address)[0]
        assert state(served) == {"version": 1, "problem": ""}
        assert status(served.address, "other") == 404


def test_others_see_nothing(copied):
    with Live(copied, Wishes(has_metric=False)) as served:
        base, _, token = served.address.rstrip("/").rpartition("/")
        assert len(token) >= 43  # 256 bits
        for name in ("/", "/page", f"/{token[:-1]}/page", f"/{token}x/page", f"/%2e%2e/{token}/page"):
            assert status(base, name) == 404
        assert status(served.address, "page", Host="evil.example") == 404
        with Live(copied, Wishes()) as other:
            assert token not in other.address


def state(served):
    return json.loads(get(served.address, "state")[0])


@pytest.fixture
def no_rest(monkeypatch):
    """Pages are made as soon as there is something new."""
    monkeypatch.setattr(live, "LEAST_S", 0.0)
    monkeypatch.setattr(live, "REST", 0.0)


@pytest.mark.usefixtures("no_rest")
def test_it_follows_the_run(copied):
    ledger = copied / "ledger.jsonl"
    lines = ledger.read_text().splitlines(keepends=True)
    ledger.write_text("".join(lines[:-4]))
    with Live(copied, Wishes(has_metric=False)) as served:
        first, before = get(served.address, "page")[0], state(served)
        assert "nobody is at work" in first
        ledger.write_text("".join(lines))
        assert state(served)["version"] > before["version"]
        assert "nobody is at work" not in get(served.address, "page")[0]
        (copied / "run.json").write_text("{")
        ledger.write_text("".join(lines[:-1]))
        assert "run.json" in state(served)["problem"]
        assert get(served.address, "page")[0]  # the last one that could be made


@pytest.mark.usefixtures("no_rest")
def test_what_fails_on_this_machine_is_tried_again(copied, monkeypatch):
    ledger = copied / "ledger.jsonl"
    lines = ledger.read_text().splitlines(keepends=True)
    ledger.write_text("".join(lines[:-4]))
    with Live(copied, Wishes(has_metric=False)) as served:
        ledger.write_text("".join(lines))
        for name in ("write_page", "_progress"):
            with monkeypatch.context() as patch:
                patch.setattr(live, name, full)
                assert "No space left" in state(served)["problem"]
                assert get(served.address, "page")[0]
            assert state(served)["problem"] == ""
        assert state(served)["version"] >= 2


def full(*_):
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.usefixtures("no_rest")
def test_it_follows_those_who_share_the_run(copied):
    ledger, parts = copied / "ledger.jsonl", copied / "parts"
    lines = ledger.read_text().splitlines(keepends=True)
    parts.mkdir()
    ledger.write_text("".join(lines[:-4]))
    with Live(copied, Wishes(has_metric=False)) as served:
        (parts / "frames-1-of-2.jsonl").write_text(lines[-4])
        assert state(served)["version"] == 2
        assert state(served)["version"] == 2
        (parts / "clips-1-of-1.jsonl").write_text("".join(lines[-3:]))
        assert state(served)["version"] == 3
        assert "nobody is at work" not in get(served.address, "page")[0]


@pytest.mark.usefixtures("no_rest")
def test_it_tells_who_is_at_work(copied):
    ledger = copied / "ledger.jsonl"
    ledger.write_text("".join(ledger.read_text().splitlines(keepends=True)[:-4]))
    lock = Lock(copied)
    with Live(copied, Wishes(has_metric=False)) as served:
        assert f"process {os.getpid()} on " in get(served.address, "page")[0]
        sign_workers(copied, 4)
        assert state(served)["version"] == 2
        assert "4 at a time" in get(served.address, "page")[0]
        gone = {"host": socket.gethostname(), "pid": 2**22 + 1, "started": "2026-01-01T00:00:00+00:00"}
        (copied / "run.lock").write_text(json.dumps(gone))  # as of one that was killed
        assert state(served)["version"] == 3
        assert "nobody is at work" in get(served.address, "page")[0]
    lock.release()


def test_those_who_share_a_run_are_all_at_work(copied):
    (copied / "parts").mkdir()
    ledger = copied / "ledger.jsonl"
    ledger.write_text("".join(ledger.read_text().splitlines(keepends=True)[:-4]))
    lock = Lock(copied, part="frames-1-of-2")
    sign_workers(copied, 3)
    other = {"host": "another", "pid": 7, "started": "2026-01-01T00:00:00+00:00", "workers": 2}
    (copied / "parts" / "frames-2-of-2.lock").write_text(json.dumps(other))
    with Live(copied, Wishes(has_metric=False)) as served:
        page = get(served.address, "page")[0]
        assert f"process {os.getpid()} on " in page
        assert ", and 1 more" in page
        assert "5 at a time" in page
    lock.release()


def test_it_rests_longer_than_a_page_takes(copied, monkeypatch):
    now = [0.0]

    def write(folder, file, wishes, monitor):
        now[0] += 20.0
        file.write_text("a page")
        return []

    monkeypatch.setattr(live, "monotonic", lambda: now[0])
    monkeypatch.setattr(live, "write_page", write)
    lock = Lock(copied)
    with Live(copied, Wishes()) as served, (copied / "ledger.jsonl").open("a") as ledger:
        ledger.write("\n")
        ledger.flush()
        for passed, version in ((5.0, 1), (190.0, 1), (10.0, 2)):
            now[0] += passed
            assert state(served)["version"] == version
        now[0] += 5.0
        lock.release()  # now the last page takes nothing away from the run
        assert state(served)["version"] == 3


def test_a_run_that_has_just_begun_is_followed(copied):
    (copied / "ledger.jsonl").unlink()
    with Live(copied, Wishes()) as served:
        assert "No frame to show yet" in get(served.address, "page")[0]


def test_what_is_no_run_is_refused_before_it_is_served(tmp_path):
    folder = tmp_path / "<img src=x onerror=alert(1)>"
    folder.mkdir()
    with pytest.raises(RunFolderError, match="no run folder"):
        Live(folder, Wishes())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("typo",), "there is no folder"),
        (("run", "--frames", "99"), "has no frame 99"),
        (("run", "--max-mb", "1"), "give 8 or more"),
    ],
)
def test_the_command_refuses_what_cannot_be_shown(copied, monkeypatch, arguments, words):
    monkeypatch.setattr(Live, "wait", lambda _: None)
    monkeypatch.chdir(copied.parent)
    result = CliRunner().invoke(main, ["report", *arguments, "--serve"], prog_name="enfilade")
    assert result.exit_code == 2
    assert words in result.stderr
    assert "http" not in result.stdout


def test_the_command_serves_until_it_is_interrupted(copied):
    line = [sys.executable, "-m", "enfilade", "report", str(copied), "--serve", "--no-metric"]
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True, preexec_fn=_heed_interrupts) as process:  # noqa: S603, PLW1509
        try:
            assert process.stdout is not None
            address = process.stdout.readline().split()[1]
            assert "iframe" in get(address)[0]
            process.send_signal(signal.SIGINT)
            assert process.wait(20) == 0
        finally:
            process.kill()


def _heed_interrupts():
    """Commands that a shell has put in the background ignore ^C, and hand that on."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
