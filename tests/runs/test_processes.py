"""Worker processes that crash, hang and are killed; a command that is killed with them."""

from __future__ import annotations

import os
import signal
import subprocess
from contextlib import closing

import pytest

from enfilade.errors import EnfiladeError, NoSpaceError, RunFolderError
from enfilade.methods.base import Task
from enfilade.monitor import Silence
from enfilade.runs.executor import Order, Workers
from enfilade.runs.failure import Failure, FailureKind
from enfilade.runs.folder import RunFolder
from enfilade.runs.processes import Processes
from enfilade.runs.render import prepare, render
from enfilade.settings import LimitSettings
from support.toys import Recorder, attempts, command, digest, environment, is_alive, order, toy_job, wait_for

LIGHT = [Task("light", frame) for frame in range(4)]


@pytest.fixture
def opened(tmp_path):
    """Worker processes of a run whose path is analyzed."""
    job = toy_job(tmp_path)
    prepare(job, tmp_path / "run")
    run = RunFolder.share(tmp_path / "run")

    def do(workers=1, gpus=(), **limits):
        executor = Processes(
            run, LimitSettings(**limits), device="cpu", workers=workers, threads=1, gpus=gpus
        )
        return closing(executor)

    with run:
        yield do


def result_of(executor, slot, task):
    executor.begin(slot, Order(task))
    while not (ended := executor.wait(None)):
        pass
    return ended[0].result


def pids_of(executor):
    return [child.process.pid for child in executor._children.values()]


def test_crashes_change_nothing(tmp_path, whole):
    order(tmp_path, light_1="kill", light_2="exit", mean_1="raise", frames_2="leave")
    monitor = Recorder()
    render(toy_job(tmp_path), tmp_path / "run", monitor, Workers("processes", 2))
    assert digest(tmp_path / "run") == whole
    assert sorted(monitor.said) == [
        "frames 2: its worker was killed by SIGKILL; it is tried again",
        "light 1: its worker was killed by SIGKILL; it is tried again",
        "light 2: its worker ended with exit code 7; it is tried again",
        "mean 1: ZeroDivisionError: by nought; it is tried again",
    ]
    assert set(attempts(tmp_path).values()) == {1, 2}
    assert not list((tmp_path / "run").rglob(".*writing*"))


def test_workers_that_hang_or_are_stopped_are_killed(tmp_path, opened):
    order(tmp_path, light_1="hang", light_2="stop")
    with opened(2, task_timeout_s=0.2) as executor:
        for slot in (0, 1):
            executor.begin(slot, Order(LIGHT[slot]))
        pids, ended = pids_of(executor), []
        while len(ended) < 2:
            ended += executor.wait(None)
        wait_for(lambda: not any(is_alive(pid) for pid in pids))
    for end in ended:
        assert end.result.kind is FailureKind.ERROR
        assert "killed: it took more than 0.2 s ([limits] task_timeout_s)" in end.result.text


def test_a_worker_that_is_killed_while_it_loads_the_scene_had_both_limits(tmp_path, opened):
    order(tmp_path, light_1="hang")
    with opened(task_timeout_s=1e-3, preflight_s=0.1) as executor:  # no process begins so fast
        executor.begin(0, Order(LIGHT[0]))
        (ended,) = executor.wait(None)
    assert "took more than 0.101 s ([limits] task_timeout_s and preflight_s)" in ended.result.text


def test_the_time_limit_does_not_include_loading(opened):
    with opened(task_timeout_s=3600.0) as executor:
        executor.begin(0, Order(LIGHT[0]))
        before = executor._children[0].until_s
        assert executor.wait(None) == []  # the scene is loaded
        assert executor._children[0].until_s < before
        assert executor.wait(0.0) is not None


