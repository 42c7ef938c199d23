"""Progress: bars on a terminal, few plain lines elsewhere."""

import io
from types import SimpleNamespace

import pytest
from rich.console import Console
from rich.progress import Progress

from enfilade.cli.progress import BarMonitor, LineMonitor, bars, clock_time, watch
from enfilade.errors import DamagedFileError
from enfilade.executors.inprocess import InProcess
from enfilade.monitor import Silence
from enfilade.pipeline import crew
from enfilade.store import Run
from scenes_analytic import room_walk


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


def test_lines_are_rate_limited_and_the_last_one_always_comes():
    clock, lines = Clock(), []
    monitor = LineMonitor(lines.append, clock, every_s=5.0)
    monitor.stage("keyframes", 10)
    for _ in range(8):
        clock.now += 1.0
        monitor.advance()
    monitor.advance(2)
    monitor.close()
    monitor.close()
    assert lines == [
        "keyframes: 10 to do",
        "keyframes: 5/10, 0:05 passed, about 0:05 left",
        "keyframes: 10/10, took 0:08",
    ]


def test_a_stage_that_grows_counts_the_new_units():
    clock, lines = Clock(), []
    monitor = LineMonitor(lines.append, clock)
    monitor.stage("refine", 1)
    monitor.extend(2)
    monitor.advance(3)
    monitor.stage("fill", 1)
    assert lines[-2:] == ["refine: 3/3, took 0:00", "fill: 1 to do"]


def test_a_stage_that_begins_again_goes_on():
    lines = []
    monitor = LineMonitor(lines.append, Clock())
    monitor.stage("fill", 2)
    monitor.advance(2)
    monitor.stage("fill", 3)
    monitor.advance(3)
    monitor.close()
    assert lines[-1].startswith("fill: 5/5")


def test_units_before_any_stage_are_nobodys():
    lines = []
    monitor = LineMonitor(lines.append, Clock())
    monitor.advance()
    monitor.extend(1)
    monitor.say("continued")
    assert lines == ["continued"]


def test_bars_follow_the_stages():
    out = io.StringIO()
    with Progress(console=Console(file=out, force_terminal=True, width=80)) as progress:
        monitor = BarMonitor(progress)
        monitor.advance()
        monitor.stage("keyframes", 4)
        monitor.advance(3)
        monitor.extend(2)
        monitor.stage("fill", 1)
        monitor.stage("keyframes", 1)
        monitor.say("a [segment] was split")
    first, second = progress.tasks
    assert (first.description, first.completed, first.total) == ("keyframes", 3, 7)
    assert (second.description, second.completed, second.total) == ("fill", 0, 1)
    assert "a [segment] was split" in out.getvalue()


def test_a_bar_knows_the_time_left_of_units_that_take_long():
    clock = Clock()
    with bars(Console(file=io.StringIO(), force_terminal=True, width=80), clock) as progress:
        monitor = BarMonitor(progress)
        monitor.stage("trace", 10)
        for _ in range(4):
            clock.now += 45.0
            monitor.advance()
        assert progress.tasks[0].time_remaining == 6 * 45


def test_a_bar_that_grows_keeps_its_pace():
    clock = Clock()
    with bars(Console(file=io.StringIO(), force_terminal=True, width=80), clock) as progress:
        monitor = BarMonitor(progress)
        monitor.stage("segments", 4)
        for _ in range(4):
            clock.now += 45.0
            monitor.advance()
        assert progress.tasks[0].finished
        monitor.extend(2)
        assert progress.tasks[0].time_remaining == 2 * 45
        monitor.extend(-2)
        assert progress.tasks[0].finished


def traced_lines(folder, monkeypatch, *, done, count=20, damaged=()):
    """What a log says of a run of `count` frames of a minute each, `done` of them before."""
    clock, lines, numbers = Clock(), [], tuple(range(1, count + 1))
    damaged = list(damaged)

    def trace(_kind, facts):
        number = numbers[facts["frame"]]
        clock.now += 60.0
        if number in damaged:
            damaged.remove(number)
            raise DamagedFileError("it is damaged", "frames/0001.exr")
        run.finish(f"frame {number}", files=[], facts={})

    maker = SimpleNamespace(make=lambda _tell, **_: trace)
    monkeypatch.setattr(crew, "_open", lambda *_: InProcess(maker, print))
    job = SimpleNamespace(method="reference", path=room_walk(count, size=(8, 6)))
    with Run.open(folder / "run", {"count": count}) as run:
        for number in numbers[:done]:
            run.finish(f"frame {number}", files=[], facts={})
        monitor = LineMonitor(lines.append, clock)
        crew.carry_out(job, run, crew.Crew(), monitor, is_wanted=lambda unit: unit.kind == "reference")
    monitor.close()
    return lines


def test_what_was_done_before_took_none_of_the_time(tmp_path, monkeypatch):
    assert traced_lines(tmp_path, monkeypatch, done=16) == [
        "done before: trace 16 of 20",
        "trace: 4 to do",
        "trace: 2/4, 1:00 passed, about 2:00 left",
        "trace: 3/4, 2:00 passed, about 1:00 left",
        "trace: 4/4, took 3:00",
    ]


def test_the_lock_says_how_many_work(tmp_path, monkeypatch):
    signed = []
    monkeypatch.setattr(
        crew, "sign_workers", lambda folder, workers, _part: signed.append((folder.name, workers))
    )
    traced_lines(tmp_path, monkeypatch, done=18)
    assert signed == [("run", 1)]


def test_work_that_begins_anew_after_damage_is_counted_once(tmp_path, monkeypatch):
    lines = traced_lines(tmp_path, monkeypatch, done=0, count=5, damaged=[4])
    assert lines[0] == "trace: 5 to do"
    assert lines[-1].startswith("trace: 5/5, took")
    assert "done before" not in "".join(lines)


@pytest.mark.parametrize(("seconds", "text"), [(0.4, "0:00"), (61.0, "1:01"), (3600.0, "1:00:00")])
def test_clock_time(seconds, text):
    assert clock_time(seconds) == text


def test_quiet_is_silent_and_a_log_gets_lines(capsys):
    with watch(quiet=True) as monitor:
        assert isinstance(monitor, Silence)
    with watch(quiet=False) as monitor:
        assert isinstance(monitor, LineMonitor)
        monitor.say("hello")
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "hello\n")
