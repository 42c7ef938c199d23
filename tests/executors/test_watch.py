"""Workers that hang are told from those that work, and ended; those that work are left alone."""

import os
import re
import signal
import subprocess
import sys

import pytest

from enfilade.errors import SettingsError
from enfilade.executors import FailureKind, Recipe, open_executor, watch
from enfilade.executors.opener import _parsed
from enfilade.executors.watch import Limits, Watch
from toy_worker import nothing, unit

BRIEF = "processes,idle=0.03"  # minutes: 1.8 s, in which a worker that starts uses CPU time


@pytest.mark.parametrize("kind", ["stops", "hangs"])
def test_a_worker_that_does_nothing_is_ended_and_its_unit_done_by_another(work, kind):
    units = [unit("h", kind, times=1), unit("a"), unit("b")]
    ending, told, failures = work(BRIEF, units)
    assert not ending.aside
    assert all((work.folder / name).exists() for name in "hab")
    [(name, what, count, text)] = failures
    assert (name, what, count) == ("h", FailureKind.DIED, 1)
    assert re.match(r"its worker had done nothing for [12]\.", text)
    assert ("it is stopped" if kind == "stops" else "it sleeps") in text
    assert not [report for report in told if report[1] == "say"]


def test_a_worker_that_computes_and_says_nothing_is_left_alone(work):
    ending, _, failures = work(BRIEF, [unit("s", "spins")])
    assert not ending.aside
    assert not failures


def test_a_unit_that_takes_too_long_is_set_aside(work, monkeypatch):
    monkeypatch.setattr("enfilade.executors.supervisor.ATTEMPTS", 2)
    ending, _, _ = work("processes,unit=0.02", [unit("h", "hangs"), unit("a")])
    [(aside, failures)] = ending.aside
    assert aside.name == "h"
    assert "which is the limit for a unit" in failures[-1].text


def test_it_is_said_that_a_worker_does_nothing_before_it_is_ended(work, monkeypatch):
    monkeypatch.setattr(watch, "TOLD_S", 0.5)
    _, told, _ = work(BRIEF, [unit("h", "stops", times=1)])
    news = [value[0] for of, what, value in told if what == "say" and of.name == "h"]
    assert len(news) == 2  # after half a second, and after twice as long
    assert news[0].startswith("h: its worker, process ")
    assert news[0].endswith("(it is stopped); it is ended after 1.8 s")


@pytest.fixture
def clock(monkeypatch):
    """A clock that a test sets, and the CPU time and state of a process."""

    class Clock:
        now, cpu_s, state = 100.0, 0.0, "S"

    monkeypatch.setattr(watch.time, "monotonic", lambda: Clock.now)
    monkeypatch.setattr(watch, "_cpu_of", lambda _: (Clock.cpu_s, Clock.state))
    return Clock


def looked(seen, clock, seconds, *, cpu_s=0.0):
    """Look every five seconds for so long."""
    for _ in range(int(seconds / 5)):
        clock.now += 5.0
        clock.cpu_s += cpu_s
        seen.look()
    return seen.verdict()


def test_a_suspended_machine_ends_no_worker(clock):
    seen = Watch(Limits(unit_s=3600.0), 1)
    for _ in range(10):  # as often asleep for a day
        clock.now += 86400.0
        assert looked(seen, clock, 20) is None
    assert seen.in_hand_s == pytest.approx(10 * (10.0 + 15.0))  # two looks, and three


def test_cpu_time_or_a_word_is_a_sign_of_life(clock):
    seen = Watch(Limits(), 1)
    assert looked(seen, clock, 7200, cpu_s=0.01) is None  # 0.2 % of a core
    assert looked(seen, clock, 570) is None
    seen.hear()
    assert looked(seen, clock, 595) is None
    clock.state = "R"  # it would, but others have the cores
    assert looked(seen, clock, 7200) is None
    clock.state = "D"
    assert "waits for a disk" in looked(seen, clock, 600)


def test_threads_that_only_wake_up_are_no_life(clock):
    assert looked(Watch(Limits(), 1), clock, 600, cpu_s=0.0001) is not None


def test_without_limits_nothing_ends(clock):
    seen = Watch(Limits(unit_s=0.0, idle_s=0.0), 1)
    assert looked(seen, clock, 86400) is None
    assert seen.news() is not None


def test_the_cpu_time_is_that_of_all_threads():
    code = (
        "import threading as t\nx = t.Thread(target=lambda: sum(range(9**8)))\nx.start()\nx.join()\ninput()"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE) as other:  # noqa: S603
        while watch._cpu_of(other.pid)[0] < 0.2:
            assert other.poll() is None
        os.kill(other.pid, signal.SIGSTOP)
        while watch._cpu_of(other.pid)[1] != "T":
            pass
        other.kill()
    assert watch._cpu_of(other.pid) == (0.0, "")


def test_limits_follow_the_name():
    assert _parsed("processes") == ("processes", Limits(unit_s=0.0, idle_s=600.0))
    assert _parsed("processes,idle=30,unit=1.5") == ("processes", Limits(unit_s=90.0, idle_s=1800.0))
    assert _parsed("ray:head:6379,idle=0") == ("ray:head:6379", Limits(idle_s=0.0))


@pytest.mark.parametrize("term", ["idle", "idle=x", "idle=-1", "unit=nan", "unit=inf", "size=3", ""])
def test_limits_that_are_none_are_refused(tmp_path, term):
    with pytest.raises(SettingsError, match="write idle=MINUTES or unit=MINUTES"):
        open_executor(f"processes,{term}", Recipe(""), nothing, workers=1, logs=tmp_path)
    with pytest.raises(SettingsError, match="in-process has no worker to end"):
        open_executor(f"in-process,{term}", Recipe(""), nothing, workers=1, logs=tmp_path)