def test_a_worker_is_kept_until_it_fails_or_dies(tmp_path, opened, monkeypatch):
    order(tmp_path, light_3="kill", light_4="full")
    with opened() as executor:
        assert result_of(executor, 0, LIGHT[0])["frame"] == 1
        first = pids_of(executor)
        os.kill(first[0], signal.SIGKILL)  # while it is free
        executor._children[0].process.join()
        assert result_of(executor, 0, LIGHT[1])["frame"] == 2
        second = pids_of(executor)
        assert first != second
        monkeypatch.setattr("enfilade.runs.processes.oom_kills", iter(range(9)).__next__)
        failure = result_of(executor, 0, LIGHT[2])
        assert (failure.kind, failure.log) == (FailureKind.MEMORY, "last words\n")
        assert failure.text == "its worker was killed by SIGKILL, by the kernel, for lack of memory"
        failure = result_of(executor, 0, LIGHT[3])
        assert isinstance(failure.error, NoSpaceError)
        assert "NoSpaceError: no room" in failure.log
        third = pids_of(executor)
        executor.discard(0)
        wait_for(lambda: not is_alive(third[0]))
        executor.discard(0)
        assert pids_of(executor) == []


def test_each_worker_sees_a_gpu_of_its_own(tmp_path, opened):
    with opened(2, gpus=("0", "1")) as executor:
        executor.begin(0, Order(LIGHT[0]))
        executor.begin(1, Order(LIGHT[1]))
        ended = []
        while len(ended) < 2:
            ended += executor.wait(None)
    assert not any(isinstance(end.result, Failure) for end in ended)
    assert [(tmp_path / "attempts" / f"light-{n}").read_text().split()[-1] for n in (1, 2)] == ["0", "1"]


def test_a_worker_that_can_not_be_started(tmp_path, opened, monkeypatch):
    def fail(_process):
        raise BlockingIOError(11, "Resource temporarily unavailable")

    with opened() as executor:
        with monkeypatch.context() as patch:
            patch.setattr("multiprocessing.context.SpawnProcess.start", fail)
            with pytest.raises(EnfiladeError, match="can't start a worker process: Resource temporarily"):
                executor.begin(0, Order(LIGHT[0]))
        (tmp_path / "run" / "logs").rename(tmp_path / "elsewhere")
        (tmp_path / "run" / "logs").write_text("in the way")
        with pytest.raises(RunFolderError, match=r"worker-.*\.log"):
            executor.begin(0, Order(LIGHT[0]))


@pytest.mark.parametrize("blow", [signal.SIGKILL, signal.SIGINT])
def test_workers_end_with_their_command(tmp_path, whole, blow):
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs inherit SIG_IGN
    order(tmp_path, light_3="hang")
    attempt = tmp_path / "attempts" / "light-3"
    with subprocess.Popen(command(tmp_path, "processes", 1), env=environment()) as process:  # noqa: S603
        try:
            wait_for(lambda: attempt.exists() and attempt.read_text().endswith("\n"))
            worker = int(attempt.read_text().split()[0])
            assert is_alive(worker)
            process.send_signal(blow)
            assert process.wait(60) != 0
        finally:
            process.kill()
    wait_for(lambda: not is_alive(worker))
    render(toy_job(tmp_path), tmp_path / "run", Silence())
    assert digest(tmp_path / "run") == whole
    assert attempts(tmp_path)["light-1"] == 1


def test_a_command_that_is_killed_is_continued(tmp_path, whole):
    order(tmp_path, mean_1="leave")
    done = subprocess.run(command(tmp_path, "in-process"), env=environment(), check=False)  # noqa: S603
    assert done.returncode == -signal.SIGKILL
    monitor = Recorder()
    render(toy_job(tmp_path), tmp_path / "run", monitor)
    assert monitor.said == ["removed 1 unfinished files of a run that was interrupted"]
    assert digest(tmp_path / "run") == whole
    assert attempts(tmp_path) == {name: 1 + (name == "mean-1") for name in attempts(tmp_path)}
