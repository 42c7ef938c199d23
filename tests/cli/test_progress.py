"""Progress as lines, bars and Open Job Description."""

import io

import pytest
from rich.console import Console
from rich.progress import Progress

from enfilade.cli.progress import BarMonitor, LineMonitor, OpenJdMonitor, clock_time, watch


class Clock:
    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


def test_lines_are_rate_limited_and_the_last_one_always_comes():
    lines, clock = [], Clock()
    monitor = LineMonitor(lines.append, clock, every_s=5.0)
    for done in range(1, 9):
        clock.now += 2.0
        monitor.progress("frames", done, 8)
    assert lines[0] == "frames: 7 to do"
    assert lines[1] == "frames: 4/8, 0:06 passed, about 0:08 left"
    assert lines[-1] == "frames: 8/8, took 0:14"
    assert len(lines) == 4


def test_items_done_before_are_not_part_of_the_pace():
    lines, clock = [], Clock()
    monitor = LineMonitor(lines.append, clock, every_s=1.0)
    monitor.progress("frames", 91, 100)
    clock.now = 20.0
    monitor.progress("frames", 92, 100)
    assert lines == ["frames: 9 to do", "frames: 92/100, 0:20 passed, about 2:40 left"]


def test_nothing_is_estimated_before_there_is_progress():
    lines, clock = [], Clock()
    monitor = LineMonitor(lines.append, clock)
    for done in (0, 0, 50):
        monitor.progress("Cycles", done, 100)
        clock.now += 8.0
    assert lines == [
        "Cycles: 100 to do",
        "Cycles: 0/100, 0:08 passed",
        "Cycles: 50/100, 0:16 passed, about 0:16 left",
    ]


def test_messages_are_lines():
    lines = []
    LineMonitor(lines.append).message("continued")
    OpenJdMonitor(lines.append).message("continued")
    assert lines == ["continued", "continued"]


def test_bars():
    text = io.StringIO()
    with Progress(console=Console(file=text, width=80)) as bars:
        monitor = BarMonitor(bars)
        monitor.progress("frames", 3, 4)
        monitor.progress("clips", 1, 1)
        monitor.progress("frames", 4, 4)
        monitor.message("a message")
        assert [(task.description, task.completed, task.total) for task in bars.tasks] == [
            ("frames", 4, 4),
            ("clips", 1, 1),
        ]
    assert "a message" in text.getvalue()


def test_open_job_description():
    lines = []
    monitor = OpenJdMonitor(lines.append)
    monitor.progress("frames", 1, 4)
    monitor.progress("frames", 2, 4)
    assert lines == ["openjd_status: frames", "openjd_progress: 25.0", "openjd_progress: 50.0"]


@pytest.mark.parametrize(("seconds", "text"), [(0.4, "0:00"), (61.0, "1:01"), (3600.0, "1:00:00")])
def test_clock_time(seconds, text):
    assert clock_time(seconds) == text


def test_quiet_shows_messages_alone_and_a_log_gets_all_lines(capsys):
    for quiet, expected in ((True, "a message\n"), (False, "frames: 1/1, took 0:00\na message\n")):
        with watch(quiet=quiet) as monitor:
            monitor.progress("frames", 1, 1)
            monitor.message("a message")
        assert capsys.readouterr().err == expected
