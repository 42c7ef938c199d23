"""Tasks that fail are tried again, quarantined, or done with fewer paths; damaged files are made again."""

from __future__ import annotations

import numpy as np
import pytest

from enfilade.errors import EnfiladeError, NoSpaceError, SettingsError, UnfinishedError
from enfilade.methods.base import Method, Output, Pass, Task, TaskId
from enfilade.records import Frame, Provenance
from enfilade.runs.executor import Ended, InProcess
from enfilade.runs.folder import RunFolder
from enfilade.runs.render import render
from enfilade.runs.scheduler import shortened
from support.toys import Recorder, attempts, digest, flip, order, toy_job


@pytest.fixture
def rendered(tmp_path):
    """Render into ``run``; returns the monitor."""

    def do(frames=4, monitor=None, **tables):
        monitor = monitor or Recorder()
        render(toy_job(tmp_path, frames, **tables), tmp_path / "run", monitor)
        return monitor

    return do


def test_failed_tasks_are_tried_again_with_the_same_result(tmp_path, rendered, whole):
    order(tmp_path, light_2="raise raise", mean_1="disk", frames_4="raise")
    monitor = rendered()
    assert digest(tmp_path / "run") == whole
    tries = attempts(tmp_path)
    assert (tries["light-2"], tries["mean-1"], tries["frames-4"], tries["light-1"]) == (3, 2, 2, 1)
    assert "light 2: ZeroDivisionError: by nought; it is tried again" in monitor.said
    assert not (tmp_path / "run" / "failed").exists()


def test_attempts_are_some_time_apart(tmp_path, rendered, monkeypatch):
    monkeypatch.setattr("enfilade.runs.scheduler.DELAYS_S", (7.0, 50.0))
    now, slept = [0.0], []

    def sleep(seconds):
        slept.append(seconds)
        now[0] += seconds

    monkeypatch.setattr("enfilade.runs.scheduler.time.monotonic", lambda: now[0])
    monkeypatch.setattr("enfilade.runs.scheduler.time.sleep", sleep)
    order(tmp_path, light_2="raise raise")
    rendered()
    assert slept == [7.0, 50.0]  # all other tasks that could be done are done


def test_a_task_that_fails_again_and_again_is_quarantined(tmp_path, rendered, whole):
    order(tmp_path, light_2="raise raise raise")
    monitor = Recorder()
    with pytest.raises(UnfinishedError, match=r"1 tasks failed 3 times each: light 2 .*7 more") as error:
        rendered(monitor=monitor)
    assert error.value.tasks == ("light 2",)
    assert "light 2: ZeroDivisionError: by nought; it is quarantined" in monitor.said
    log = (tmp_path / "run" / "failed" / "light-2.log").read_text()
    assert log.count("Traceback") == 3
    assert "attempt 3: ZeroDivisionError: by nought" in log
    assert attempts(tmp_path) == {"light-1": 1, "light-2": 3, "light-3": 1, "light-4": 1}
    rendered()
    assert digest(tmp_path / "run") == whole


def test_many_failures_without_a_success_end_the_run(tmp_path, rendered):
    order(tmp_path, **{f"light_{number}": "raise raise raise" for number in range(1, 9)})
    with pytest.raises(UnfinishedError, match="4 tasks failed"):
        rendered(8)
    assert sum(count == 3 for count in attempts(tmp_path).values()) == 4


@pytest.mark.parametrize(("how", "error"), [("full", NoSpaceError), ("refuse", SettingsError)])
def test_full_disks_and_wrong_input_end_the_run_at_once(tmp_path, rendered, whole, how, error):
    order(tmp_path, mean_1=how)
    with pytest.raises(error):
        rendered()
    assert attempts(tmp_path)["mean-1"] == 1
    rendered()
    assert digest(tmp_path / "run") == whole
    assert attempts(tmp_path)["light-1"] == 1


class Batches(InProcess):
    """Two workers whose results come together."""

    slots = 2

    def __init__(self, job, run, _workers):
        super().__init__(job, run)
        self._batch = []

    def begin(self, slot, order):
        self._batch.append((slot, order))

    def wait(self, timeout_s):
        batch, self._batch = self._batch, []
        ended = []
        for slot, task in batch:
            super().begin(slot, task)
            ended.append(Ended(slot, super().wait(timeout_s)[0].result))
        return ended


def test_results_beside_a_fatal_failure_are_kept(tmp_path, rendered, monkeypatch):
    monkeypatch.setattr("enfilade.runs.scheduler.open_executor", Batches)
    order(tmp_path, light_1="refuse")
    with pytest.raises(SettingsError):
        rendered()
    assert attempts(tmp_path) == {"light-1": 1, "light-2": 1}
    rendered()
    assert attempts(tmp_path)["light-2"] == 1


def test_after_a_lack_of_memory_fewer_paths_are_in_flight(tmp_path, rendered, whole):
    order(tmp_path, light_2="memory memory")
    monitor = rendered(limits={"paths_in_flight": 1 << 20})
    assert digest(tmp_path / "run") == whole
    paths = [int(line.split()[1]) for line in (tmp_path / "attempts" / "light-2").read_text().splitlines()]
    assert paths == [1 << 20, 1 << 18, 1 << 16]
    assert "light 2: MemoryError: out of it; it is tried again, with fewer paths in flight" in monitor.said
    assert (tmp_path / "attempts" / "frames-4").read_text().split()[1] == str(1 << 16)  # and it stays so
    lines = {(line["pass"], line["frame"]): line for line in RunFolder.read(tmp_path / "run").lines()}
    assert lines["light", 2]["reduction"] == lines["frames", 4]["reduction"] == 16
    assert "reduction" not in lines["analysis", 1]


