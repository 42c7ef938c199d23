"""The choice of workers, and what a worker refuses."""

from __future__ import annotations

import dataclasses
import time
from types import SimpleNamespace
from unittest.mock import Mock

import drjit as dr
import pytest

from enfilade.errors import RunFolderError, SettingsError
from enfilade.methods.base import Task
from enfilade.runs import scheduler
from enfilade.runs.executor import InProcess, Order, Workers, open_worker
from enfilade.runs.failure import FailureKind
from enfilade.runs.folder import RunFolder
from enfilade.runs.job import Job
from enfilade.runs.render import prepare
from enfilade.runs.scheduler import open_executor
from enfilade.settings import LimitSettings
from support.toys import order, toy_job


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (("threads",), r"no executor 'threads'; choose one of in-process, processes, ray, ray:ADDRESS"),
        (("ray:",), "lacks the address"),
        (("in-process", 2), "--executor processes"),
        (("processes", 0), "0 workers"),
        (("processes", 2, -1), "-1 threads"),
    ],
)
def test_workers_that_there_are_not(given, words):
    with pytest.raises(SettingsError, match=words):
        Workers(*given)


@pytest.fixture
def begun(tmp_path):
    job = toy_job(tmp_path)
    prepare(job, tmp_path / "run")
    with RunFolder.share(tmp_path / "run") as run:
        yield job, run


@pytest.mark.parametrize(
    ("device", "workers", "slots", "threads"),
    [("llvm", {}, 6, 1), ("cuda", {}, 2, 3), ("llvm", {"count": 2, "threads": 5}, 2, 5)],
)
def test_workers_share_cores_and_gpus(begun, monkeypatch, device, workers, slots, threads):
    monkeypatch.setattr(scheduler, "cores", lambda: 6)
    monkeypatch.setattr(scheduler, "gpus", lambda: ["0", "1"])
    monkeypatch.setattr(scheduler, "active", lambda: SimpleNamespace(backend=device))
    executor = open_executor(*begun, Workers("processes", **workers))
    assert (executor.slots, executor._terms.threads) == (slots, threads)
    assert executor._gpus == (["0", "1"] if device == "cuda" else ())


def test_a_host_with_another_scene_is_refused(begun):
    job, run = begun
    job.scene.file.write_text("another wall")
    with pytest.raises(RunFolderError, match="is not that with which the run began"):
        open_worker(job, run)
    executor = InProcess(job, run)
    executor.begin(0, Order(Task("analysis", 0)))
    assert executor.wait(None)[0].result.kind is FailureKind.FATAL


def test_a_host_with_another_denoiser_is_refused(tmp_path, monkeypatch):
    job = toy_job(tmp_path, method="decoupled")
    monkeypatch.setattr("enfilade.methods.decoupled.method.denoiser_name", lambda: "OIDN 1")
    prepare(job, tmp_path / "run")
    monkeypatch.setattr("enfilade.methods.decoupled.method.denoiser_name", lambda: "OIDN 2")
    run = RunFolder.read(tmp_path / "run")
    with pytest.raises(RunFolderError, match="or of the denoiser is not that with which the run began"):
        open_worker(job, run)


@pytest.mark.parametrize(
    ("paths", "reduction", "left"), [(1 << 20, 4, 1 << 18), (5000, 16, 1024), (1024, 4, 1024)]
)
def test_a_lack_of_memory_reduces_the_paths_in_flight(begun, paths, reduction, left):
    job, run = begun
    job = dataclasses.replace(job, settings=job.settings.replace(LimitSettings, paths_in_flight=paths))
    assert open_worker(job, run, reduction)._job.settings[LimitSettings].paths_in_flight == left


def test_in_process_a_worker_is_kept_until_it_is_discarded(begun, tmp_path):
    executor, workers = InProcess(*begun), []
    assert executor.wait(None) == []
    for reduction in (1, 1, 4):
        executor.begin(0, Order(Task("light", 0), reduction))
        executor.wait(None)
        workers.append(executor._worker)
    assert workers[0] is workers[1] is not workers[2]
    order(tmp_path, light_2="raise")
    executor.begin(0, Order(Task("light", 1), 4))
    failure = executor.wait(None)[0].result
    assert failure.text == "ZeroDivisionError: by nought"
    assert "Traceback" in failure.log
    executor.discard(0)
    assert executor._worker is None


def test_loading_the_scene_counts_in_no_pass(begun, monkeypatch):
    load = Job.open_renderer
    monkeypatch.setattr(Job, "open_renderer", lambda job: (time.sleep(1.0), load(job))[1])
    executor = InProcess(*begun)
    executor.begin(0, Order(Task("analysis", 0)))
    began = time.monotonic()
    line = executor.wait(None)[0].result
    assert time.monotonic() - began > sum(spent["wall_s"] for spent in line["cost"].values()) + 1.0


def test_an_interrupt_that_a_loop_of_drjit_caught_ends_the_run(begun, monkeypatch):
    error = RuntimeError("dr.while_loop(): encountered an exception")
    error.__cause__ = KeyboardInterrupt()
    monkeypatch.setattr("enfilade.runs.executor.open_worker", Mock(side_effect=error))
    executor = InProcess(*begun)
    executor.begin(0, Order(Task("analysis", 0)))
    with pytest.raises(KeyboardInterrupt):
        executor.wait(None)


def test_a_time_limit_needs_processes():
    with pytest.raises(SettingsError, match="add --executor processes"):
        Workers("in-process").check(LimitSettings(task_timeout_s=5.0))


def test_this_process_takes_its_threads(begun):
    open_executor(*begun, Workers(threads=3))
    assert dr.thread_count() == 3
