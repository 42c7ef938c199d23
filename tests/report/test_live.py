"""The live report: on loopback, behind its token, following the run."""

import json
import shutil
import signal
import subprocess
import sys
import urllib.error
import urllib.request

import pytest

from enfilade.report import live
from enfilade.report.live import Live
from enfilade.report.page import Wishes


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
        assert 'src="page"' in get(served.address)[0]
        assert json.loads(get(served.address, "state")[0])["problem"] == ""
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


def test_it_follows_the_run(copied, monkeypatch):
    monkeypatch.setattr(live, "LEAST_S", 0.0)
    ledger = copied / "ledger.jsonl"
    lines = ledger.read_text().splitlines(keepends=True)
    ledger.write_text("".join(lines[:-4]))
    with Live(copied, Wishes(has_metric=False)) as served:
        first, before = get(served.address, "page")[0], json.loads(get(served.address, "state")[0])
        assert "nobody is at work" in first
        ledger.write_text("".join(lines))
        after = json.loads(get(served.address, "state")[0])
        assert after["version"] > before["version"]
        assert "nobody is at work" not in get(served.address, "page")[0]
        (copied / "run.json").write_text("{")
        ledger.write_text("".join(lines[:-1]))
        assert "run.json" in json.loads(get(served.address, "state")[0])["problem"]
        assert get(served.address, "page")[0]  # the last one that could be made


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
