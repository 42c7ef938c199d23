"""Who still works on a run, where nothing but the time since its last sign can tell."""

import json
import os
from datetime import UTC, datetime

import pytest

from enfilade.reports import alive
from enfilade.reports.alive import silence, silent_since
from enfilade.reports.contents import contents
from enfilade.reports.film import Film
from enfilade.reports.live import Live
from enfilade.reports.page import Wishes
from enfilade.reports.seen import SeenRun

NOW_S = 1_800_000_000.0
HOUR_S = 3600.0


def writer(ago_s, host="elsewhere"):
    started = datetime.fromtimestamp(NOW_S - ago_s, UTC).isoformat(timespec="seconds")
    return {"host": host, "pid": 7, "started": started, "workers": 2}


def line(wall_s):
    return {"unit": "frame 1", "cost": {"fill": {"wall_s": wall_s}, "antialias": {"wall_s": 1.0}}}


@pytest.fixture
def now(monkeypatch):
    monkeypatch.setattr(alive, "time", lambda: NOW_S)


def finished(folder, ago_s, name="ledger.jsonl"):
    """A ledger to which a line was added so long ago."""
    file = folder / name
    file.parent.mkdir(exist_ok=True)
    file.touch()
    os.utime(file, (NOW_S - ago_s, NOW_S - ago_s))


@pytest.mark.usefixtures("now")
@pytest.mark.parametrize(
    ("ledgers_s", "began_s", "longest_s", "silent_s"),
    [
        ({"ledger.jsonl": 599.0}, [HOUR_S], 1.0, None),
        ({"ledger.jsonl": 601.0}, [HOUR_S], 1.0, 601.0),
        ({"ledger.jsonl": 601.0}, [HOUR_S], 200.0, None),
        ({"ledger.jsonl": 1100.0}, [HOUR_S], 200.0, 1100.0),
        ({"ledger.jsonl": HOUR_S}, [5 * HOUR_S, 30.0], 1.0, None),
        ({"ledger.jsonl": HOUR_S, "parts/a.jsonl": 30.0}, [5 * HOUR_S], 1.0, None),
        ({"ledger.jsonl": HOUR_S}, [], 1.0, None),
        ({}, [HOUR_S], None, HOUR_S),
        ({"ledger.jsonl": -50.0}, [HOUR_S], 1.0, None),
    ],
    ids=[
        "a short silence", "a long one", "long units", "longer than those", "just gone on with",
        "another share", "nobody", "no unit yet", "a clock that is late",
    ],
)  # fmt: skip
def test_a_silence_is_long_beside_what_units_take(tmp_path, ledgers_s, began_s, longest_s, silent_s):
    for name, ago_s in ledgers_s.items():
        finished(tmp_path, ago_s, name)
    lines = [] if longest_s is None else [line(2.0), line(longest_s)]
    found = silent_since(tmp_path, [writer(ago_s) for ago_s in began_s], lines)
    assert (found and NOW_S - found.timestamp()) == silent_s


@pytest.mark.usefixtures("now")
def test_a_lock_that_another_program_wrote_tells_no_time(tmp_path):
    strange = {**writer(0.0), "started": "yesterday"}
    assert silent_since(tmp_path, [strange], []) is None
    finished(tmp_path, HOUR_S)
    assert silent_since(tmp_path, [strange], []) is not None


@pytest.mark.usefixtures("now")
@pytest.mark.parametrize(
    ("ago_s", "expected"), [(-9.0, 0), (599.0, 0), (601.0, 1), (1201.0, 2), (2399.0, 2), (2401.0, 3)]
)
def test_silences_are_told_apart_when_they_double(tmp_path, ago_s, expected):
    finished(tmp_path, ago_s)
    assert silence(tmp_path, [writer(9 * HOUR_S)]) == expected
    assert silence(tmp_path, []) == 0


@pytest.fixture
def left_alone(copied):
    """A run whose process on another host finished its last unit a day ago."""
    ledger = copied / "ledger.jsonl"
    ledger.write_text("".join(ledger.read_text().splitlines(keepends=True)[:-4]))
    (copied / "run.lock").write_text(json.dumps({**writer(0.0), "started": "2020-01-01T10:00:00+00:00"}))
    then_s = datetime(2020, 1, 2, 3, 4, 5, tzinfo=UTC).timestamp()
    os.utime(ledger, (then_s, then_s))
    return copied


def said(folder):
    return contents(SeenRun(folder), None, Film((0, 0)))


def test_a_run_that_was_left_alone_is_not_running(left_alone):
    page = said(left_alone)
    assert page["state"]["word"] == "unfinished"
    assert "process 7 on elsewhere" in page["state"]["text"]
    assert "nothing was finished since 2020-01-02 03:04 UTC" in page["state"]["text"]
    assert page["left"] == ""
    assert page["ahead"].text.startswith("the time left is not known")
    os.utime(left_alone / "ledger.jsonl")
    page = said(left_alone)
    assert page["state"]["word"] == "running"
    assert page["left"]


def test_a_page_that_is_served_tells_of_silence(left_alone, monkeypatch):
    monkeypatch.setattr("enfilade.reports.live.LEAST_S", 0.0)
    monkeypatch.setattr("enfilade.reports.live.REST", 0.0)
    os.utime(left_alone / "ledger.jsonl")
    with Live(left_alone, Wishes(has_metric=False)) as served:
        pages = served._pages
        assert b"state-running" in pages.find("page")[1]
        os.utime(left_alone / "ledger.jsonl", (NOW_S - 1e9, NOW_S - 1e9))
        pages.find("state")
        assert b"state-unfinished" in pages.find("page")[1]
        assert b"nothing was finished since" in pages.find("page")[1]
