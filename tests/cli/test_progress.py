"""Progress: bars on a terminal, few plain lines elsewhere."""

import io

import pytest
from rich.console import Console
from rich.progress import Progress

from enfilade.cli.progress import BarMonitor, LineMonitor, clock_time, watch
from enfilade.monitor import Silence


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