def test_fewer_paths_are_in_flight_after_a_damaged_file_too(tmp_path, rendered):
    order(tmp_path, light_1="memory")
    rendered(limits={"paths_in_flight": 1 << 20}, monitor=damaged_after(tmp_path, "light/0002.exr", 1 + 4))
    last = (tmp_path / "attempts" / "light-2").read_text().splitlines()[-1]
    assert last.split()[1] == str(1 << 18)


def damaged_after(tmp_path, name, tasks):
    """A monitor that damages a file when so many tasks are done."""
    return Recorder(tasks, lambda: flip(tmp_path / "run" / name))


def test_a_damaged_file_is_made_again(tmp_path, rendered, whole, monkeypatch):
    monkeypatch.setattr("enfilade.runs.worker.CACHED_RECORDS", 1)  # else it is in memory
    monitor = rendered(monitor=damaged_after(tmp_path, "light/0002.exr", 1 + 4))
    assert "light/0002.exr is missing or damaged: its task is done again" in monitor.said
    assert digest(tmp_path / "run") == whole
    assert attempts(tmp_path)["light-2"] == 2
    assert RunFolder.read(tmp_path / "run").damaged() == []


def test_a_file_that_is_lost_during_the_run_is_made_again(tmp_path, rendered, whole):
    lost = tmp_path / "run" / "frames" / "0003.exr"
    rendered(monitor=Recorder(1 + 4 + 1 + 4, lost.unlink))  # before it is encoded
    assert digest(tmp_path / "run") == whole
    assert attempts(tmp_path)["frames-3"] == 2


def test_a_file_that_is_damaged_again_and_again_ends_the_run(tmp_path, rendered):
    class Destructive(Recorder):
        def progress(self, name, done, _total):
            if name == "frames" and done == 4:
                flip(tmp_path / "run" / "frames" / "0002.exr")

    with pytest.raises(
        EnfiladeError, match=r"frames/0002\.exr was damaged 3 times during the run; check its disk"
    ):
        rendered(monitor=Destructive())
    assert attempts(tmp_path)["frames-2"] == 3


class Circular(Method):
    """Tasks that need each other."""

    name = "circular"
    passes = (Pass("frames"),)

    def tasks(self, _analysis):
        yield Task("frames", 0, needs=(TaskId("frames", 1),))
        yield Task("frames", 1, needs=(TaskId("frames", 0),))

    def run(self, _task, _inputs, _walk):
        raise NotImplementedError


class Hasty(Circular):
    """A task that reads a record that no task has written."""

    passes = (Pass("light", int), Pass("frames", reads=("light",)))

    def tasks(self, _analysis):
        yield Task("frames", 0)

    def run(self, _task, inputs, _walk):
        inputs.record("light", 0)


class Doubled(Circular):
    """Two tasks that write the same files, of different sizes."""

    passes = (Pass("frames", Frame),)

    def tasks(self, _analysis):
        return [Task("frames", 0), Task("frames", 1)]

    def run(self, task, _inputs, walk):
        shape = walk.path.height, walk.path.width
        color = np.random.default_rng(0).random((*shape, 3), np.float32) * task.frame
        frame = Frame(color, np.full(shape, Provenance.REUSED, np.uint8))
        return Output({0: frame, 1: frame})


class Reserved(Circular):
    passes = (Pass("video"), Pass("frames"))


class Frameless(Circular):
    passes = (Pass("light"),)

    def tasks(self, _analysis):
        yield Task("light", 0)


class Stray(Circular):
    def tasks(self, _analysis):
        yield Task("frames", 0)
        yield Task("ligth", 0)


class Needy(Circular):
    def tasks(self, _analysis):
        yield Task("frames", 0, needs=(TaskId("light", 0),))


@pytest.fixture
def own_methods(monkeypatch):
    own = (Circular, Hasty, Doubled, Reserved, Frameless, Stray, Needy)
    kinds = {kind.__name__.lower(): kind for kind in own}
    monkeypatch.setattr("enfilade.runs.job.open_method", lambda name: kinds[name]())


@pytest.mark.usefixtures("own_methods")
def test_defects_of_a_method_are_said(tmp_path):
    with pytest.raises(EnfiladeError, match=r"need each other: frames 1, frames 2"):
        render(toy_job(tmp_path, 2, method="circular"), tmp_path / "circular", Recorder())
    with pytest.raises(UnfinishedError, match=r"no finished task has written light/0001\.exr"):
        render(toy_job(tmp_path, 2, method="hasty"), tmp_path / "hasty", Recorder())
    with pytest.raises(
        EnfiladeError, match="frames 1: finished 3 times, and not done yet; several tasks write"
    ):
        render(toy_job(tmp_path, 2, method="doubled"), tmp_path / "doubled", Recorder())


@pytest.mark.usefixtures("own_methods")
@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("reserved", "the name of the pass video is that of a pass of every run"),
        ("frameless", "it has no task of the pass frames"),
        ("stray", "its task ligth 0 is of none of its passes"),
        ("needy", "its task frames 0 needs light 0, no task"),
    ],
)
def test_tasks_that_contradict_the_passes_of_a_method_are_refused(tmp_path, name, problem):
    with pytest.raises(EnfiladeError, match=f"--method {name}: {problem}"):
        render(toy_job(tmp_path, 2, method=name), tmp_path / name, Recorder())


def test_long_lists_of_tasks_are_shortened():
    assert shortened(["a", "b"]) == "a, b"
    assert shortened([str(n) for n in range(8)]) == "0, 1, 2, 3, 4 and 3 more"
